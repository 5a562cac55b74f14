/// The 8-point transforms that those of 64 points are made of, in packed 16-bit arithmetic.
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

/// a w, rounded.
template <class Word>
Word rotate_whole(Word a, Pair w) {
    constexpr std::int32_t kQuarter = kHalf / 2;
    return packed::pack_doubled(packed::dot_minus(a, w, kQuarter), packed::dot_cross(a, w, kQuarter));
}

/// Which levels of three halve. Sums that do not are clipped where they can exceed 16 bits.
enum class Halving : std::uint8_t { second, second_and_third };

/// 8-point transform, radix-2 decimation in time written out: X[k], X[k + 4] for k = 0..3 to emit(k, X[k],
/// X[k + 4]). In the order that needs few registers.
template <Halving kHalving, class Load, class Emit>
inline void transform(Load x, Emit emit) {
    using namespace packed;
    using Word = decltype(x(0));
    constexpr bool kThird = kHalving == Halving::second_and_third;
    const Word x0 = x(0);
    const Word x4 = x(4);
    const Word a0 = saturated_add(x0, x4);
    const Word a1 = saturated_sub(x0, x4);
    const Word x2 = x(2);
    const Word x6 = x(6);
    const Word a2 = saturated_add(x2, x6);
    const Word a3 = saturated_sub(x2, x6);
    const Word even0 = half_add(a0, a2);
    const Word even2 = half_sub(a0, a2);
    const Word even1 = half_sub_j(a1, a3);
    const Word even3 = half_add_j(a1, a3);
    const Word x1 = x(1);
    const Word x5 = x(5);
    const Word b0 = saturated_add(x1, x5);
    const Word b1 = saturated_sub(x1, x5);
    const Word x3 = x(3);
    const Word x7 = x(7);
    const Word b2 = saturated_add(x3, x7);
    const Word b3 = saturated_sub(x3, x7);
    const Word odd0 = half_add(b0, b2);
    const Word odd2 = half_sub(b0, b2);
    const auto last = [&emit](std::size_t k, Word a, Word b) {
        emit(k, kThird ? half_add(a, b) : saturated_add(a, b), kThird ? half_sub(a, b) : saturated_sub(a, b));
    };
    const auto last_j = [&emit](std::size_t k, Word a, Word b) {
        emit(k, kThird ? half_sub_j(a, b) : saturated_sub_j(a, b),
             kThird ? half_add_j(a, b) : saturated_add_j(a, b));
    };
    const auto eighth = [](Word sum, Word halved_sum) {
        if constexpr (!kThird) return rotate(sum, kEighth);
        return rotate_whole(halved_sum, kEighth);
    };
    last(0, even0, odd0);
    last_j(2, even2, odd2);
    last(1, even1, eighth(saturated_sub_j(b1, b3), half_sub_j(b1, b3)));
    // By 135 degrees: 45 and 90.
    last_j(3, even3, eighth(saturated_add_j(b1, b3), half_add_j(b1, b3)));
}

}  // namespace dsp::radix8
