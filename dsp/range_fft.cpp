#include "dsp/range_fft.hpp"

#include <algorithm>
#include <cstddef>

#include "dsp/dc_levels.hpp"
#include "dsp/fixed_point.hpp"
#include "dsp/packed.hpp"
#include "dsp/packed_x86.hpp"
#include "dsp/radix8.hpp"

namespace dsp {

namespace {

using namespace radix8;

static_assert(kSamples == kFftLength);

// Windowed deviations have 13 bits, and each of the two passes may make them 8 times as large. The first ends
// with a fourth and the second with a half: 15 bits.

/// exp(-j 2 pi numerator / 64) / 2, Q15: the upper half of a product with it is a fourth. Just below one
/// half, it breaks ties to both sides equally often.
constexpr Pair half_root(int numerator) {
    const auto narrow = [](std::int32_t q30) {
        constexpr std::int32_t kTop = (1 << 14) - 1;
        return std::clamp((q30 + (1 << 15)) >> 16, -kTop, kTop);
    };
    return packed::pack(narrow(cosine_q30(numerator, kFftLength)), narrow(-sine_q30(numerator, kFftLength)));
}
/// Of samples in odd columns, which are negative until they are turned.
constexpr Pair half_root_of_column(int numerator, int column) {
    return half_root(numerator + column % 2 * kFftLength / 2);
}

constexpr auto kTurns = [] {
    using packed::portable::both_lane0;
    using packed::portable::both_lane1;
    std::array<RangeWindow::Turns, 4> turns{};
    for (int n = 0; n < 8; ++n) {
        RangeWindow::Turns& pair = turns[static_cast<std::size_t>(n) / 2];
        const auto i = static_cast<std::size_t>(n) % 2;
        const Pair first = half_root_of_column(n, n);
        const Pair first_turned = half_root_of_column(n + 8, n);
        const Pair third = half_root_of_column(3 * n, n);
        const Pair third_turned = half_root_of_column(3 * n + 24, n);
        pair.second[i] = half_root_of_column(2 * n, n);
        pair.first[i] = {both_lane0(first, first_turned), both_lane1(first, first_turned), 0};
        pair.first[i].minus = packed::portable::sub(0, pair.first[i].re);
        pair.third[i] = {both_lane0(third, third_turned), both_lane1(third, third_turned), 0};
        pair.third[i].minus = packed::portable::sub(0, pair.third[i].im);
    }
    return turns;
}();

/// exp(-j 2 pi n / 16) / 2, Q15.
constexpr std::array<Pair, 4> kSixteenths{half_root_of_column(0, 0), half_root_of_column(4, 1),
                                          half_root_of_column(8, 2), half_root_of_column(12, 3)};

/// What pack_high makes a fourth of, just below it as half_root.
constexpr std::int32_t kFourth = (1 << 14) - 1;
constexpr Pair kFourths = packed::pack(kFourth, kFourth);
constexpr std::int32_t kFourthTurned = 11585;  ///< times cos 45 degrees
constexpr Pair kPlus = packed::pack(kFourth, kFourthTurned);
constexpr Pair kMinus = packed::pack(-kFourth, -kFourthTurned);

/// Halving rounds down, by a quarter of a step on average, once on the way to every cell. Half a step more in
/// the first input of the second pass takes this bias away.
constexpr std::int32_t kUnbiased = 1 << 16;

// Word: a Pair for one chirp, or on a PC a Quad for four.

inline void put(Complex16* to, Pair x) {
    store(*to, x);
}
#if DSP_PACKED_FOUR
inline void put(Complex16* to, Quad x) {
    packed::store_quad(&to->re, x);
}
using packed::Sum4;
#endif

/// Between the passes.
template <class Word>
struct Rows {
    /// Rows of 8 columns: of cells 1 + 8 i, of 2 + 8 i, of 3 + 8 i; then the real ones of cells 8 i and 4 + 8
    /// i in turn, two columns in a word, the odd one negated.
    alignas(8) alignas(Word) std::array<Word, 32> word;
    static constexpr std::size_t kReal = 24;
};

/// Column n of a row and the next one to a word, column n + 1 of both to another, weighted. Each product is
/// rounded down, by half a step on average. Odd columns are negative until they are turned: the bias
/// alternates along the chirp, and falls into cell 32, which nobody needs.
inline void weigh(Pair row, Pair next, const Pair*& table, Pair& column_n, Pair& column_m) {
    using namespace packed;
    Pair row_n = 0;
    Pair row_m = 0;
    Pair next_n = 0;
    Pair next_m = 0;
    take_four(table, row_n, row_m, next_n, next_m);
    column_n = pack_low(scale_0(static_cast<std::int32_t>(row_n), row),
                        scale_0(static_cast<std::int32_t>(next_n), next));
    column_m = pack_low(scale_1(static_cast<std::int32_t>(row_m), row),
                        scale_1(static_cast<std::int32_t>(next_m), next));
}
#if DSP_PACKED_FOUR
inline void weigh(Quad row, Quad next, const Pair*& table, Quad& column_n, Quad& column_m) {
    const auto weight = [&table] { return static_cast<std::int32_t>(*table++); };
    const std::int32_t row_n = weight();
    row = packed::scale_lanes(row, row_n, weight());
    const std::int32_t next_n = weight();
    next = packed::scale_lanes(next, next_n, weight());
    column_n = packed::both_lane0(row, next);
    column_m = packed::both_lane1(row, next);
}
#endif

/// Columns n = kColumn and m = n + 1, the registers of a board in mind. `samples(row, n)`: a word of both.
/// Words then are of one column: (x0, x1), (a0, b0) and so on, where x4 is four rows after x0, a0 = x0 + x4,
/// a1 = x0 - x4, a2 = x2 + x6, a3 = x2 - x6, and b the same of x1 to x7.
template <std::size_t kColumn, class Word, class Samples>
inline void two_columns(const Samples& samples, const Pair*& table, Word mean, Word* rows) {
    using namespace packed;
    const auto deviation = [](const Samples& from, Word level, std::size_t row) {
        return sub(from(row, kColumn), level);
    };
    Word x0_n;
    Word x0_m;
    weigh(deviation(samples, mean, 0), deviation(samples, mean, 1), table, x0_n, x0_m);
    Word x4_n;
    Word x4_m;
    weigh(deviation(samples, mean, 4), deviation(samples, mean, 5), table, x4_n, x4_m);
    const Word a0_n = add(x0_n, x4_n);
    const Word a1_n = sub(x0_n, x4_n);
    const Word a0_m = add(x0_m, x4_m);
    const Word a1_m = sub(x0_m, x4_m);
    Word x2_n;
    Word x2_m;
    weigh(deviation(samples, mean, 2), deviation(samples, mean, 3), table, x2_n, x2_m);
    Word x6_n;
    Word x6_m;
    weigh(deviation(samples, mean, 6), deviation(samples, mean, 7), table, x6_n, x6_m);
    const Word a2_n = add(x2_n, x6_n);
    const Word a3_n = sub(x2_n, x6_n);
    const Word a2_m = add(x2_m, x6_m);
    const Word a3_m = sub(x2_m, x6_m);
    const Word sum_n = add(a0_n, a2_n);
    const Word sum_m = add(a0_m, a2_m);
    const Word second_n = sub(a0_n, a2_n);
    const Word second_m = sub(a0_m, a2_m);
    const Word even = both_lane0(sum_n, sum_m);
    const Word odd = both_lane1(sum_n, sum_m);
    store_pair(&rows[Rows<Word>::kReal + kColumn], saturated_add(even, odd), saturated_sub(even, odd));
    constexpr std::int32_t kRounding = kColumn == 0 ? kUnbiased : kHalf;
    Pair w0 = 0;
    Pair w1 = 0;
    Pair w2 = 0;
    Pair w3 = 0;
    take_four(table, w0, w1, w2, w3);
    // Result 2: a0 - a2 - j (b0 - b2)
    store_pair(&rows[8 + kColumn],
               pack_high(dot(second_n, w0, kRounding), dot_cross_minus(second_n, w0, kRounding)),
               pack_high(dot(second_m, w1, kHalf), dot_cross_minus(second_m, w1, kHalf)));
    // Result 1: a1 - j a3 + (b1 - j b3) exp(-j 2 pi / 8)
    const auto re1_n = dot(a3_n, w3, dot(a1_n, w2, kRounding));
    const auto im1_n = dot(a1_n, w3, kRounding);
    take_four(table, w0, w1, w2, w3);
    store_pair(&rows[kColumn], pack_high(re1_n, dot(a3_n, w0, im1_n)),
               pack_high(dot(a3_m, w2, dot(a1_m, w1, kHalf)), dot(a3_m, w3, dot(a1_m, w2, kHalf))));
    // Result 3: a1 + j a3 + (b1 + j b3) exp(-j 2 pi 3 / 8)
    take_four(table, w0, w1, w2, w3);
    const Word third_n =
        pack_high(dot(a3_n, w2, dot(a1_n, w0, kRounding)), dot(a3_n, w0, dot(a1_n, w1, kRounding)));
    const auto half_re3 = dot(a1_m, w3, kHalf);
    const Pair re3 = w3;
    take_pair(table, w0, w1);
    store_pair(&rows[16 + kColumn], third_n,
               pack_high(dot(a3_m, w1, half_re3), dot(a3_m, re3, dot(a1_m, w0, kHalf))));
}

template <class Word, class Samples>
inline void first_pass(const Samples& samples, const Pair*& table, Word mean, Word* rows) {
    two_columns<0>(samples, table, mean, rows);
    two_columns<2>(samples, table, mean, rows);
    two_columns<4>(samples, table, mean, rows);
    two_columns<6>(samples, table, mean, rows);
}

template <class Word>
inline Word conjugate(Word z) {
    return packed::pack_mixed(z, packed::saturated_sub(Word{}, z));
}

/// Cells kFirst + 8 i and those of negative frequency, 32 - kFirst - 8 i. `mean`: what the mean's remainder
/// adds to the first.
template <std::size_t kFirst, class Word>
inline void complex_row(const Word* row, Word mean, Complex16* out) {
    using namespace packed;
    const auto low = [out](std::size_t i) { return &out[kFftLength * (kFirst + 8 * i)]; };
    const auto high = [out](std::size_t i) { return &out[kFftLength * (32 - kFirst - 8 * i)]; };
    const auto x = load_8(row);
    const Word a0 = saturated_add(x[0], x[4]);
    const Word a1 = saturated_sub(x[0], x[4]);
    const Word a2 = saturated_add(x[2], x[6]);
    const Word a3 = saturated_sub(x[2], x[6]);
    const Word even0 = saturated_add(a0, a2);
    const Word even2 = saturated_sub(a0, a2);
    const Word even1 = half_sub_j(a1, a3);
    const Word even3 = half_add_j(a1, a3);
    const Word b0 = saturated_add(x[1], x[5]);
    const Word b1 = saturated_sub(x[1], x[5]);
    const Word b2 = saturated_add(x[3], x[7]);
    const Word b3 = saturated_sub(x[3], x[7]);
    const Word odd0 = saturated_add(b0, b2);
    const Word odd2 = saturated_sub(b0, b2);
    const Word sum = half_add(even0, odd0);
    put(low(0), kFirst < 3 ? sub(sum, mean) : sum);
    put(high(0), conjugate(half_sub(even0, odd0)));
    put(low(2), half_sub_j(even2, odd2));
    put(high(2), conjugate(half_add_j(even2, odd2)));
    // even + odd and the conjugate of even - odd: (even.re, odd.im) +- (odd.re, even.im)
    const auto last = [&](std::size_t i, Word even, auto odd_re, auto odd_im) {
        const Word a = mix_high(even, odd_im);
        const Word b = mix_low(odd_re, even);
        put(low(i), saturated_add(a, b));
        put(high(i), saturated_sub(a, b));
    };
    const Word turned1 = saturated_sub_j(b1, b3);
    last(1, even1, dot_minus(turned1, kEighth, kHalf), dot_cross(turned1, kEighth, kHalf));
    // By 135 degrees.
    const Word turned3 = saturated_add_j(b1, b3);
    last(3, even3, dot_cross(turned3, kEighth, kHalf), dot_cross_minus(turned3, kEighth, kHalf));
}

/// Cells 4 + 8 i: the sum over y[n] exp(-j 2 pi n (1 + 2 i) / 16), as a transform of length 4 of (y[n] - j
/// y[n + 4]) exp(-j 2 pi n / 16).
template <class Word>
inline void fourth_row(Word y01, Word y23, Word y45, Word y67, const Pair*& table, Complex16* out) {
    using namespace packed;
    const auto turned = [](Word y, Pair root, std::int32_t rounding) {
        return pack_high(dot(y, root, rounding), dot_cross_minus(y, root, rounding));
    };
    Pair root2 = 0;
    Pair root1 = 0;
    take_pair(table, root1, root2);
    const Word z0 = turned(both_lane0(y01, y45), kSixteenths[0], kUnbiased);
    const Word z2 = turned(both_lane0(y23, y67), root2, kHalf);
    const Word a = saturated_add(z0, z2);
    const Word b = saturated_sub(z0, z2);
    const Word z1 = turned(both_lane1(y01, y45), root1, kHalf);
    Pair root3 = 0;
    Pair plus = 0;
    take_pair(table, root3, plus);
    const Word z3 = turned(both_lane1(y23, y67), root3, kHalf);
    const Word c = saturated_add(z1, z3);
    const Word d = saturated_sub(z1, z3);
    const auto cell = [out](std::size_t i) { return &out[kFftLength * (4 + 8 * i)]; };
    put(cell(0), half_add(a, c));
    put(cell(2), half_sub_j(b, d));
    put(cell(3), conjugate(half_sub(a, c)));
    put(cell(1), conjugate(half_add_j(b, d)));
}

/// Cells 8 i: a real transform of 8, by its definition but for the first level, which halves.
template <class Word, class Sum>
inline void first_row(Word y01, Word y23, Word y45, Word y67, Sum mean, const Pair*& table, Complex16* out) {
    using namespace packed;
    // The first level rounds down, by a quarter of a step on average, which makes 0.03 to 0.15 in cells 8
    // and 24.
    constexpr std::int32_t kUnbiasedHalf = kHalf + (5 << 10);
    const Word a0 = half_add(y01, y45);  // (y0 + y4, -(y1 + y5))
    const Word a1 = half_sub(y01, y45);
    const Word a2 = half_add(y23, y67);
    const Word a3 = half_sub(y23, y67);
    const auto cell = [out](std::size_t i) { return &out[kFftLength * 8 * i]; };
    put(cell(0), upper_half(dot_minus(a2, kFourths, dot_minus(a0, kFourths, mean))));
    Pair plus = 0;
    Pair minus = 0;
    take_pair(table, plus, minus);
    put(cell(2), pack_high(multiply_00(a2, minus, multiply_00(a0, plus, kHalf)),
                           multiply_10(a2, minus, multiply_10(a0, plus, kHalf))));
    put(cell(1), pack_high(multiply_11(a3, plus, dot_minus(a1, plus, kUnbiasedHalf)),
                           multiply_11(a1, plus, dot_minus(a3, minus, kUnbiasedHalf))));
    put(cell(3), pack_high(multiply_11(a3, minus, dot(a1, plus, kUnbiasedHalf)),
                           multiply_11(a1, plus, dot(a3, plus, kUnbiasedHalf))));
}

/// Of one chirp: 64 times the mean is `whole` times 64 and `rest`.
struct ChirpMean {
    std::int32_t whole;
    std::int32_t rest;
    explicit ChirpMean(std::int32_t sum)
        : whole((sum + kSamples / 2) >> kMeanBits),
          rest(((sum + kSamples / 2) & (kSamples - 1)) - kSamples / 2) {}

