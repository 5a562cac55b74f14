/// Registers of the Arm MPS2 devices the radar uses, named as in the Cortex-M System Design Kit manual (DDI
/// 0479) and the Armv7-M architecture manual; addresses and interrupts from the application notes AN386 and
/// AN500.
#pragma once

#include <cstdint>

namespace hal::mps2 {

inline constexpr std::uint32_t kClockHz = 25'000'000;  ///< processor, SysTick and peripherals

inline constexpr std::uintptr_t kTimer0 = 0x4000'0000;
inline constexpr std::uintptr_t kUart0 = 0x4000'4000;
inline constexpr std::uintptr_t kUart1 = 0x4000'5000;
inline constexpr std::uintptr_t kUart2 = 0x4000'6000;
inline constexpr std::uintptr_t kWatchdog = 0x4000'8000;
inline constexpr std::uintptr_t kSystemControl = 0xE000'E000;  ///< SysTick, NVIC and SCB

inline constexpr std::uint32_t kUart0RxIrq = 0, kUart1RxIrq = 2, kUart2RxIrq = 4, kTimer0Irq = 8;

namespace uart_reg {
inline constexpr std::uint32_t kData = 0x00, kState = 0x04, kCtrl = 0x08, kIntclear = 0x0C, kBauddiv = 0x10;
inline constexpr std::uint32_t kStateTxFull = 1U << 0, kStateRxFull = 1U << 1, kStateRxOverrun = 1U << 3;
inline constexpr std::uint32_t kCtrlTxEnable = 1U << 0, kCtrlRxEnable = 1U << 1, kCtrlRxInterrupt = 1U << 3;
inline constexpr std::uint32_t kIntRx = 1U << 1;
}  // namespace uart_reg

namespace timer_reg {
inline constexpr std::uint32_t kCtrl = 0x00, kValue = 0x04, kReload = 0x08, kIntclear = 0x0C;
inline constexpr std::uint32_t kCtrlEnable = 1U << 0, kCtrlInterrupt = 1U << 3;
}  // namespace timer_reg

namespace watchdog_reg {
inline constexpr std::uint32_t kLoad = 0x000, kValue = 0x004, kControl = 0x008, kIntclr = 0x00C, kRis = 0x010,
                               kLock = 0xC00;
inline constexpr std::uint32_t kControlInten = 1U << 0, kControlResen = 1U << 1;
inline constexpr std::uint32_t kUnlock = 0x1ACC'E551;
}  // namespace watchdog_reg

namespace scs_reg {
inline constexpr std::uint32_t kSystCsr = 0x010, kSystRvr = 0x014, kSystCvr = 0x018, kNvicIser0 = 0x100,
                               kIcsr = 0xD04, kAircr = 0xD0C, kCcr = 0xD14, kCfsr = 0xD28, kBfar = 0xD38;
inline constexpr std::uint32_t kSystEnable = 1U << 0, kSystProcessorClock = 1U << 2;
inline constexpr std::uint32_t kAircrSysresetreq = 0x05FA'0000 | 1U << 2;
inline constexpr std::uint32_t kCcrDiv0Trap = 1U << 4;
}  // namespace scs_reg

}  // namespace hal::mps2
