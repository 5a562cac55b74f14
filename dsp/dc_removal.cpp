#include "dsp/dc_removal.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"

namespace dsp {

namespace {
constexpr int kMeanBits = 6;  // kSamples = 64: 64 x - sum is the deviation with 6 fraction bits
static_assert(kSamples == 1 << kMeanBits);
constexpr int kLowestExponent = -15;
}  // namespace

DcLevels dc_levels(const BeatFrame& frame) {
    DcLevels levels;
    for (std::size_t pair = 0; pair < kChirps / 2; ++pair) {
        std::int32_t largest = 0;  // Q6
        for (std::size_t k = 2 * pair; k < 2 * pair + 2; ++k) {
            std::int32_t sum = 0;
            std::int32_t low = frame.chirp[k][0];
            std::int32_t high = low;
            for (const std::int32_t sample : frame.chirp[k]) {
                sum += sample;
                low = std::min(low, sample);
                high = std::max(high, sample);
            }
            levels.sum[k] = sum;
            largest = std::max({largest, kSamples * high - sum, sum - kSamples * low});
        }
        const auto bits = static_cast<int>(std::bit_width(static_cast<std::uint32_t>(largest)));
        int down = std::max(bits - 15, kLowestExponent + kMeanBits);
        if (down > 0 && round_shift(largest, down) > 32767) ++down;
        levels.exponent[pair] = static_cast<std::int16_t>(down - kMeanBits);
    }
    return levels;
}

void remove_dc(std::span<const std::int16_t, kSamples> chirp, std::int32_t sum, int exponent,
               std::span<std::int16_t, kSamples> out) {
    const int shift = exponent + kMeanBits;
    for (std::size_t n = 0; n < kSamples; ++n) {
        const std::int32_t deviation = kSamples * chirp[n] - sum;
        out[n] = static_cast<std::int16_t>(shift >= 0 ? round_shift(deviation, shift)
                                                      : deviation * (std::int32_t{1} << -shift));
    }
}

}  // namespace dsp
