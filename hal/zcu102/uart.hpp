/// A UART of the Zynq UltraScale+, polled; 64 bytes of FIFO each way.
#pragma once

#include <cstdint>
#include <string_view>

#include "hal/common/mmio.hpp"
#include "hal/contract/console.hpp"
#include "hal/zcu102/registers.hpp"

namespace hal::zcu102 {

/// Baud rate = reference / (generator * (divider + 1)), 8N1.
struct BaudRate {
    std::uint32_t generator = 0;  ///< CD, 1..65535
    std::uint32_t divider = 0;    ///< BDIV, 4..255
};

/// The pair with the smallest error; the smallest divider, that is the most samples of a bit, of several.
constexpr BaudRate baud_rate(std::uint32_t reference_hz, std::uint32_t baud) {
    BaudRate best;
    std::uint32_t best_error = baud;
    for (std::uint32_t divider = 4; divider <= 255; ++divider) {
        const std::uint32_t generator = (reference_hz / baud + (divider + 1) / 2) / (divider + 1);
        if (generator < 1 || generator > 65535) continue;
        const std::uint32_t actual = reference_hz / (generator * (divider + 1));
        const std::uint32_t error = actual > baud ? actual - baud : baud - actual;
        if (error < best_error) {
            best = {generator, divider};
            best_error = error;
        }
    }
    return best;
}

template <RegisterBlock Registers>
class Uart {
  public:
    explicit Uart(Registers registers) : registers_(registers) {}

    void start(BaudRate rate) {
        using namespace uart_reg;
        registers_.write(kIntrptDis, 0x3FFF);
        registers_.write(kControl, kControlRxres | kControlTxres);
        registers_.write(kMode, kModeParNone);
        registers_.write(kBaudRateGen, rate.generator);
        registers_.write(kBaudRateDivider, rate.divider);
        registers_.write(kControl, kControlRxen | kControlTxen);
    }

    /// The next received byte, or -1.
    int read() {
        using namespace uart_reg;
        if ((registers_.read(kChannelSts) & kStsRempty) != 0) return -1;
        return static_cast<int>(registers_.read(kTxRxFifo) & 0xFF);
    }

    /// Waits for room, for no longer than 64 bytes take on the wire. False: the byte was not taken.
    bool write(std::uint8_t byte) {
        using namespace uart_reg;
        for (int i = 0; i < kPatience; ++i) {
            if ((registers_.read(kChannelSts) & kStsTfull) == 0) {
                registers_.write(kTxRxFifo, byte);
                return true;
            }
        }
        return false;
    }

    /// Whether bytes were lost because the FIFO was full; asking clears it.
    bool overrun() {
        using namespace uart_reg;
        const bool lost = (registers_.read(kChnlIntSts) & kIntRover) != 0;
        if (lost) registers_.write(kChnlIntSts, kIntRover);
        return lost;
    }

  private:
    /// Status reads of about 20 ns and more: a byte leaves the FIFO every 87 us at 115200 baud.
    static constexpr int kPatience = 100'000;

    Registers registers_;
};

}  // namespace hal::zcu102
