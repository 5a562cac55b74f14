/// A CMSDK UART. It holds a single byte each way, so reception is by interrupt; transmission waits for the
/// line.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/common/byte_queue.hpp"
#include "hal/common/mmio.hpp"
#include "hal/mps2/registers.hpp"

namespace hal::mps2 {

/// QueueBytes: received bytes that may wait while the loop is busy; at 1 Mbaud a hundred a millisecond.
template <RegisterBlock Registers, std::size_t QueueBytes>
class Uart {
  public:
    explicit Uart(Registers registers) : registers_(registers) {}

    /// 25 MHz divides exactly to 1 Mbaud; 115200 baud are 0.006 % off.
    void start(std::uint32_t baud) {
        using namespace uart_reg;
        registers_.write(kCtrl, 0);
        registers_.write(kBauddiv, (kClockHz + baud / 2) / baud);
        registers_.write(kIntclear, 0xF);
        registers_.write(kCtrl, kListening);
    }

    /// The receive interrupt. When the queue is full the byte stays in the UART and the interrupt stays off
    /// until read() made room; what the line brings meanwhile is an overrun.
    void on_receive() {
        using namespace uart_reg;
        registers_.write(kIntclear, kIntRx);
        while ((registers_.read(kState) & kStateRxFull) != 0) {
            if (queue_.free() == 0) {
                registers_.write(kCtrl, kListening & ~kCtrlRxInterrupt);
                blocked_ = true;
                return;
            }
            queue_.put(static_cast<std::uint8_t>(registers_.read(kData)));
        }
    }

    /// The next received byte, or -1.
    int read() {
        const int byte = queue_.get();
        // A byte that comes while the interrupt is off raises none when it is on again: look once more after
        // that.
        while (blocked_ && queue_.free() > 0) {
            blocked_ = false;
            on_receive();
            if (blocked_) break;
            registers_.write(uart_reg::kCtrl, kListening);
            if ((registers_.read(uart_reg::kState) & uart_reg::kStateRxFull) == 0) break;
            registers_.write(uart_reg::kCtrl, kListening & ~uart_reg::kCtrlRxInterrupt);
            blocked_ = true;
        }
        return byte;
    }

    /// Waits for the byte before to leave. False: not taken within kPatience, far more than a byte takes.
    bool write(std::uint8_t byte) {
        using namespace uart_reg;
        for (int i = 0; i < kPatience; ++i) {
            if ((registers_.read(kState) & kStateTxFull) == 0) {
                registers_.write(kData, byte);
                return true;
            }
        }
        return false;
    }

    /// Whether received bytes were lost; asking clears it.
    bool overrun() {
        using namespace uart_reg;
        const bool lost = (registers_.read(kState) & kStateRxOverrun) != 0;
        if (lost) registers_.write(kState, kStateRxOverrun);
        return lost;
    }

  private:
    static constexpr std::uint32_t kListening =
        uart_reg::kCtrlTxEnable | uart_reg::kCtrlRxEnable | uart_reg::kCtrlRxInterrupt;
    /// Polls of at least 4 clocks: a byte at 115200 baud takes 2170 clocks.
    static constexpr int kPatience = 2000;

    Registers registers_;
    ByteQueue<QueueBytes> queue_;
    volatile bool blocked_ = false;
};

}  // namespace hal::mps2
