/// From reset to main, and what the program may ask about its memory. For bare-metal boards.
#pragma once

#include <cstdint>

namespace hal {

struct MemoryUse {
    std::uint32_t rom_bytes = 0;         ///< code, constants and initial values
    std::uint32_t static_ram_bytes = 0;  ///< data and bss
    std::uint32_t stack_bytes = 0;       ///< reserved
    std::uint32_t stack_used_bytes = 0;  ///< most that was ever used since start
};

/// Walks over the part of the stack that was never used: a few thousand instructions.
MemoryUse memory_use();

/// Prepares memory, runs constructors, and calls main. Entered with the stack pointer at the top of the
/// stack.
extern "C" [[noreturn]] void start_program();

}  // namespace hal
