/// Faults of the Cortex-R5.
#pragma once

#include "firmware/text_line.hpp"
#include "hal/common/uart_console.hpp"
#include "hal/zcu102/reset.hpp"
#include "hal/zcu102/uart.hpp"

namespace target {

using namespace hal::zcu102;

inline constexpr hal::ResetCause kUndefined = hal::ResetCause::undefined_instruction;
inline constexpr hal::ResetCause kSecond = hal::ResetCause::supervisor_call;

inline Uart<hal::Mmio<kUart0>> uart({});
inline hal::UartConsole console(uart);

inline void start() {
    uart.start(baud_rate(kReferenceHz, 115'200));
}
inline hal::ResetRecord last_record() {
    return begin_run();
}
inline void second_fault() {
    asm volatile("svc #1" ::: "lr");
}
inline void say(std::string_view what, std::string_view cause, std::uint32_t pc) {
    console.line(firmware::TextLine().text(what).text(cause).text(", pc ").hex(pc).view());
}

}  // namespace target
