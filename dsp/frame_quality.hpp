/// What the health monitor wants to know of a frame and of a map.
#pragma once

#include <cstdint>

#include "dsp/beat_frame.hpp"
#include "dsp/dc_levels.hpp"
#include "dsp/range_doppler.hpp"

namespace dsp {

struct FrameQuality {
    std::int16_t min = 0;
    std::int16_t max = 0;
    std::uint16_t saturated = 0;  ///< samples at or beyond the converter's full scale, either sign, 0..4096
    std::uint8_t repeated_chirps = 0;  ///< chirps equal to the one before them, sample by sample, 0..63
    /// Of the sums and extremes of all chirps: two frames in a row with the same one are a stuck converter. A
    /// sample that changes changes its chirp's sum; noise leaves none of 64 sums alone.
    std::uint32_t hash = 0;

    /// Every sample equal: no noise, no converter.
    [[nodiscard]] constexpr bool dead() const { return min == max; }
    /// Thermal noise never repeats a chirp; one in a frame may be a transfer fault, all are a stuck buffer.
    [[nodiscard]] constexpr bool stuck() const { return !dead() && repeated_chirps == kChirps - 1; }
};

/// Quality and DC levels with one pass over the samples. `adc_full_scale`: the largest code, 2047 for 12
/// bits; the smallest is taken as its negative. > 0. Cost: about 3.4 instructions a sample; more for chirps
/// with samples at full scale or with the sum of the chirp before them.
FrameQuality inspect(const BeatFrame& frame, std::int16_t adc_full_scale, DcLevels& levels);

/// Median log-power of the cells from `first_range_cell` on, log2 Q6.10: targets and ridges of clutter do not
/// move it until they fill a good part of the map. For exponential noise the mean is log2(1/ln 2) = 0.529
/// higher. Of every second cell in every second row: neighbours of a windowed spectrum say nearly the same,
/// cells two apart (1/36 of their power in common) nearly all there is. By histogram, linear inside a bin of
/// 1/8: error below 0.04.
std::uint16_t noise_level(const PowerMap& map, int first_range_cell);

}  // namespace dsp
