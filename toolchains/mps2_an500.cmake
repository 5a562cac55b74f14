# Arm MPS2 with the FPGA image AN500: Cortex-M7.
set(RADAR_BOARD mps2)
set(RADAR_BOARD_NAME "MPS2 AN500, Cortex-M7")
set(RADAR_EMULATED_BOARD mps2-an500)
set(RADAR_FLOATING_POINT_UNIT fpv5-d16)  # of the image that must not pass
# Scheduled for a Cortex-M4: for their own processor gcc keeps more values waiting than there are registers.
set(RADAR_CPU_FLAGS -mcpu=cortex-m7 -mtune=cortex-m4 -mthumb)
include(${CMAKE_CURRENT_LIST_DIR}/arm_none_eabi.cmake)
