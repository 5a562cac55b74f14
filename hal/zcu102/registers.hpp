/// Registers of the Zynq UltraScale+ devices the radar uses, named as in the register reference UG1087;
/// behaviour from the technical reference manual UG1085.
#pragma once

#include <cstdint>

namespace hal::zcu102 {

inline constexpr std::uintptr_t kUart0 = 0xFF00'0000;
inline constexpr std::uintptr_t kUart1 = 0xFF01'0000;
inline constexpr std::uintptr_t kCan0 = 0xFF06'0000;
inline constexpr std::uintptr_t kCan1 = 0xFF07'0000;
inline constexpr std::uintptr_t kTtc0 = 0xFF11'0000;
inline constexpr std::uintptr_t kSwdt = 0xFF15'0000;  ///< the low-power domain's, which watches the RPU
inline constexpr std::uintptr_t kCrlApb = 0xFF5E'0000;
inline constexpr std::uintptr_t kPmuGlobal = 0xFFD8'0000;

/// LPD_LSBUS_CLK, UART_REF_CLK and CAN_REF_CLK as the board's first stage boot loader sets them.
inline constexpr std::uint32_t kReferenceHz = 100'000'000;

namespace can_reg {
inline constexpr std::uint32_t kSrr = 0x00, kMsr = 0x04, kBrpr = 0x08, kBtr = 0x0C, kEcr = 0x10, kEsr = 0x14,
                               kSr = 0x18, kIsr = 0x1C, kIer = 0x20, kIcr = 0x24, kTcr = 0x28, kWir = 0x2C;
inline constexpr std::uint32_t kTxfifoId = 0x30, kTxfifoDlc = 0x34, kTxfifoData1 = 0x38, kTxfifoData2 = 0x3C;
inline constexpr std::uint32_t kRxfifoId = 0x50, kRxfifoDlc = 0x54, kRxfifoData1 = 0x58, kRxfifoData2 = 0x5C;
inline constexpr std::uint32_t kAfr = 0x60, kAfmr1 = 0x64, kAfir1 = 0x68, kAfmr2 = 0x6C, kAfir2 = 0x70;

inline constexpr std::uint32_t kSrrSrst = 1U << 0, kSrrCen = 1U << 1;
inline constexpr std::uint32_t kSrConfig = 1U << 0, kSrNormal = 1U << 3, kSrBidle = 1U << 4,
                               kSrEstat = 3U << 7, kSrEstatBusOff = 2U << 7, kSrEstatPassive = 3U << 7,
                               kSrTxfll = 1U << 10, kSrAcfbsy = 1U << 11;
inline constexpr std::uint32_t kIsrTxok = 1U << 1, kIsrRxoflw = 1U << 6, kIsrRxnemp = 1U << 7,
                               kIsrBsoff = 1U << 9, kIsrTxfemp = 1U << 14, kIsrAll = 0x7FFF;
/// Identifier word of the FIFOs and filters. For a standard frame bit 20 is the remote transmission request.
inline constexpr std::uint32_t kIdShift = 21, kIdMask = 0x7FFU << 21, kIdRtr = 1U << 20, kIdIde = 1U << 19;
inline constexpr std::uint32_t kDlcShift = 28;
}  // namespace can_reg

namespace uart_reg {
inline constexpr std::uint32_t kControl = 0x00, kMode = 0x04, kIntrptDis = 0x0C, kChnlIntSts = 0x14,
                               kBaudRateGen = 0x18, kRcvrFifoTriggerLevel = 0x20, kChannelSts = 0x2C,
                               kTxRxFifo = 0x30, kBaudRateDivider = 0x34;
inline constexpr std::uint32_t kControlRxres = 1U << 0, kControlTxres = 1U << 1, kControlRxen = 1U << 2,
                               kControlTxen = 1U << 4;
inline constexpr std::uint32_t kModeParNone = 4U << 3;  ///< with 8 data bits and 1 stop bit, which are zeros
inline constexpr std::uint32_t kIntRover = 1U << 5;
inline constexpr std::uint32_t kStsRempty = 1U << 1, kStsTfull = 1U << 4;
}  // namespace uart_reg

namespace ttc_reg {  ///< of timer 1; timers 2 and 3 follow at 4 and 8
inline constexpr std::uint32_t kClockControl = 0x00, kCounterControl = 0x0C, kCounterValue = 0x18,
                               kIntervalCounter = 0x24, kInterruptEnable = 0x60;
inline constexpr std::uint32_t kClockPsEn = 1U << 0, kClockPsValShift = 1;
inline constexpr std::uint32_t kCounterInt = 1U << 1, kCounterRst = 1U << 4, kCounterWaveDisable = 1U << 5;
}  // namespace ttc_reg

namespace swdt_reg {
inline constexpr std::uint32_t kMode = 0x00, kControl = 0x04, kRestart = 0x08, kStatus = 0x0C;
inline constexpr std::uint32_t kModeWden = 1U << 0, kModeRsten = 1U << 1, kModeKey = 0xABCU << 12;
inline constexpr std::uint32_t kControlCrvShift = 2, kControlKey = 0x248U << 14;
inline constexpr std::uint32_t kRestartKey = 0x1999;
}  // namespace swdt_reg

namespace crl_reg {
inline constexpr std::uint32_t kLpdLsbusCtrl = 0x0A8, kResetCtrl = 0x218, kResetReason = 0x220;
inline constexpr std::uint32_t kResetCtrlSoftReset = 1U << 4;
}  // namespace crl_reg

namespace pmu_reg {
inline constexpr std::uint32_t kPersGlobGenStorage0 = 0x050, kErrorStatus1 = 0x530, kErrorSrstEn1 = 0x56C,
                               kErrorEn1 = 0x5A0;
inline constexpr std::uint32_t kErrorLpdSwdt = 1U << 12;
}  // namespace pmu_reg

}  // namespace hal::zcu102
