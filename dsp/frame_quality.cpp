#include "dsp/frame_quality.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

#include "dsp/packed.hpp"
#include "dsp/packed_x86.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

using packed::Pair;

/// What one pass over a chirp tells. Extremes by lane: of the even and of the odd samples.
struct ChirpPass {
    Pair low;
    Pair high;
    std::int32_t sum;
};

#if DSP_PACKED_FOUR
inline ChirpPass pass_over(const std::array<std::int16_t, kSamples>& chirp) {
    const packed::Quad ones(packed::pack(1, 1));
    packed::Quad low = packed::load_quad(chirp.data());
    packed::Quad high = low;
    packed::Sum4 sum = packed::dot(low, ones, 0);
    for (std::size_t n = 8; n < kSamples; n += 8) {
        const packed::Quad samples = packed::load_quad(&chirp[n]);
        low = packed::smallest(low, samples);
        high = packed::largest(high, samples);
        sum = packed::dot(samples, ones, sum);
    }
    const auto add_words = [](packed::Quad a, packed::Quad b) {
        return packed::Quad(_mm_add_epi32(a.v, b.v));
    };
    return {packed::across_words(low, [](auto a, auto b) { return packed::smallest(a, b); }),
            packed::across_words(high, [](auto a, auto b) { return packed::largest(a, b); }),
            static_cast<std::int32_t>(packed::across_words(packed::Quad(sum.v), add_words))};
}
#else
/// Adds four samples to it.
inline void take(const std::int16_t* samples, ChirpPass& pass) {
    constexpr Pair kOnes = packed::pack(1, 1);
    Pair a = 0;
    Pair b = 0;
    packed::load_pair(samples, a, b);
    pass.sum = packed::dot(b, kOnes, packed::dot(a, kOnes, pass.sum));
    packed::sort(a, b);
    pass.low = packed::smallest(pass.low, a);
    pass.high = packed::largest(pass.high, b);
}

inline ChirpPass pass_over(const std::array<std::int16_t, kSamples>& chirp) {
    const Pair first = packed::load(chirp.data());
    ChirpPass pass{first, first, 0};
    for (const std::int16_t* n = chirp.data(); n != chirp.data() + kSamples; n += 16) {
        take(n, pass);
        take(n + 4, pass);
        take(n + 8, pass);
        take(n + 12, pass);
    }
    return pass;
}
#endif

/// A polynomial in an odd number, modulo 2^32: two frames that differ have the same value with a chance of
/// 2^-32, never if they differ in one coefficient alone.
std::uint32_t hashed(std::uint32_t hash, const ChirpPass& pass) {
    constexpr std::uint32_t kBase = 0x9E3779B1U;  // 2^32 over the golden ratio
    return ((hash * kBase + static_cast<std::uint32_t>(pass.sum)) * kBase + pass.low) * kBase + pass.high;
}

std::uint16_t count_beyond(const std::array<std::int16_t, kSamples>& chirp, std::int16_t full_scale) {
    return static_cast<std::uint16_t>(std::ranges::count_if(
        chirp, [full_scale](std::int16_t sample) { return sample >= full_scale || sample <= -full_scale; }));
}

/// Of lane 0 and lane 1 of each, into one lane: (a, b).
template <Pair (*kCombine)(Pair, Pair)>
Pair across(Pair a, Pair b) {
    return kCombine(packed::pack_low(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b)),
                    packed::pack_high(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b)));
}

}  // namespace

FrameQuality inspect(const BeatFrame& frame, std::int16_t adc_full_scale, DcLevels& levels) {
    FrameQuality quality;
    std::uint32_t hash = 0;
    Pair lowest = packed::both(0x7FFF);
    Pair highest = packed::both(0x8000);
    const Pair top = packed::both(static_cast<std::uint16_t>(adc_full_scale));
    const Pair bottom = packed::sub(0, top);
    for (std::size_t k = 0; k < kChirps; k += 2) {
        const auto& even = frame.chirp[k];
        const auto& odd = frame.chirp[k + 1];
        const ChirpPass first = pass_over(even);
        const ChirpPass second = pass_over(odd);
        hash = hashed(hashed(hash, first), second);
        const Pair low = across<packed::smallest>(first.low, second.low);
        const Pair high = across<packed::largest>(first.high, second.high);
        lowest = packed::smallest(lowest, low);
        highest = packed::largest(highest, high);
        // A sign bit in both lanes of both: no sample at full scale.
        const Pair inside = packed::saturated_sub(high, top) & packed::saturated_sub(bottom, low);
        if ((inside & packed::both(0x8000)) != packed::both(0x8000)) {
            quality.saturated = static_cast<std::uint16_t>(
                quality.saturated + count_beyond(even, adc_full_scale) + count_beyond(odd, adc_full_scale));
        }
        if (k > 0 && first.sum == levels.sum[k - 1] && even == frame.chirp[k - 1]) ++quality.repeated_chirps;
        if (second.sum == first.sum && odd == even) ++quality.repeated_chirps;
        levels.sum[k] = first.sum;
        levels.sum[k + 1] = second.sum;
        levels.exponent[k / 2] = static_cast<std::int16_t>(
            deviation_exponent({packed::lane0(low), packed::lane0(high), first.sum},
                               {packed::lane1(low), packed::lane1(high), second.sum}));
    }
    share_exponent(levels.exponent);
    quality.min = static_cast<std::int16_t>(std::min(packed::lane0(lowest), packed::lane1(lowest)));
    quality.max = static_cast<std::int16_t>(std::max(packed::lane0(highest), packed::lane1(highest)));
    quality.hash = hash;
    return quality;
}

std::uint16_t noise_level(const PowerMap& map, int first_range_cell) {
    constexpr int kBinBits = 7;
    constexpr std::size_t kStep = 2;
    constexpr int kCellsOfRow = kDopplerCells / static_cast<int>(kStep);
    alignas(4) std::array<std::uint16_t, 1 << (16 - kBinBits)> histogram{};
    int half = 0;
    for (auto r = static_cast<std::size_t>(first_range_cell); r < kRangeCells; r += kStep) {
        const auto& row = map.cell[r];
        unrolled<kDopplerCells, kStep, 8>([&](std::size_t d) { ++histogram[row[d] >> kBinBits]; });
        half += kCellsOfRow / 2;
    }
    if (half == 0) return 0;
    int below = 0;
    std::size_t bin = 0;
    for (;; bin += 2) {
        const int with_two_more = packed::dot(packed::load(&histogram[bin]), packed::pack(1, 1), below);
        if (with_two_more >= half) break;
        below = with_two_more;
    }
    if (below + histogram[bin] < half) below += histogram[bin++];
    const int inside = ((half - below) << kBinBits) / histogram[bin];
    return static_cast<std::uint16_t>(std::min<int>((static_cast<int>(bin) << kBinBits) + inside, 65535));
}

}  // namespace dsp
