/// What the removal of a frame's DC levels needs: the converter's offset and the transmitter's leakage, and
/// the scale of what remains.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "dsp/fft64.hpp"

namespace dsp {

inline constexpr int kMeanBits = 6;  ///< kSamples = 64: 64 x - sum is the deviation with 6 fraction bits
static_assert(kSamples == 1 << kMeanBits);

/// What removal needs to know of a frame before it can start; inspect() finds it out.
///
/// The mean is taken along each chirp, over range. A target whose Doppler shift is zero (a car at the same
/// speed) keeps its beat frequency and is not touched: only range cell 0 is.
struct DcLevels {
    std::array<std::int32_t, kChirps> sum{};  ///< of the samples of each chirp: 64 times its mean, exact
    /// Of the deviations of chirps 2i and 2i+1: deviation = code * 2^exponent, all
    /// codes within +-2^12.
    std::array<std::int16_t, kChirps / 2> exponent{};
};

/// Extremes and sum of the samples of a chirp.
struct ChirpLevel {
    std::int32_t low;
    std::int32_t high;
    std::int32_t sum;
};

/// The exponent that lets the largest deviation of two chirps from their means use 12 bits: a 12-bit
/// converter's small codes are lifted before anything is rounded, and a burst of interference costs precision
/// only in the chirps it hits. -11..4, -11 without signal.
constexpr int deviation_exponent(const ChirpLevel& even, const ChirpLevel& odd) {
    constexpr int kLowest = -11;
    const auto deviations = [](const ChirpLevel& chirp) {  // 64 times both, which are not below zero
        return static_cast<std::uint32_t>((kSamples * chirp.high - chirp.sum) |
                                          (chirp.sum - kSamples * chirp.low));
    };
    const auto bits = static_cast<int>(std::bit_width(deviations(even) | deviations(odd)));
    return std::max(bits - kMeanBits - kFftInputBits, kLowest);
}

/// Exponents within 2 of the largest become the largest, and so on among the rest: a frame without a burst
/// then has the same scale everywhere, one with a burst few, each of which costs a window table.
void share_exponent(std::span<std::int16_t, kChirps / 2> exponent);

}  // namespace dsp
