/// What the transforms of 64 points, two passes of 8, have in common.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "dsp/fft64.hpp"
#include "dsp/packed.hpp"
#include "dsp/packed_x86.hpp"
#include "dsp/sine.hpp"

namespace dsp::radix8 {

using packed::Pair;

constexpr std::int32_t kHalf = 1 << 15;  ///< rounds what pack_high cuts off

/// exp(-j 2 pi numerator / 64), Q15, within +-32767: a factor just below one also breaks the ties of halving,
/// to both sides equally often.
constexpr Pair root(int numerator) {
    const auto narrow = [](std::int32_t q30) { return (q30 + (1 << 14)) >> 15; };
    const std::int32_t re = narrow(cosine_q30(numerator, kFftLength));
    const std::int32_t im = narrow(-sine_q30(numerator, kFftLength));
    return packed::pack(std::clamp<std::int32_t>(re, -32767, 32767),
                        std::clamp<std::int32_t>(im, -32767, 32767));
}
constexpr Pair kEighth = root(8);

inline Pair load(const Complex16& x) {
    return std::bit_cast<Pair>(x);
}
inline void store(Complex16& to, Pair x) {
    to = std::bit_cast<Complex16>(x);
}

#if DSP_PACKED_FOUR
using packed::Quad;
inline Quad load(Quad x) {
    return x;
}
inline void store(Quad& to, Quad x) {
    to = x;
}
#endif

// Word: a Pair, or on a PC a Quad, for four transforms at once.

/// a w / 2, rounded.
template <class Word>
Word rotate(Word a, Pair w, std::int32_t rounding = kHalf) {
    return packed::pack_high(packed::dot_minus(a, w, rounding), packed::dot_cross(a, w, rounding));
}

}  // namespace dsp::radix8
