#include "hal/bare_metal/startup.hpp"

#include <cstddef>

#include "hal/bare_metal/reset_record.hpp"

// Set by the linker script; only their addresses mean something.
extern "C" {
extern std::uint32_t _stack_bottom, _stack_top, _data_start, _data_end, _bss_start, _bss_end;
extern const std::uint32_t _data_load;
extern char _rom_bytes, _ram_bytes;
extern void (*const _init_array_start[])();
extern void (*const _init_array_end[])();
int main();
}

namespace {

constexpr std::uint32_t kStackPaint = 0x5AFE'57AC;

[[noreturn]] void end_of_program() {
    hal::reset_board({.cause = hal::ResetCause::aborted});
}

}  // namespace

namespace hal {

void start_program() {
    // Through volatile pointers: the compiler must not take the linker's symbols for single words, nor use
    // memset, which could be spread over the stack that is being painted.
    const std::uintptr_t in_use = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)) - 128;
    for (volatile std::uint32_t* p = &_stack_bottom; reinterpret_cast<std::uintptr_t>(p) < in_use; ++p)
        *p = kStackPaint;
    const volatile std::uint32_t* from = &_data_load;
    for (volatile std::uint32_t* p = &_data_start; p < &_data_end; ++p) *p = *from++;
    for (volatile std::uint32_t* p = &_bss_start; p < &_bss_end; ++p) *p = 0;
    for (void (*const* f)() = _init_array_start; f < _init_array_end; ++f) (*f)();
    main();
    end_of_program();
}

MemoryUse memory_use() {
    const volatile std::uint32_t* p = &_stack_bottom;
    const volatile std::uint32_t* const top = &_stack_top;
    while (p < top && *p == kStackPaint) ++p;
    return {.rom_bytes = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&_rom_bytes)),
            .static_ram_bytes = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&_ram_bytes)),
            .stack_bytes = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&_stack_top) -
                                                      reinterpret_cast<std::uintptr_t>(&_stack_bottom)),
            .stack_used_bytes = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(top) -
                                                           reinterpret_cast<std::uintptr_t>(p))};
}

}  // namespace hal

// What the compiler and the C++ library may call when something that cannot happen does. Theirs print or
// throw.
extern "C" {
[[noreturn]] void abort() {
    end_of_program();
}
[[noreturn]] void __cxa_pure_virtual() {
    end_of_program();
}
/// Objects of static storage are never destroyed: main does not return.
int __cxa_atexit(void (*)(void*), void*, void*) {
    return 0;
}
void* __dso_handle = nullptr;
}
