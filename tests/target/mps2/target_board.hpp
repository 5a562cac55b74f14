/// What the replay needs of an MPS2 board: SLCAN over a line that the test holds both ends of.
#pragma once

#include <array>
#include <cstdint>

#include "can/frame.hpp"
#include "hal/common/slcan.hpp"
#include "hal/common/uart_console.hpp"
#include "hal/mps2/system_control.hpp"
#include "hal/mps2/uart.hpp"

namespace target {

using hal::Mmio;
using namespace hal::mps2;

/// Lets instructions() count.
inline void start_counting() {
    SystemControl::write(scs_reg::kSystRvr, 0x00FF'FFFF);
    SystemControl::write(scs_reg::kSystCvr, 0);
    SystemControl::write(scs_reg::kSystCsr, scs_reg::kSystEnable | scs_reg::kSystProcessorClock);
}

/// Instructions since start_counting(), modulo 2^32: SysTick at 25 MHz under -icount shift=0, 40 instructions
/// a tick.
inline std::uint32_t instructions() {
    static std::uint32_t last = 0;
    static std::uint32_t ticks = 0;
    const std::uint32_t now = SystemControl::read(scs_reg::kSystCvr);
    ticks += (last - now) & 0x00FF'FFFF;
    last = now;
    return 40 * ticks;
}

/// Both directions of a serial line, as memory.
class Line {
  public:
    int read() { return next_ < to_board_.size ? to_board_.bytes[next_++] : -1; }
    bool write(std::uint8_t byte) { return from_board_.put(byte); }
    static bool overrun() { return false; }

    void type(std::string_view text) {
        if (next_ == to_board_.size) next_ = to_board_.size = 0;
        for (const char c : text) to_board_.put(static_cast<std::uint8_t>(c));
    }
    /// What the board wrote since the last call, byte by byte.
    int heard() {
        if (heard_ < from_board_.size) return from_board_.bytes[heard_++];
        heard_ = from_board_.size = 0;
        return -1;
    }

  private:
    struct Buffer {
        std::array<std::uint8_t, 2048> bytes{};
        std::size_t size = 0;
        bool put(std::uint8_t byte) {
            if (size == bytes.size()) return false;
            bytes[size++] = byte;
            return true;
        }
    };
    Buffer to_board_, from_board_;
    std::size_t next_ = 0;
    std::size_t heard_ = 0;
};

/// The radar's side of the bus, and the car's, which is an adapter's host.
class TestBus {
  public:
    template <class Timer>
    using Port = hal::SlcanPort<Line>;

    template <class Timer>
    explicit TestBus(Timer&) {}

    template <class Timer>
    static Port<Timer> make_port(TestBus& bus, Timer&) {
        return Port<Timer>(bus.line_);
    }
    void start(hal::SlcanPort<Line>& port) {
        start_counting();
        line_.type("C\rS6\rO\r");
        can::Frame none;
        port.receive(none);
        for (int c = 0; c >= 0;) c = line_.heard();
    }
    void to_radar(const can::Frame& frame) { line_.type(hal::encode_slcan(frame).view()); }
    bool from_radar(can::Frame& frame) {
        for (int c = line_.heard(); c >= 0; c = line_.heard()) {
            if (host_.push(static_cast<std::uint8_t>(c)) != hal::SlcanEvent::frame) continue;
            frame = host_.frame();
            return true;
        }
        return false;
    }

  private:
    /// Understands the board's frames; a channel of its own, opened once.
    struct Host : hal::SlcanParser {
        Host() {
            push('O');
            push('\r');
        }
    };
    Line line_;
    Host host_;
};

inline Uart<Mmio<kUart0>, 64> uart({});
inline hal::UartConsole uart_console(uart);
inline void start_uart() {
    uart.start(115'200);
}

}  // namespace target
