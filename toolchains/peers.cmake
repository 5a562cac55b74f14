# The 16-bit variant of KissFFT as the library peer_kissfft16, where toolchains/peers.sh has fetched its source. Its names
# end in _int16: the float variant may be in the same program.
file(GLOB kissfft_source ${PROJECT_SOURCE_DIR}/build/peers/kissfft-*/kiss_fft.c)
if(kissfft_source)
    get_filename_component(kissfft_directory ${kissfft_source} DIRECTORY)
    add_library(peer_kissfft16 STATIC ${kissfft_source})
    set_source_files_properties(${kissfft_source} PROPERTIES LANGUAGE CXX COMPILE_OPTIONS -w)
    target_include_directories(peer_kissfft16 SYSTEM PUBLIC ${kissfft_directory})
    target_compile_definitions(peer_kissfft16 PUBLIC FIXED_POINT=16 kiss_fft_state=kiss_fft_state_int16 PRIVATE NDEBUG)
    foreach(name kiss_fft kiss_fft_alloc kiss_fft_stride kiss_fft_cleanup kiss_fft_next_fast_size)
        target_compile_definitions(peer_kissfft16 PUBLIC ${name}=${name}_int16)
    endforeach()
endif()
