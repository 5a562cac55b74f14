/// CAN frames as text over a serial line, the Lawicel ASCII protocol ("SLCAN"), which Linux's slcand attaches
/// as a SocketCAN interface. To the other end the board is a CAN adapter with one busy node on its bus: the
/// radar.
///
/// Answered: `Sn` (bit rate, n 0 to 8), `O` open, `C` close, `tIIILDD..` (a frame for the radar),
/// `TIIIIIIIILDD..`, `rIIIL`, `RIIIIIIIIL` (understood, not for us), `F` status, `V` version, `N` serial
/// number, `Z0` no time stamps. Each command ends with CR and is answered with CR, or BEL when it was
/// refused.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "can/frame.hpp"
#include "hal/contract/can_port.hpp"

namespace hal {

/// The longest text of a frame: 't', three digits, length, 16 digits, CR.
inline constexpr std::size_t kSlcanFrameCharacters = 22;

struct SlcanText {
    std::array<char, kSlcanFrameCharacters> characters{};
    std::size_t size = 0;

    [[nodiscard]] std::string_view view() const { return {characters.data(), size}; }
};

/// A frame as text. Identifier below 0x800, length at most 8.
SlcanText encode_slcan(const can::Frame& frame);

enum class SlcanEvent : std::uint8_t {
    none,      ///< command not complete yet, or an empty line
    answer,    ///< a command without a frame; answer() says what to reply
    frame,     ///< a standard data frame; answer() too
    rejected,  ///< a well-formed frame that is extended or a request; answer() too
    malformed  ///< not a command, or not allowed now; answer() is BEL
};

/// The commands of one line, byte by byte. A command of more than 30 characters is malformed as a whole.
class SlcanParser {
  public:
    SlcanEvent push(std::uint8_t byte);

    [[nodiscard]] const can::Frame& frame() const { return frame_; }
    [[nodiscard]] std::string_view answer() const { return answer_; }
    [[nodiscard]] bool is_open() const { return open_; }

  private:
    SlcanEvent interpret();
    SlcanEvent interpret_frame(std::size_t id_digits, bool has_data);
    SlcanEvent answer_with(std::string_view text, SlcanEvent event = SlcanEvent::answer);
    SlcanEvent refuse();

    std::array<char, 32> line_{};
    std::size_t size_ = 0;  ///< characters received of the command, which may be more than fit
    can::Frame frame_;
    std::string_view answer_;
    bool open_ = false;
};

/// The CAN port. `Serial`: `int read()`, `bool write(std::uint8_t)`, `bool overrun()`. Nothing is queued, so
/// there is never an old list to discard: a frame is on the line when send() returns, 220 us later at 1
/// Mbaud.
template <class Serial>
class SlcanPort final : public CanPort {
  public:
    explicit SlcanPort(Serial& serial) : serial_(serial) {}

    /// Dropped while the channel is closed or when the line does not take it.
    bool send(const can::Frame& frame) override {
        if (!parser_.is_open() || !write(encode_slcan(frame).view())) {
            ++counters_.dropped;
            return false;
        }
        ++counters_.sent;
        return true;
    }

    bool receive(can::Frame& frame) override {
        for (int i = 0; i < kMostBytes; ++i) {
            const int byte = serial_.read();
            if (byte < 0) return false;
            const SlcanEvent event = parser_.push(static_cast<std::uint8_t>(byte));
            if (event == SlcanEvent::none) continue;
            write(parser_.answer());
            if (event == SlcanEvent::malformed) ++malformed_;
            if (event == SlcanEvent::rejected) ++counters_.rejected;
            if (event == SlcanEvent::frame) {
                ++counters_.received;
                frame = parser_.frame();
                return true;
            }
        }
        return false;
    }

    void begin_cycle() override {
        if (serial_.overrun()) ++counters_.receive_overflow;
    }

    CanState state() override { return parser_.is_open() ? CanState::active : CanState::down; }
    CanCounters counters() override { return counters_; }
    [[nodiscard]] std::uint32_t malformed() const { return malformed_; }

  private:
    static constexpr int kMostBytes = 4096;  ///< looked at in one call, so that a flood cannot hold the loop

    bool write(std::string_view text) {
        for (const char c : text) {
            if (!serial_.write(static_cast<std::uint8_t>(c))) return false;
        }
        return true;
    }

    Serial& serial_;
    SlcanParser parser_;
    CanCounters counters_;
    std::uint32_t malformed_ = 0;
};

}  // namespace hal