    [[nodiscard]] Pair both_lanes() const { return packed::pack_low(whole, whole); }
    /// What the rest adds to a sum.
    [[nodiscard]] std::int32_t added(Pair response, std::int32_t sum) const {
        return static_cast<std::int32_t>(
            packed::multiply_add(static_cast<Pair>(rest), response, static_cast<Pair>(sum)));
    }
};
struct ChirpSamples {
    const std::int16_t* x;
    Pair operator()(std::size_t row, std::size_t column) const { return packed::load(x + 8 * row + column); }
};

#if DSP_PACKED_FOUR
/// The same of four.
struct FourMeans {
    std::array<ChirpMean, 4> mean;

    [[nodiscard]] Quad both_lanes() const {
        return of_each([](const ChirpMean& m) { return static_cast<int>(m.both_lanes()); });
    }
    [[nodiscard]] Sum4 added(Pair response, std::int32_t sum) const {
        return Sum4(of_each([response, sum](const ChirpMean& m) { return m.added(response, sum); }).v);
    }

  private:
    template <class Of>
    Quad of_each(Of of) const {
        return Quad(_mm_set_epi32(of(mean[3]), of(mean[2]), of(mean[1]), of(mean[0])));
    }
};
struct FourChirps {
    std::array<Quad, kSamples / 2> word;
    explicit FourChirps(const std::int16_t* x) {
        for (std::size_t i = 0; i < word.size(); i += 4) {
            packed::load_transposed(reinterpret_cast<const Pair*>(x) + i, kSamples / 2, &word[i]);
        }
    }
    Quad operator()(std::size_t row, std::size_t column) const { return word[4 * row + column / 2]; }
};
#endif

template <class Word, class Samples, class Mean>
inline void transform(const Samples& samples, const Mean& mean, const RangeWindow& window, Complex16* out) {
    Rows<Word> rows;
    const Pair* table = window.table();
    first_pass(samples, table, mean.both_lanes(), rows.word.data());
    Pair response0 = 0;
    Pair response1 = 0;
    packed::take_pair(table, response0, response1);
    const auto y = [&rows](std::size_t i) { return rows.word[Rows<Word>::kReal + i]; };
    fourth_row(y(1), y(3), y(5), y(7), table, out);
    first_row(y(0), y(2), y(4), y(6), mean.added(response0, kHalf), table, out);
    complex_row<1>(rows.word.data(), packed::upper_half(mean.added(response1, kHalf)), out);
    complex_row<2>(&rows.word[8], packed::upper_half(mean.added(*table, kHalf)), out);
    complex_row<3>(&rows.word[16], Word{}, out);
}

[[gnu::noinline]] void transform_chirp(const std::int16_t* x, std::int32_t sum, const RangeWindow& window,
                                       Complex16* out) {
    transform<Pair>(ChirpSamples{x}, ChirpMean(sum), window, out);
}

/// For deviations of more than 16 bits.
[[gnu::noinline]] void scale_down(const std::int16_t* x, std::int32_t sum, int down, std::int16_t* to) {
    for (std::size_t n = 0; n < kSamples; ++n) {
        to[n] = static_cast<std::int16_t>(round_shift(kSamples * x[n] - sum, kMeanBits + down));
    }
}

}  // namespace

RangeWindow::RangeWindow(const Window& window, int exponent) : exponent_(exponent) {
    const int used = std::min(exponent, kHighestExponent);
    const int up = kHighestExponent - used;
    // One more, so that few products are integers: these would not be rounded down.
    const auto weight = [up](std::int16_t w) { return (w << up) + 1; };
    const std::int16_t* w = window.data();
    const Turns* turns = kTurns.data();
    for (Columns& columns : table_.columns) {
        std::int32_t* to = columns.weight.data();
        for (const std::size_t row : {0U, 4U, 2U, 6U}) {
            const std::int16_t* const two_rows = w + 8 * row;
            to[0] = weight(two_rows[0]);
            to[1] = -weight(two_rows[1]);
            to[2] = weight(two_rows[8]);
            to[3] = -weight(two_rows[9]);
            to += 4;
        }
        w += 2;
        columns.turns = *turns++;
    }
    // A window a0 - a1 cos(2 pi n / 64) + a2 cos(4 pi n / 64), from the samples that tell.
    const std::int32_t even = (window[0] + window[32]) / 2;  // a0 + a2
    const std::int32_t a0 = (even + window[16]) / 2;
    const std::int32_t a1 = (window[32] - window[0]) / 2;
    const std::int32_t a2 = (even - window[16]) / 2;
    const auto scaled = [up](std::int32_t a) { return static_cast<Pair>(a * (1 << up) >> 4); };
    table_.second_pass = {scaled(-2 * a0), scaled(-a1), kSixteenths[1], kSixteenths[2], kSixteenths[3], 0,
                          kPlus,           kMinus,      scaled(a2)};
}

void range_fft(const std::int16_t* chirps, std::span<const std::int32_t> sums, const RangeWindow& window,
               Complex16* out) {
    const int down = window.exponent() - RangeWindow::kHighestExponent;
    std::size_t i = 0;
#if DSP_PACKED_FOUR
    for (; down <= 0 && i + 4 <= sums.size(); i += 4) {
        const auto mean = [&](std::size_t k) { return ChirpMean(sums[i + k]); };
        transform<Quad>(FourChirps(chirps + kSamples * i), FourMeans{{mean(0), mean(1), mean(2), mean(3)}},
                        window, out + i);
    }
#endif
    for (; i < sums.size(); ++i) {
        std::array<std::int16_t, kSamples> scaled;
        const std::int16_t* x = chirps + kSamples * i;
        std::int32_t sum = sums[i];
        if (down > 0) [[unlikely]] {
            scale_down(x, sum, down, scaled.data());
            x = scaled.data();
            sum = 0;
        }
        transform_chirp(x, sum, window, out + i);
    }
}

}  // namespace dsp
