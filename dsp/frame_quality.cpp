#include "dsp/frame_quality.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

#include "dsp/packed.hpp"

namespace dsp {

FrameQuality inspect(const BeatFrame& frame, std::int16_t adc_full_scale) {
    FrameQuality quality;
    packed::Pair all_low = packed::load(frame.chirp[0].data());
    packed::Pair all_high = all_low;
    std::uint32_t hash = 0;
    for (std::size_t k = 0; k < kChirps; ++k) {
        const auto& chirp = frame.chirp[k];
        packed::Pair low = packed::load(chirp.data());
        packed::Pair high = low;
        for (std::size_t n = 0; n < kSamples; n += 8) {
            for (std::size_t i = n; i < n + 8; i += 2) {
                const packed::Pair samples = packed::load(&chirp[i]);
                low = packed::smallest(low, samples);
                high = packed::largest(high, samples);
                // Rotate, mix, multiply by 2^32 over the golden ratio: every bit reaches every other.
                hash = (std::rotl(hash, 5) ^ samples) * 0x9E3779B1U;
            }
        }
        all_low = packed::smallest(all_low, low);
        all_high = packed::largest(all_high, high);
        if (std::max(packed::lane0(high), packed::lane1(high)) >= adc_full_scale ||
            std::min(packed::lane0(low), packed::lane1(low)) <= -adc_full_scale) {
            quality.saturated = static_cast<std::uint16_t>(
                quality.saturated + std::ranges::count_if(chirp, [adc_full_scale](std::int16_t sample) {
                    return sample >= adc_full_scale || sample <= -adc_full_scale;
                }));
        }
        if (k > 0 && chirp == frame.chirp[k - 1]) ++quality.repeated_chirps;
    }
    quality.min = static_cast<std::int16_t>(std::min(packed::lane0(all_low), packed::lane1(all_low)));
    quality.max = static_cast<std::int16_t>(std::max(packed::lane0(all_high), packed::lane1(all_high)));
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
