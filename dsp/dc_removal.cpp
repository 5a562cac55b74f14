#include "dsp/dc_removal.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/packed.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

constexpr int kCommonScale = 2;  ///< bits that a pair gives up for a scale common to the frame

using packed::Pair;

}  // namespace

void share_exponent(std::span<std::int16_t, kChirps / 2> exponent) {
    const std::int16_t highest = *std::ranges::max_element(exponent);
    for (std::int16_t& e : exponent) {
        if (highest - e <= kCommonScale) e = highest;
    }
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
