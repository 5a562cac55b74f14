# What every board image has in common. Included by the toolchain file of a board, which sets RADAR_CPU_FLAGS.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_ASM_COMPILER arm-none-eabi-gcc)
set(CMAKE_OBJDUMP arm-none-eabi-objdump)
set(CMAKE_NM arm-none-eabi-nm)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_EXECUTABLE_SUFFIX_CXX .elf)

# Header-only Debian packages (Eigen) are the same for every processor; programs and libraries are not.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)

# The data association methods of an image are those of tracking::Associator up to this one. Up to ospda, an image is
# within 96 KiB ROM and 64 KiB static RAM; imm_pdaf is all of them.
set(RADAR_LAST_ASSOCIATOR ospda CACHE STRING "nn, pda, ospda, jpda, osjpda, ipda, ... imm_pdaf")
add_compile_definitions(RADAR_LAST_ASSOCIATOR=${RADAR_LAST_ASSOCIATOR})

# No floating-point unit may be used (-mfloat-abi=soft) and no helper for one is linked: toolchains/check_image.py looks.
# EIGEN_NO_MALLOC turns a dynamic matrix into a compile error, NDEBUG and EIGEN_NO_DEBUG keep asserts (which print) out.
string(JOIN " " CMAKE_CXX_FLAGS_INIT ${RADAR_CPU_FLAGS} -mfloat-abi=soft -ffunction-sections -fdata-sections -fno-exceptions
       -fno-rtti -fno-threadsafe-statics -fno-unwind-tables -fno-asynchronous-unwind-tables -fno-common -fstack-usage
       -DEIGEN_NO_MALLOC -DEIGEN_NO_DEBUG -DEIGEN_NO_IO -DEIGEN_DONT_VECTORIZE)
set(CMAKE_CXX_FLAGS_RELEASE_INIT "-O2 -DNDEBUG")
string(JOIN " " CMAKE_ASM_FLAGS_INIT ${RADAR_CPU_FLAGS} -mfloat-abi=soft)
# Start-up code and the memory map are ours; of the libraries only what is referenced comes in (memcpy, 64-bit division).
string(JOIN " " CMAKE_EXE_LINKER_FLAGS_INIT ${RADAR_CPU_FLAGS} -mfloat-abi=soft -nostartfiles --specs=nano.specs
       -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--no-warn-rwx-segments)
