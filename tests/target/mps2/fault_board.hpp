/// Faults of the Cortex-M; the second one is a loop that hangs while the watchdog runs.
#pragma once

#include "firmware/text_line.hpp"
#include "hal/bare_metal/reset_record.hpp"
#include "hal/common/uart_console.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"

namespace target {

using namespace hal::mps2;

inline constexpr hal::ResetCause kUndefined = hal::ResetCause::hard_fault;
inline constexpr hal::ResetCause kSecond = hal::ResetCause::watchdog;

inline Uart<hal::Mmio<kUart0>, 64> uart({});
inline hal::UartConsole console(uart);

inline void start() {
    uart.start(115'200);
}
inline hal::ResetRecord last_record() {
    return hal::begin_reset_record();
}
inline void second_fault() {
    CmsdkWatchdog<hal::Mmio<kWatchdog>> watchdog({});
    watchdog.start();
    for (;;) asm volatile("");
}
inline void say(std::string_view what, std::string_view cause, std::uint32_t pc) {
    console.line(firmware::TextLine().text(what).text(cause).text(", pc ").hex(pc).view());
}

}  // namespace target
