/// The board's clock, and beside it the second CMSDK timer.
#pragma once

#include <cstdint>

#include "hal/common/uart_console.hpp"
#include "hal/mps2/system_control.hpp"
#include "hal/mps2/systick_clock.hpp"
#include "hal/mps2/uart.hpp"

namespace target {

using namespace hal::mps2;

using Timer1 = hal::Mmio<0x4000'1000>;

inline SysTickClock<SystemControl, hal::Mmio<kTimer0>> timer({}, {});
inline Uart<hal::Mmio<kUart0>, 64> uart({});
inline hal::UartConsole console(uart);

inline void start() {
    uart.start(115'200);
    SystemControl::enable_irq(kTimer0Irq);
    Timer1::write(timer_reg::kReload, 0xFFFF'FFFF);
    Timer1::write(timer_reg::kValue, 0xFFFF'FFFF);
    Timer1::write(timer_reg::kCtrl, timer_reg::kCtrlEnable);
    timer.start();
}

/// Since the last call, at most 4 s ago; the timer counts 25 MHz down.
inline std::uint32_t independent_ns() {
    static std::uint32_t last = 0xFFFF'FFFF;
    const std::uint32_t now = Timer1::read(timer_reg::kValue);
    const std::uint32_t passed = 40 * (last - now);
    last = now;
    return passed;
}

}  // namespace target

// Included by one source of an image.
extern "C" void timer0_handler() {
    target::timer.on_alarm();
}
