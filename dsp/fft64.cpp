#include "dsp/fft64.hpp"

#include <algorithm>
#include <bit>

#include "dsp/packed.hpp"
#include "dsp/sine.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

using packed::Pair;

constexpr std::int32_t kHalf = 1 << 15;  ///< rounds what pack_high cuts off

/// Q15, within +-32767: a factor just below one also breaks the ties of halving, to both sides equally often.
constexpr Pair root(int numerator) {
    const auto narrow = [](std::int32_t q30) { return (q30 + (1 << 14)) >> 15; };
    const std::int32_t re = narrow(cosine_q30(numerator, kFftLength));
    const std::int32_t im = narrow(-sine_q30(numerator, kFftLength));
    return packed::pack(std::clamp<std::int32_t>(re, -32767, 32767),
                        std::clamp<std::int32_t>(im, -32767, 32767));
}

/// Halving rounds down: the second pass takes a quarter of a step, on average, from what its second and third
/// level give. That is what impulses at its first two inputs would make of them, so these, negated, take the
/// bias away. For each n, quarters of a step of the first pass's result.
constexpr std::array<std::int32_t, 8> kBias{6, 2, 0, 0, 0, 0, 0, 0};

/// What the first pass needs for samples n, n + 8 ..
struct Column {
    /// exp(-j 2 pi n k / 64) for k = 0, 4, 1, 5, 2, 6, 3, 7: as radix8 gives its results
    std::array<Pair, 8> twiddle;
    std::int32_t rounding;  ///< of the rotations
};

constexpr auto kColumns = [] {
    std::array<Column, 8> columns{};
    for (int n = 0; n < 8; ++n) {
        Column& column = columns[static_cast<std::size_t>(n)];
        column.rounding = kHalf + kBias[static_cast<std::size_t>(n)] * (1 << 14);
        for (int i = 0; i < 8; ++i) {
            column.twiddle[static_cast<std::size_t>(i)] = root(n * (i / 2 + i % 2 * 4));
        }
    }
    return columns;
}();
constexpr Pair kEighth = root(8);

/// a w / 2, rounded.
inline Pair rotate(Pair a, Pair w, std::int32_t rounding = kHalf) {
    return packed::pack_high(packed::dot_minus(a, w, rounding), packed::dot_cross(a, w, rounding));
}

/// a w, rounded.
inline Pair rotate_whole(Pair a, Pair w) {
    constexpr std::int32_t kQuarter = kHalf / 2;
    return packed::pack_doubled(packed::dot_minus(a, w, kQuarter), packed::dot_cross(a, w, kQuarter));
}

/// 8-point transform, radix-2 decimation in time written out: X[k], X[k + 4] for k = 0..3 to emit(k, X[k],
/// X[k + 4]). In the order that needs few registers. The second and third level halve if asked to. The
/// sums of the first level and, without halving, of the third clip.
template <bool kHalve, class Load, class Emit>
inline void radix8(Load x, Emit emit) {
    using namespace packed;
    const Pair x0 = x(0);
    const Pair x4 = x(4);
    const Pair a0 = saturated_add(x0, x4);
    const Pair a1 = saturated_sub(x0, x4);
    const Pair x2 = x(2);
    const Pair x6 = x(6);
    const Pair a2 = saturated_add(x2, x6);
    const Pair a3 = saturated_sub(x2, x6);
    const Pair even0 = kHalve ? half_add(a0, a2) : add(a0, a2);
    const Pair even2 = kHalve ? half_sub(a0, a2) : sub(a0, a2);
    const Pair even1 = kHalve ? half_sub_j(a1, a3) : sub_j(a1, a3);
    const Pair even3 = kHalve ? half_add_j(a1, a3) : add_j(a1, a3);
    const Pair x1 = x(1);
    const Pair x5 = x(5);
    const Pair b0 = saturated_add(x1, x5);
    const Pair b1 = saturated_sub(x1, x5);
    const Pair x3 = x(3);
    const Pair x7 = x(7);
    const Pair b2 = saturated_add(x3, x7);
    const Pair b3 = saturated_sub(x3, x7);
    const Pair odd0 = kHalve ? half_add(b0, b2) : add(b0, b2);
    const Pair odd2 = kHalve ? half_sub(b0, b2) : sub(b0, b2);
    const auto last = [&emit](std::size_t k, Pair a, Pair b) {
        emit(k, kHalve ? half_add(a, b) : saturated_add(a, b), kHalve ? half_sub(a, b) : saturated_sub(a, b));
    };
    const auto last_j = [&emit](std::size_t k, Pair a, Pair b) {
        emit(k, kHalve ? half_sub_j(a, b) : saturated_sub_j(a, b),
             kHalve ? half_add_j(a, b) : saturated_add_j(a, b));
    };
    last(0, even0, odd0);
    last_j(2, even2, odd2);
    last(1, even1, rotate_whole(kHalve ? half_sub_j(b1, b3) : sub_j(b1, b3), kEighth));
    // By 135 degrees: 45 and 90.
    last_j(3, even3, rotate_whole(kHalve ? half_add_j(b1, b3) : add_j(b1, b3), kEighth));
}

inline Pair load(const Complex16& x) {
    return std::bit_cast<Pair>(x);
}

}  // namespace

void fft64(std::span<Complex16, kFftLength> data) {
    alignas(8) std::array<Pair, kFftLength> work;  // [n][i], i as in Column
    Pair* to = work.data();
    const Complex16* from = data.data();
    for (const Column& column : kColumns) {
        radix8<false>([from](std::size_t m) { return load(from[8 * m]); },
                      [to, &column](std::size_t k, Pair low, Pair high) {
                          const Pair lower = rotate(low, column.twiddle[2 * k], column.rounding);
                          const Pair upper = rotate(high, column.twiddle[2 * k + 1], column.rounding);
                          to[2 * k] = lower;
                          to[2 * k + 1] = upper;
                      });
        to += 8;
        ++from;
    }
    for (std::size_t half = 0; half < 2; ++half) {
        for (std::size_t k = 0; k < 4; ++k) {
            Complex16* const out = &data[4 * half + k];
            radix8<true>([row = &work[2 * k + half]](std::size_t n) { return row[8 * n]; },
                         [out](std::size_t q, Pair low, Pair high) {
                             out[8 * q] = std::bit_cast<Complex16>(low);
                             out[8 * q + 32] = std::bit_cast<Complex16>(high);
                         });
        }
    }
}

void fft64_real_pair(std::span<Complex16, kFftLength> z, Complex16* ab) {
    fft64(z);
    const auto split = [&](std::size_t k, std::size_t mirrored) {
        const Pair p = load(z[k]);
        const Pair q = packed::swap(load(z[mirrored]));
        ab[k * kFftLength] = std::bit_cast<Complex16>(packed::sub_j(p, q));
        ab[k * kFftLength + 1] = std::bit_cast<Complex16>(packed::sub_j(q, p));
    };
    split(0, 0);
    constexpr std::size_t kLast = kFftLength / 2 - 1;
    unrolled<kLast - 1, 1, 5>([&](std::size_t i) { split(i + 1, kFftLength - 1 - i); });
    split(kLast, kFftLength - kLast);
}

}  // namespace dsp
