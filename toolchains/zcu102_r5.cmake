# Xilinx ZCU102, real-time processing unit of the Zynq UltraScale+: Cortex-R5F, the reference board.
set(RADAR_BOARD zcu102)
set(RADAR_BOARD_NAME "ZCU102, Cortex-R5F")
set(RADAR_CPU_FLAGS -mcpu=cortex-r5 -mthumb)
include(${CMAKE_CURRENT_LIST_DIR}/arm_none_eabi.cmake)
