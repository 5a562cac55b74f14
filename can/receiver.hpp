/// The receiving end: frames to messages that can be believed.
#pragma once

#include <array>
#include <cstdint>

#include "can/codec.hpp"
#include "can/e2e.hpp"
#include "can/signals.hpp"

namespace can {

enum class Reception : std::uint8_t {
    ok,
    ok_some_lost,    ///< good, but frames before it never came
    repeated,        ///< E2E: same counter as before
    wrong_sequence,  ///< E2E: counter too far ahead
    bad_crc,         ///< E2E: CRC wrong or counter impossible
    wrong_length,    ///< not the length of its message
    out_of_range,    ///< intact, but a signal is outside its range
    unknown_id,      ///< not the expected message
};

constexpr bool is_good(Reception reception) {
    return reception == Reception::ok || reception == Reception::ok_some_lost;
}

/// One counter a Reception, modulo 2^32. Each frame counts once; `lost` counts the frames that never came, as
/// far as counters 0..14 tell.
struct ReceiveCounters {
    std::uint32_t good = 0;  ///< ok and ok_some_lost
    std::uint32_t lost = 0;
    std::uint32_t repeated = 0;
    std::uint32_t wrong_sequence = 0;
    std::uint32_t bad_crc = 0;
    std::uint32_t wrong_length = 0;
    std::uint32_t out_of_range = 0;
    std::uint32_t unknown_id = 0;

    constexpr std::uint32_t rejected() const {
        return repeated + wrong_sequence + bad_crc + wrong_length + out_of_range + unknown_id;
    }
    bool operator==(const ReceiveCounters&) const = default;
};

/// Checks frames from one bus and keeps the E2E state of every message. The caller dispatches on the
/// identifier:
///
///     switch (frame.id) {
///         case can::ego::kMessage.id: if (is_good(receiver.receive(frame, ego_motion))) age = 0; break;
///         ...
///         default: receiver.ignore();
///     }
///
/// A message is written only by a good frame, so it always holds the last one that can be believed.
class Receiver {
  public:
    explicit Receiver(const E2eConfig& config = {}) : config_(config) {}

    template <class Message>
    Reception receive(const Frame& frame, Message& message) {
        Reception reception = check(frame);
        if (is_good(reception) && !decode(frame, message)) reception = Reception::out_of_range;
        return count(reception);
    }

    /// A frame that nobody here listens to.
    Reception ignore() { return count(Reception::unknown_id); }

    /// The profile's state of a message after its last frame. An identifier that is none of ours:
    /// no_new_data.
    E2eStatus status(std::uint16_t id) const;
    /// Nothing came within the message's period: its state becomes no_new_data.
    void no_new_data(std::uint16_t id);

    const ReceiveCounters& counters() const { return counters_; }

  private:
    Reception check(const Frame& frame);
    Reception count(Reception reception);

    E2eConfig config_;
    std::array<E2eReceiverState, kIdCount> states_{};
    ReceiveCounters counters_;
};

}  // namespace can
