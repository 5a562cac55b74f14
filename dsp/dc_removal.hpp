/// Removal of the converter's offset and of the transmitter's leakage, and the scale of what remains.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "dsp/fft64.hpp"
#include "dsp/window.hpp"

namespace dsp {

/// What removal needs to know of a frame before it can start.
struct DcLevels {
    std::array<std::int32_t, kChirps> sum{};  ///< of the samples of each chirp: 64 times its mean, exact
    /// Of the deviations of chirps 2i and 2i+1 (which share a transform): deviation = code * 2^exponent, all
    /// codes within +-2^12.
    std::array<std::int16_t, kChirps / 2> exponent{};
};

/// Means of all chirps, and for each pair the exponent that lets its largest deviation from them use 12 bits:
/// a 12-bit converter's small codes are lifted before anything is rounded, and a burst of interference costs
/// precision only in the chirps it hits. Exponents -11..4, -11 without signal. Pairs within 2 of the largest
/// exponent take that one too: a frame without a burst then has the same scale everywhere.
///
/// The mean is taken along each chirp, over range. A target whose Doppler shift is zero (a car at the same
/// speed) keeps its beat frequency and is not touched: only range cell 0 is.
/// Cost: about 3 instructions a sample.
DcLevels dc_levels(const BeatFrame& frame);

/// out[n] = window[n] (even[n] - its mean + j (odd[n] - its mean)) / 2^exponent for two chirps with the given
/// sums. The mean is not rounded by more than 1/256 of the step, the result is rounded down: half a step too
/// low on average. Cannot overflow for an exponent not below that of the pair, -11..5. Cost: about 7
/// instructions a sample of out for exponents below 2, more above.
void remove_dc(std::span<const std::int16_t, kSamples> even, std::int32_t even_sum,
               std::span<const std::int16_t, kSamples> odd, std::int32_t odd_sum, int exponent,
               const Window& window, std::span<Complex16, kFftLength> out);

}  // namespace dsp
