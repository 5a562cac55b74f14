/// Removal of the converter's offset and of the transmitter's leakage, and the frame's common scale.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"

namespace dsp {

/// What removal needs to know of a frame before it can start.
struct DcLevels {
    std::array<std::int32_t, kChirps> sum{};  ///< of the samples of each chirp: 64 times its mean, exact
    /// Of the samples remove_dc writes for chirps 2i and 2i+1 (which share a transform): code = sample *
    /// 2^exponent.
    std::array<std::int16_t, kChirps / 2> exponent{};
};

/// Means of all chirps, and for each pair the exponent that lets its largest deviation from them use all of
/// int16: a 12-bit converter's small codes are lifted before anything is rounded, and a burst of
/// interference costs precision only in the chirps it hits. Exponents -15..1, -15 without signal.
///
/// The mean is taken along each chirp, over range. A target whose Doppler shift is zero (a car at the same
/// speed) keeps its beat frequency and is not touched: only range cell 0 is.
DcLevels dc_levels(const BeatFrame& frame);

/// out[n] = (chirp[n] - mean) / 2^exponent, rounded half to even; the mean itself is not rounded. Cannot
/// overflow for a chirp of the pair that gave `exponent`.
void remove_dc(std::span<const std::int16_t, kSamples> chirp, std::int32_t sum, int exponent,
               std::span<std::int16_t, kSamples> out);

}  // namespace dsp
