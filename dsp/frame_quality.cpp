#include "dsp/frame_quality.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

namespace dsp {

FrameQuality inspect(const BeatFrame& frame, std::int16_t adc_full_scale) {
    FrameQuality quality;
    quality.min = quality.max = frame.chirp[0][0];
    std::uint32_t hash = 0;
    for (std::size_t k = 0; k < kChirps; ++k) {
        const auto& chirp = frame.chirp[k];
        for (const std::int16_t sample : chirp) {
            quality.min = std::min(quality.min, sample);
            quality.max = std::max(quality.max, sample);
            if (sample >= adc_full_scale || sample <= -adc_full_scale) ++quality.saturated;
            // Rotate, mix, multiply by 2^32 over the golden ratio: every bit reaches every other.
            hash = (std::rotl(hash, 5) ^ static_cast<std::uint16_t>(sample)) * 0x9E3779B1U;
        }
        if (k > 0 && chirp == frame.chirp[k - 1]) ++quality.repeated_chirps;
    }
    quality.hash = hash;
    return quality;
}

std::uint16_t noise_level(const PowerMap& map, int first_range_cell) {
    constexpr int kBinBits = 8;
    std::array<std::uint16_t, 1 << (16 - kBinBits)> histogram{};
    for (std::size_t r = static_cast<std::size_t>(first_range_cell); r < kRangeCells; ++r) {
        for (std::size_t d = r % 2; d < kDopplerCells; d += 2) ++histogram[map.cell[r][d] >> kBinBits];
    }
    const int half = (kRangeCells - first_range_cell) * kDopplerCells / 4;
    int below = 0;
    std::size_t bin = 0;
    while (below + histogram[bin] < half) below += histogram[bin++];
    if (histogram[bin] == 0) return 0;
    const int inside = ((half - below) << kBinBits) / histogram[bin];
    return static_cast<std::uint16_t>(std::min<int>((static_cast<int>(bin) << kBinBits) + inside, 65535));
}

}  // namespace dsp
