#include "dsp/tapered_fft64.hpp"

#include <array>
#include <bit>

#include "dsp/packed.hpp"
#include "dsp/sine.hpp"

namespace dsp {

namespace {

using packed::Pair;

/// Where a radix-8 pass halves: always at its second level, where the rotations by 45 degrees do so by
/// themselves, and at one more.
enum class Halving { first, last };

constexpr std::int32_t kHalf = 1 << 15;  ///< rounds what pack_high cuts off

/// Q15, below one.
constexpr Pair root(int numerator) {
    const auto narrow = [](std::int32_t q30) { return (q30 + (1 << 14)) >> 15; };
    const std::int32_t re = narrow(cosine_q30(numerator, kFftLength));
    const std::int32_t im = narrow(-sine_q30(numerator, kFftLength));
    return packed::pack(re > 32767 ? 32767 : re, im > 32767 ? 32767 : im);
}

/// Halving rounds down: each level takes a quarter of a step, on average, from what it gives. What that makes
/// of the result is what impulses at a few inputs of each pass would make of it, so these, negated, take the
/// bias away.
constexpr std::array<std::int32_t, 8> kStart{2, 1, 2, 2, 1, 2, 2, 2};  ///< to sample n of the transform
/// To what the first pass gives for n, quarters of a step.
constexpr std::array<std::int32_t, 8> kSecondPass{6, 4, 2, 2, 0, 2, 0, 0};

/// Where a constant is rounded up of 0..7: as often as down, at no frequency of the transform.
constexpr int kUneven = 0b1001'0110;

/// What the first pass needs for samples n, n + 8 ..
struct Column {
    Pair start;             ///< added to the first sample
    Pair first;             ///< added to X[0] before it is halved
    std::int32_t rounding;  ///< of the rotations
    /// exp(-j 2 pi n k / 64) for k = 4, 1, 5, 2, 6, 3, 7: as radix8 gives its results, X[0] apart
    std::array<Pair, 7> twiddle;
};

constexpr auto kColumns = [] {
    std::array<Column, 8> columns{};
    for (int n = 0; n < 8; ++n) {
        Column& column = columns[static_cast<std::size_t>(n)];
        const std::int32_t bias = kSecondPass[static_cast<std::size_t>(n)];
        const std::int32_t start = kStart[static_cast<std::size_t>(n)];
        column.start = packed::pack(start, start);
        // Twice, and half a step for the halving itself, which integers give only on average.
        const std::int32_t first = (2 * bias + ((kUneven >> n & 1) != 0 ? 4 : 2)) / 4;
        column.first = packed::pack(first, first);
        column.rounding = kHalf + bias * (1 << 14);
        for (int i = 1; i < 8; ++i) {
            column.twiddle[static_cast<std::size_t>(i - 1)] = root(n * (i / 2 + i % 2 * 4));
        }
    }
    return columns;
}();
constexpr Pair kEighth = root(8);

/// a w / 2, rounded.
inline Pair rotate(Pair a, Pair w, std::int32_t rounding = kHalf) {
    return packed::pack_high(packed::dot_minus(a, w, rounding), packed::dot_cross(a, w, rounding));
}
/// 8-point transform, radix-2 decimation in time written out: X[k], X[k + 4] for k = 0..3 to emit(k, X[k],
/// X[k + 4]). In the order that needs few registers.
template <Halving kHalving, class Load, class Emit>
inline void radix8(Load x, Emit emit) {
    using namespace packed;
    constexpr bool kFirst = kHalving == Halving::first;
    constexpr bool kLast = kHalving == Halving::last;
    struct Two {
        Pair sum;
        Pair difference;
    };
    const auto first = [](Pair a, Pair b) -> Two {
        return kFirst ? Two{half_add(a, b), half_sub(a, b)} : Two{add(a, b), sub(a, b)};
    };
    const Two a0 = first(x(0), x(4));
    const Two a2 = first(x(2), x(6));
    const Pair even0 = half_add(a0.sum, a2.sum);
    const Pair even2 = half_sub(a0.sum, a2.sum);
    const Pair even1 = half_sub_j(a0.difference, a2.difference);
    const Pair even3 = half_add_j(a0.difference, a2.difference);
    const Two b1 = first(x(1), x(5));
    const Two b3 = first(x(3), x(7));
    const Pair odd0 = half_add(b1.sum, b3.sum);
    const Pair odd2 = half_sub(b1.sum, b3.sum);
    emit(0, kLast ? half_add(even0, odd0) : add(even0, odd0),
         kLast ? half_sub(even0, odd0) : sub(even0, odd0));
    emit(2, kLast ? half_sub_j(even2, odd2) : sub_j(even2, odd2),
         kLast ? half_add_j(even2, odd2) : add_j(even2, odd2));
    const Pair odd1 = rotate(saturated_sub_j(b1.difference, b3.difference), kEighth);
    emit(1, kLast ? half_add(even1, odd1) : add(even1, odd1),
         kLast ? half_sub(even1, odd1) : sub(even1, odd1));
    // By 135 degrees: 45 and 90.
    const Pair odd3 = rotate(saturated_add_j(b1.difference, b3.difference), kEighth);
    emit(3, kLast ? half_sub_j(even3, odd3) : sub_j(even3, odd3),
         kLast ? half_add_j(even3, odd3) : add_j(even3, odd3));
}

inline Pair load(const Complex16& x) {
    return std::bit_cast<Pair>(x);
}

}  // namespace

void tapered_fft64(std::span<Complex16, kFftLength> data) {
    alignas(8) std::array<Pair, kFftLength> work;  // [n][i]: X[0], then as in Column
    const auto samples = [data](std::size_t n, const Column& column) {
        return [from = &data[n], &column](std::size_t m) {
            const Pair x = load(from[8 * m]);
            return m == 0 ? packed::add(x, column.start) : x;
        };
    };
    radix8<Halving::last>(samples(0, kColumns[0]), [&work](std::size_t k, Pair low, Pair high) {
        const Pair lower = packed::half_add(low, kColumns[0].first);
        const Pair upper = packed::half_add(high, kColumns[0].first);
        work[2 * k] = lower;
        work[2 * k + 1] = upper;
    });
    for (std::size_t n = 1; n < 8; ++n) {
        Pair* const to = &work[8 * n];
        const Column& column = kColumns[n];
        radix8<Halving::last>(samples(n, column), [to, &column](std::size_t k, Pair low, Pair high) {
            const Pair lower = k == 0 ? packed::half_add(low, column.first)
                                      : rotate(low, column.twiddle[2 * k - 1], column.rounding);
            const Pair upper = rotate(high, column.twiddle[2 * k], column.rounding);
            to[2 * k] = lower;
            to[2 * k + 1] = upper;
        });
    }
    for (std::size_t half = 0; half < 2; ++half) {
        for (std::size_t k = 0; k < 4; ++k) {
            Complex16* const to = &data[4 * half + k];
            radix8<Halving::first>([from = &work[2 * k + half]](std::size_t n) { return from[8 * n]; },
                                   [to](std::size_t q, Pair low, Pair high) {
                                       to[8 * q] = std::bit_cast<Complex16>(low);
                                       to[8 * q + 32] = std::bit_cast<Complex16>(high);
                                   });
        }
    }
}

void tapered_fft64_real_pair(std::span<Complex16, kFftLength> z, Complex16* ab, std::size_t stride) {
    tapered_fft64(z);
    const auto split = [&](std::size_t k, std::size_t mirrored) {
        const Pair p = load(z[k]);
        const Pair q = packed::swap(load(z[mirrored]));
        ab[k * stride] = std::bit_cast<Complex16>(packed::sub_j(p, q));
        ab[k * stride + 1] = std::bit_cast<Complex16>(packed::sub_j(q, p));
    };
    split(0, 0);
    for (std::size_t k = 1; k < kFftLength / 2; ++k) split(k, kFftLength - k);
}

}  // namespace dsp
