/// CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320). At the length of a beat packet, 65.6 kbit, any
/// three flipped bits are detected for certain.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace hal {

inline constexpr std::uint32_t kCrc32Start = 0xFFFF'FFFF;

/// The register after one more byte. Start with kCrc32Start; the checksum is the complement of the last
/// value.
std::uint32_t crc32_step(std::uint32_t crc, std::uint8_t byte);

/// Checksum of a whole block. crc32("123456789") = 0xCBF43926.
std::uint32_t crc32(std::span<const std::uint8_t> bytes);

}  // namespace hal
