/// What our messages cost on the wire.
#pragma once

#include <string_view>
#include <vector>

#include "can/frame.hpp"

namespace sim {

inline constexpr int kBitrate = 500'000;  ///< bit/s

/// A standard data frame as it is on the wire, dominant bits false: start of frame, arbitration, control,
/// data and CRC with their stuff bits, then delimiters, acknowledgement, end of frame and the three bits of
/// intermission (ISO 11898-1).
std::vector<bool> wire_bits(const can::Frame& frame);

/// Length of the above for the worst data: 47 + 8n bits and a stuff bit after each four of the first 34 + 8n
/// but one.
constexpr int worst_wire_bits(int data_bytes) {
    return 47 + 8 * data_bytes + (33 + 8 * data_bytes) / 4;
}

struct MessageLoad {
    std::string_view name;
    int data_bytes = 0;
    double frames_per_s = 0;
    double bits_per_s = 0;  ///< with worst stuffing
};

/// All messages of the bus in both directions with that many objects in each list, worst stuffing. A message
/// that is sent on event only counts as one a cycle.
std::vector<MessageLoad> message_loads(int objects);

}  // namespace sim
