/// Base-2 logarithms and powers in integers: the map, its threshold and its interpolation work on logarithms.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "dsp/fixed_point.hpp"
#include "dsp/packed.hpp"

namespace dsp {

/// Fraction bits of every base-2 logarithm in this room: Q6.10, one step is 0.00294 dB of power.
inline constexpr int kLogBits = 10;
inline constexpr int kLogOne = 1 << kLogBits;  ///< a factor of two in power, 3.01 dB

namespace detail {

/// log2(x / 2^30) in Q30 for x in [2^30, 2^31): one bit of the result per squaring. For tables and start-up.
constexpr std::uint32_t log2_fraction_q30(std::uint32_t x) {
    std::uint64_t y = x;
    std::uint32_t result = 0;
    for (int bit = 29; bit >= 0; --bit) {
        y = (y * y) >> 30;
        if (y >= (std::uint64_t{1} << 31)) {
            y >>= 1;
            result |= std::uint32_t{1} << bit;
        }
    }
    return result;
}

/// 2^(i/2^bits) in Q30, 0 <= i <= 2^bits, by bisection of the logarithm above.
constexpr std::uint32_t exp2_fraction_q30(std::uint32_t i, int bits) {
    const std::uint32_t target = i << (30 - bits);
    if (target == 0) return std::uint32_t{1} << 30;
    if (target == std::uint32_t{1} << 30) return std::uint32_t{1} << 31;
    std::uint32_t low = std::uint32_t{1} << 30;
    std::uint32_t high = std::uint32_t{1} << 31;
    while (high - low > 1) {
        const std::uint32_t middle = low + (high - low) / 2;
        (log2_fraction_q30(middle) <= target ? low : high) = middle;
    }
    return low;
}

inline constexpr int kTableBits = 5;
inline constexpr std::size_t kTableSize = (std::size_t{1} << kTableBits) + 1;

/// log2(1 + i/32) in Q16, the last entry one.
inline constexpr auto kLog2Table = [] {
    std::array<std::uint32_t, kTableSize> table{};
    for (std::uint32_t i = 0; i + 1 < kTableSize; ++i) {
        const std::uint32_t x = (std::uint32_t{1} << 30) + (i << (30 - kTableBits));
        table[i] = (log2_fraction_q30(x) + (1U << 13)) >> 14;
    }
    table[kTableSize - 1] = 1U << 16;
    return table;
}();

/// 2^15 + log2(2^31 + (i + 1/2) 2^23) in Q10, just within 16 bits.
inline constexpr auto kLog2CoarseTable = [] {
    std::array<std::uint16_t, 256> table{};
    for (std::uint32_t i = 0; i < table.size(); ++i) {
        const std::uint32_t x = (std::uint32_t{1} << 30) + (2 * i + 1) * (std::uint32_t{1} << 21);
        table[i] = static_cast<std::uint16_t>((63U << 10) + ((log2_fraction_q30(x) + (1U << 19)) >> 20));
    }
    return table;
}();

/// 2^(i/32) in Q15.
inline constexpr auto kExp2Table = [] {
    std::array<std::uint32_t, kTableSize> table{};
    for (std::uint32_t i = 0; i < kTableSize; ++i) {
        table[i] = (exp2_fraction_q30(i, kTableBits) + (1U << 14)) >> 15;
    }
    return table;
}();

}  // namespace detail

/// log2(v) in Q6.10, rounded; 0 for v = 0 (as for 1). Error at most 0.7 step (table of 32, linear between).
/// Cost: a count of leading zeros, two loads, one product.
constexpr std::int32_t log2_q10(std::uint32_t v) {
    if (v == 0) return 0;
    const int octave = 31 - std::countl_zero(v);
    const std::uint32_t mantissa = v << (31 - octave);  // Q31 in [1, 2)
    const std::uint32_t index = (mantissa >> (31 - detail::kTableBits)) & ((1U << detail::kTableBits) - 1);
    const std::uint32_t rest = (mantissa >> (31 - detail::kTableBits - 11)) & 0x7FFU;  // Q11 between entries
    const std::uint32_t base = detail::kLog2Table[index];
    const std::uint32_t step = detail::kLog2Table[index + 1] - base;
    const std::uint32_t fraction = base + ((step * rest) >> 11);  // Q16
    return octave * kLogOne + static_cast<std::int32_t>((fraction + (1U << 5)) >> 6);
}

/// Of log2_coarse_q10: adds `offset`, Q6.10, at most 32 octaves.
constexpr packed::Pair log2_bias(std::int32_t offset) {
    return packed::both(static_cast<std::uint16_t>(std::clamp<std::int32_t>((1 << 15) - offset, 0, 65535)));
}

/// Two at once, v0 in lane 0, for the cells of a map: log2 v + offset in Q6.10, not below zero. From a table
/// alone: error at most 3.5 steps, 0.01 dB; zero counts as one half. Cost: 7 instructions a value.
inline packed::Pair log2_coarse_q10(std::uint32_t v0, std::uint32_t v1, packed::Pair bias) {
    const auto entry = [](std::uint32_t v, int zeros) {
        return detail::kLog2CoarseTable[packed::left_aligned(v, zeros) >> 23 & 0xFFU];
    };
    const int zeros0 = std::countl_zero(v0);
    const int zeros1 = std::countl_zero(v1);
    const packed::Pair above = packed::pack_low(entry(v0, zeros0), entry(v1, zeros1)) -
                               (packed::pack_low(zeros0, zeros1) << kLogBits);
    return packed::floored_sub(above, bias);
}

/// 2^(x/1024) in Q30 for x <= 0; relative error below 1e-4 or one unit of the last place. Zero below 2^-31.
constexpr std::uint32_t exp2_q30(std::int32_t x) {
    const std::int32_t octave = x >> kLogBits;  // floor
    if (octave < -31) return 0;
    const auto fraction = static_cast<std::uint32_t>(x) & (kLogOne - 1);
    constexpr int kRestBits = kLogBits - detail::kTableBits;
    const std::uint32_t index = fraction >> kRestBits;
    const std::uint32_t rest = fraction & ((1U << kRestBits) - 1);
    const std::uint32_t base = detail::kExp2Table[index];
    const std::uint32_t step = detail::kExp2Table[index + 1] - base;
    return ((base << kRestBits) + step * rest) << (30 - 15 - kRestBits) >> -octave;
}

/// Hundredths of a decibel to log2 of power, Q6.10, rounded: one decibel is 102.4 log2(10) = 340.17 steps.
constexpr std::int32_t log2_from_cdb(std::int32_t hundredths) {
    constexpr std::int64_t kStepsPerCdbQ16 = 222'931;
    return static_cast<std::int32_t>(round_shift(hundredths * kStepsPerCdbQ16, 16));
}

}  // namespace dsp
