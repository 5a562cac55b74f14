/// A classic CAN 2.0A data frame.
#pragma once

#include <array>
#include <cstdint>

namespace can {

struct Frame {
    std::uint16_t id = 0;     ///< 11 bit standard identifier
    std::uint8_t length = 0;  ///< 0..8
    std::array<std::uint8_t, 8> data{};

    bool operator==(const Frame&) const = default;
};

}  // namespace can
