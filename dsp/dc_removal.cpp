#include "dsp/dc_removal.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/packed.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

constexpr int kMeanBits = 6;  // kSamples = 64: 64 x - sum is the deviation with 6 fraction bits
static_assert(kSamples == 1 << kMeanBits);
constexpr int kLowestExponent = -11;
constexpr int kCommonScale = 2;  ///< bits that a pair gives up for a scale common to the frame

using packed::Pair;

}  // namespace

DcLevels dc_levels(const BeatFrame& frame) {
    DcLevels levels;
    for (std::size_t pair = 0; pair < kChirps / 2; ++pair) {
        std::int32_t largest = 0;  // Q6
        for (std::size_t k = 2 * pair; k < 2 * pair + 2; ++k) {
            const std::int16_t* const chirp = frame.chirp[k].data();
            std::int32_t sum = 0;
            Pair low = packed::load(chirp);
            Pair high = low;
            unrolled<kSamples, 2, 4>([&](std::size_t n) {
                const Pair samples = packed::load(chirp + n);
                sum = packed::dot(samples, packed::pack(1, 1), sum);
                low = packed::smallest(low, samples);
                high = packed::largest(high, samples);
            });
            levels.sum[k] = sum;
            const std::int32_t top = std::max(packed::lane0(high), packed::lane1(high));
            const std::int32_t bottom = std::min(packed::lane0(low), packed::lane1(low));
            largest = std::max({largest, kSamples * top - sum, sum - kSamples * bottom});
        }
        const auto bits = static_cast<int>(std::bit_width(static_cast<std::uint32_t>(largest)));
        levels.exponent[pair] =
            static_cast<std::int16_t>(std::max(bits - kMeanBits - kFftInputBits, kLowestExponent));
    }
    const std::int16_t highest = *std::ranges::max_element(levels.exponent);
    for (std::int16_t& exponent : levels.exponent) {
        if (highest - exponent <= kCommonScale) exponent = highest;
    }
    return levels;
}

void remove_dc(std::span<const std::int16_t, kSamples> even, std::int32_t even_sum,
               std::span<const std::int16_t, kSamples> odd, std::int32_t odd_sum, int exponent,
               const Window& window, std::span<Complex16, kFftLength> out) {
    if (exponent > 1) {
        const auto deviation = [&](std::int16_t sample, std::int32_t sum, std::size_t n) {
            const std::int64_t product = std::int64_t{kSamples * sample - sum} * window[n];
            return static_cast<std::int16_t>(product >> (15 + kMeanBits + exponent));
        };
        for (std::size_t n = 0; n < kSamples; ++n) {
            out[n] = {deviation(even[n], even_sum, n), deviation(odd[n], odd_sum, n)};
        }
        return;
    }
    // Twice the code, so that 16 bits less of its product with the window are the result.
    const Pair gain = std::uint32_t{1} << (1 - exponent);
    const auto offset = [exponent](std::int32_t sum) {
        const int up = 1 - exponent - kMeanBits;
        return up >= 0 ? sum * (std::int32_t{1} << up) : round_shift(sum, -up);
    };
    const std::int32_t even_offset = -offset(even_sum);
    const std::int32_t odd_offset = -offset(odd_sum);
    unrolled<kSamples, 2, 2>([&](std::size_t n) {
        const Pair a = packed::load(&even[n]);
        const Pair b = packed::load(&odd[n]);
        const Pair w = packed::load(&window[n]);
        const Pair first = packed::pack_low(packed::scale_0(packed::multiply_00(a, gain, even_offset), w),
                                            packed::scale_0(packed::multiply_00(b, gain, odd_offset), w));
        const Pair second = packed::pack_low(packed::scale_1(packed::multiply_10(a, gain, even_offset), w),
                                             packed::scale_1(packed::multiply_10(b, gain, odd_offset), w));
        out[n] = std::bit_cast<Complex16>(first);
        out[n + 1] = std::bit_cast<Complex16>(second);
    });
}

}  // namespace dsp
