/// The board's clock, and beside it the cycle counter, which the emulator runs at 1 GHz.
#pragma once

#include <cstdint>

#include "hal/common/uart_console.hpp"
#include "hal/zcu102/ttc_clock.hpp"
#include "hal/zcu102/uart.hpp"

namespace target {

using namespace hal::zcu102;

inline TtcClock<hal::Mmio<kTtc0>> timer({}, {.reference_hz = timer_reference_hz()});
inline Uart<hal::Mmio<kUart0>> uart({});
inline hal::UartConsole console(uart);

inline void start() {
    uart.start(baud_rate(kReferenceHz, 115'200));
    asm volatile("mcr p15, 0, %0, c9, c12, 0" ::"r"(1U | 1U << 2));
    asm volatile("mcr p15, 0, %0, c9, c12, 1" ::"r"(1U << 31));
    timer.start();
}

/// Since the last call, at most 4 s ago.
inline std::uint32_t independent_ns() {
    static std::uint32_t last = 0;
    std::uint32_t now = 0;
    asm volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(now)::"memory");
    const std::uint32_t passed = now - last;
    last = now;
    return passed;
}

}  // namespace target
