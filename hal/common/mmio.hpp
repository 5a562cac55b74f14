/// Memory-mapped registers of a device. A driver takes the register block as a template argument, so that the
/// unit tests can put a register-level fake in its place.
#pragma once

#include <concepts>
#include <cstdint>

namespace hal {

template <class T>
concept RegisterBlock = requires(T block, std::uint32_t word) {
    { block.read(word) } -> std::same_as<std::uint32_t>;
    block.write(word, word);
};

/// The real thing: 32-bit accesses at Base + offset, in program order.
template <std::uintptr_t Base>
struct Mmio {
    // NOLINTBEGIN(performance-no-int-to-ptr): this is what a register is.
    static std::uint32_t read(std::uint32_t offset) {
        return *reinterpret_cast<const volatile std::uint32_t*>(Base + offset);
    }
    static void write(std::uint32_t offset, std::uint32_t value) {
        *reinterpret_cast<volatile std::uint32_t*>(Base + offset) = value;
    }
    // NOLINTEND(performance-no-int-to-ptr)
};

}  // namespace hal
