/// End-to-end protection of classic CAN frames, AUTOSAR E2E profile 11 (data id mode "both", offset 0).
///
/// Byte 0 is a CRC-8 over the 16-bit data id (low byte, high byte) and then every byte after the CRC; the low
/// nibble of byte 1 is a counter 0..14. The CRC is SAE J1850's polynomial 0x1D; the profile's start value and
/// final XOR cancel, so that it starts at 0 and ends without XOR.
#pragma once

#include <cstdint>
#include <span>

#include "can/frame.hpp"

namespace can {

inline constexpr std::uint8_t kE2eCounters = 15;  ///< 0..14; 15 is never sent

struct E2eConfig {
    /// Greatest step of the counter that is still accepted, 1..14. Larger rides through more lost frames, but
    /// weakens the detection of frames that are delayed or replayed: one in kE2eCounters / max_delta passes.
    std::uint8_t max_delta = 3;

    constexpr bool valid() const { return max_delta >= 1 && max_delta < kE2eCounters; }
};
static_assert(E2eConfig{}.valid());

/// The profile's receiver states, for the last call of e2e_check.
enum class E2eStatus : std::uint8_t {
    ok,              ///< the next frame, intact
    ok_some_lost,    ///< intact, and at most max_delta - 1 before it never came
    repeated,        ///< intact, but the same counter again: not new
    wrong_sequence,  ///< intact, but more than max_delta ahead: lost too many, or out of order
    error,           ///< wrong CRC, impossible counter or too short: nothing in it can be believed
    no_new_data,     ///< nothing arrived
};

constexpr bool is_usable(E2eStatus status) {
    return status == E2eStatus::ok || status == E2eStatus::ok_some_lost;
}

/// What a receiver remembers of one message.
struct E2eReceiverState {
    E2eStatus status = E2eStatus::no_new_data;
    bool synchronised = false;  ///< a first intact frame came; it is accepted whatever its counter
    std::uint8_t counter = 0;   ///< of the last intact frame
    std::uint8_t lost = 0;      ///< frames missing before the last one, modulo 15; 0 unless it was ahead
};

/// CRC-8, polynomial 0x1D, not reflected, no XOR; `crc` continues an earlier call. One table look-up a byte.
std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t crc = 0);

/// The CRC of a protected frame's bytes: data id, then everything after byte 0.
std::uint8_t e2e_crc(std::span<const std::uint8_t> bytes, std::uint16_t data_id);

/// Writes counter and CRC into a frame of 2..8 bytes and advances the counter (0..14, cyclic). Other lengths,
/// which no message of ours has, leave frame and counter untouched.
void e2e_protect(Frame& frame, std::uint16_t data_id, std::uint8_t& counter);

/// Judges what arrived since the last call; empty bytes: nothing did. Every intact frame moves the state to
/// its counter, so that after wrong_sequence the next frame in order is ok again.
E2eStatus e2e_check(E2eReceiverState& state, std::span<const std::uint8_t> bytes, std::uint16_t data_id,
                    const E2eConfig& config = {});

}  // namespace can
