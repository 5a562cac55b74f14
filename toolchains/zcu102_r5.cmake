# Xilinx ZCU102, real-time processing unit of the Zynq UltraScale+: Cortex-R5F, the reference board.
set(RADAR_BOARD zcu102)
set(RADAR_BOARD_NAME "ZCU102, Cortex-R5F")
set(RADAR_EMULATED_BOARD zcu102)
set(RADAR_FLOATING_POINT_UNIT vfpv3-d16)  # of the image that must not pass
# Thumb: ARM code takes 4 % fewer instructions for the loop and 27 % more ROM.
# Scheduled for a Cortex-M4: for their own processor gcc keeps more values waiting than there are registers.
set(RADAR_CPU_FLAGS -mcpu=cortex-r5 -mtune=cortex-m4 -mthumb)
include(${CMAKE_CURRENT_LIST_DIR}/arm_none_eabi.cmake)
