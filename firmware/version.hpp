/// What the version message and the boot banner say.
#pragma once

#include <cstdint>

namespace firmware {

inline constexpr std::uint8_t kVersionMajor = 0;
inline constexpr std::uint8_t kVersionMinor = 1;
inline constexpr std::uint8_t kVersionPatch = 0;
inline constexpr std::uint16_t kWaveformId = 1;  ///< 1: Lee and Kim 2000, table 4

}  // namespace firmware
