#include "hal/common/crc32.hpp"

#include <array>

namespace hal {
namespace {

constexpr std::array<std::uint32_t, 256> make_table() {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t i = 0; i < 256; ++i) {
        std::uint32_t c = i;
        for (int bit = 0; bit < 8; ++bit) c = (c >> 1) ^ ((c & 1) != 0 ? 0xEDB8'8320U : 0U);
        table[i] = c;
    }
    return table;
}

constexpr std::array<std::uint32_t, 256> kTable = make_table();

}  // namespace

std::uint32_t crc32_step(std::uint32_t crc, std::uint8_t byte) {
    return (crc >> 8) ^ kTable[(crc ^ byte) & 0xFF];
}

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = kCrc32Start;
    for (const std::uint8_t b : bytes) crc = crc32_step(crc, b);
    return ~crc;
}

}  // namespace hal
