#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "hal/common/crc32.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Crc32){};

/// The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
TEST(Crc32, check_value) {
    constexpr std::string_view kText = "123456789";
    std::array<std::uint8_t, 9> bytes{};
    std::memcpy(bytes.data(), kText.data(), kText.size());
    CHECK_EQUAL(0xCBF43926U, hal::crc32(bytes));
}

TEST(Crc32, nothing) {
    CHECK_EQUAL(0U, hal::crc32({}));
}
