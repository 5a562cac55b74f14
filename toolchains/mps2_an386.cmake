# Arm MPS2 with the FPGA image AN386: Cortex-M4.
set(RADAR_BOARD mps2)
set(RADAR_BOARD_NAME "MPS2 AN386, Cortex-M4")
set(RADAR_EMULATED_BOARD mps2-an386)
set(RADAR_FLOATING_POINT_UNIT fpv4-sp-d16)  # of the image that must not pass
set(RADAR_CPU_FLAGS -mcpu=cortex-m4 -mthumb)
include(${CMAKE_CURRENT_LIST_DIR}/arm_none_eabi.cmake)
