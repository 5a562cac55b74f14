#include "dsp/range_fft.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/dc_levels.hpp"
#include "dsp/fixed_point.hpp"
#include "dsp/radix8.hpp"

namespace dsp {

namespace {

using namespace radix8;

static_assert(kSamples == kFftLength);
/// Deviations get 14 bits, so that what the lanes of a word take from each other is little; the Q14 window
/// and the upper halves of the products give two of them up again.
constexpr int kHighestExponent = 2;

/// What the first pass needs for cells both chirps share; exp(-j 2 pi 4 n / 64) = c - j s.
struct SharedColumn {
    Pair rounding;
    std::array<Pair, 3> root;  ///< c, s and -s, twice each
};

/// Halving rounds down, which leaves a bias; small impulses at the input of the second pass take it away, as
/// in fft64. Quarters of a step of the first pass's result.
constexpr std::array<std::int32_t, 8> kPairBias{6, 2, 0, 0, 0, 0, 0, 0};
constexpr std::array<std::int32_t, 8> kBias{2, 1, 0, 0, 0, 1, 0, 0};

constexpr auto kRoots = [] {
    std::array<std::array<Pair, 3>, 8> roots{};
    for (int n = 0; n < 8; ++n) roots[static_cast<std::size_t>(n)] = {root(n), root(3 * n), root(2 * n)};
    return roots;
}();
alignas(8) constexpr auto kSharedColumns = [] {
    std::array<SharedColumn, 8> columns{};
    for (int n = 0; n < 8; ++n) {
        const auto i = static_cast<std::size_t>(n);
        const std::int32_t c = packed::lane0(root(4 * n));
        const std::int32_t s = -packed::lane1(root(4 * n));
        columns[i] = {static_cast<Pair>(kHalf + kPairBias[i] * (1 << 14)),
                      {packed::pack(c, c), packed::pack(s, s), packed::pack(-s, -s)}};
    }
    return columns;
}();

// Word: a Pair for two chirps, or on a PC a Quad for four times two, each chirp two columns from the last
// one.

/// Between the passes: for each chirp rows of 8, first cells 0, 8 .., then 1, 9 .., 2, 10 .. and 3, 11 ..
template <class Word>
using Rows = std::array<Word, kFftLength>;

inline Pair sample(const std::int16_t* x, Pair) {
    return static_cast<Pair>(std::int32_t{*x});
}
inline void put(Complex16* to, Pair x) {
    store(*to, x);
}
#if DSP_PACKED_FOUR
constexpr std::ptrdiff_t kFour = std::ptrdiff_t{2} * kSamples;  ///< from one pair of chirps to the next
inline Quad sample(const std::int16_t* x, Quad) {
    return Quad(_mm_set_epi32(x[3 * kFour], x[2 * kFour], x[kFour], x[0]));
}
inline void put(Complex16* to, Quad x) {
    std::array<Complex16, 4> four;
    _mm_storeu_si128(reinterpret_cast<__m128i*>(four.data()), x.v);
    for (std::size_t i = 0; i < 4; ++i) to[2 * i] = four[i];
}
#endif

/// Of one chirp. A word is sample n + 32 times 2^16 plus sample n, as a sum: where the latter is negative, it
/// takes one from the upper lane, half a step on average, which dither in dc turns. Row 0 gets the sums of
/// samples with even and with odd m.
template <class Word>
inline void first_pass(const std::int16_t* x, Pair gain, Word dc, const RangeWindow& window, Word* to) {
    using namespace packed;
    const Pair* table = window.columns()->weight.data();
    const auto load_two = [&](std::size_t m) {
        return multiply_add(add_shifted(sample(x + 8 * m, dc), sample(x + 8 * m + 32, dc)), gain, dc);
    };
    const std::int16_t* const end = x + 8;
    do {
        Pair w0 = 0;
        Pair w2 = 0;
        take_pair(table, w0, w2);
        const Word x0 = load_two(0);
        const Word x2 = load_two(2);
        const Word a = pack_high(dot_minus(x0, w0, kHalf), dot_minus(x2, w2, kHalf));
        const auto sum0 = dot(x0, w0, kHalf);
        const auto sum2 = dot(x2, w2, kHalf);
        Pair w1 = 0;
        Pair turned1 = 0;
        take_pair(table, w1, turned1);
        const Word x1 = load_two(1);
        const Word sum01 = pack_high(sum0, dot(x1, w1, kHalf));
        const auto difference1 = dot_minus(x1, turned1, kHalf);
        Pair w3 = 0;
        Pair turned3 = 0;
        take_pair(table, w3, turned3);
        const Word x3 = load_two(3);
        ++x;
        const Word b = pack_high(difference1, dot_minus(x3, turned3, kHalf));
        const Word sum23 = pack_high(sum2, dot(x3, w3, kHalf));
        to[0] = add(sum01, sum23);
        const Word conjugate2 = sub(sum01, sum23);
        const Word turned = add_j(b, b);  // (b1 - b3, b1 + b3), in units of cos 45 degrees
        const Word conjugate1 = add(a, turned);
        const Word y3 = sub(a, turned);
        Pair root1 = 0;
        Pair root3 = 0;
        take_pair(table, root1, root3);
        Pair root2 = 0;
        Pair rounding = 0;
        take_pair(table, root2, rounding);
        const auto half = static_cast<std::int32_t>(rounding);
        const auto rotate_conjugate = [half](Word y, Pair root) {
            return pack_high(dot(y, root, half), dot_cross_minus(y, root, half));
        };
        to[8] = rotate_conjugate(conjugate1, root1);
        to[24] = rotate(y3, root3, half);
        to[16] = rotate_conjugate(conjugate2, root2);
        ++to;
    } while (x != end);
}

/// Cells 0, 8 .. of both chirps to row 0, as the parts of complex numbers, and cells 4, 12 .. to row 4.
template <class Word>
inline void share(Rows<Word>& rows) {
    using namespace packed;
    constexpr Pair kOne = pack(32767, 32767);
    const Pair* table = &kSharedColumns[0].rounding;
    for (Word* to = rows.data(); to != rows.data() + 8; ++to) {
        Pair first = 0;
        Pair c = 0;
        take_pair(table, first, c);
        Pair s = 0;
        Pair minus_s = 0;
        take_pair(table, s, minus_s);
        const auto rounding = static_cast<std::int32_t>(first);
        const Word even = to[0];
        const Word odd = to[32];
        to[0] = pack_high(dot(even, kOne, rounding), dot(odd, kOne, rounding));
        to[32] = pack_high(dot_minus(odd, s, dot_minus(even, c, rounding)),
                           dot_minus(odd, c, dot_minus(even, minus_s, rounding)));
    }
}

template <class Word>
inline Word conjugate(Word z) {
    return packed::pack_mixed(z, packed::saturated_sub(Word{}, z));
}

/// Cells kFirst + 8 q of both chirps, whose transforms are the parts of one.
template <std::size_t kFirst, class Word>
inline void shared_cells(const Word* row, Complex16* out) {
    std::array<Word, 8> z;
    const auto x = packed::load_8(row);
    transform<Halving::second_and_third>([&x](std::size_t n) { return x[n]; },
                                         [&z](std::size_t q, Word low, Word high) {
                                             z[q] = low;
                                             z[q + 4] = high;
                                         });
    const auto split = [&](std::size_t q) {
        const Word p = z[q];
        const Word mirrored = packed::swap(z[kFirst == 0 ? (8 - q) % 8 : 7 - q]);
        Complex16* const to = &out[kFftLength * (kFirst + 8 * q)];
        put(to, packed::saturated_sub_j(p, mirrored));
        put(to + 1, packed::saturated_sub_j(mirrored, p));
    };
    split(0);
    split(1);
    split(2);
    split(3);
}

template <class Word>
inline void second_pass(const Rows<Word>& rows, Complex16* out) {
    shared_cells<0>(rows.data(), out);
    shared_cells<4>(&rows[32], out);
    const Word* row = rows.data();
    for (std::size_t chirp = 0; chirp < 2; ++chirp) {
        for (std::size_t k = 1; k < 4; ++k) {
            row += 8;
            const auto x = packed::load_8(row);
            transform<Halving::second>([&x](std::size_t n) { return x[n]; },
                                       [low_to = out + kFftLength * k, high_to = out + kFftLength * (32 - k)](
                                           std::size_t q, Word low, Word high) {
                                           put(low_to + kFftLength * 8 * q, low);
                                           put(high_to - kFftLength * 8 * q, conjugate(high));
                                       });
        }
        row += 8;
        ++out;
    }
}

}  // namespace

RangeWindow::RangeWindow(const Window& window) {
    constexpr std::int32_t kCosine45 = 23170;  // Q15
    for (std::size_t n = 0; n < 8; ++n) {
        const auto weights = [w = &window[n]](std::size_t m, std::int32_t scale) {
            return packed::pack_high(w[8 * m] * scale + kHalf, w[8 * m + 32] * scale + kHalf);
        };
        constexpr std::int32_t kWhole = 1 << 15;
        columns_[n] = {{weights(0, kWhole), weights(2, kWhole), weights(1, kWhole), weights(1, kCosine45),
                        weights(3, kWhole), weights(3, kCosine45)},
                       kRoots[n],
                       static_cast<Pair>(kHalf + kBias[n] * (1 << 14))};
    }
}

namespace {

/// For deviations that need more than the 16 bits of a lane.
[[gnu::noinline]] void first_pass_scaled_down(const std::int16_t* x, std::int32_t sum, int down, Pair dither,
                                              const RangeWindow& window, Pair* to) {
    std::array<std::int16_t, kSamples> scaled;
    for (std::size_t n = 0; n < kSamples; ++n) {
        scaled[n] = static_cast<std::int16_t>(round_shift(kSamples * x[n] - sum, kMeanBits + down));
    }
    first_pass(scaled.data(), 1, dither, window, to);
}

}  // namespace

namespace {

/// -2^up times the mean, in both lanes.
Pair minus_mean(std::int32_t sum, int up) {
    const std::int32_t mean =
        up < kMeanBits ? (sum + (kSamples >> up >> 1)) >> (kMeanBits - up) : sum * (1 << (up - kMeanBits));
    return Pair{0} - static_cast<Pair>(mean) * 0x10001U;
}

}  // namespace

void range_fft(const ChirpPair& chirps, const RangeWindow& window, Complex16* out) {
    Rows<Pair> rows;
    const int up = kHighestExponent - chirps.exponent;
    const auto chirp = [&](std::size_t i, Pair* to) {
        const std::int16_t* const x = chirps.samples + kSamples * i;
        const Pair dither = chirps.dither[i] << 16;
        if (up < 0) {
            first_pass_scaled_down(x, chirps.sum[i], -up, dither, window, to);
        } else {
            first_pass(x, Pair{1} << up, dither + minus_mean(chirps.sum[i], up), window, to);
        }
    };
    chirp(0, rows.data());
    chirp(1, &rows[kFftLength / 2]);
    share(rows);
    second_pass(rows, out);
}

#if DSP_PACKED_FOUR
void range_fft_pairs(std::span<const ChirpPair, kChirpPairs> pairs, const RangeWindow& window,
                     Complex16* out) {
    const int exponent = pairs[0].exponent;
    const int up = kHighestExponent - exponent;
    if (up >= 0 && std::ranges::all_of(pairs, [&](const ChirpPair& p) { return p.exponent == exponent; })) {
        Rows<Quad> rows;
        const auto chirp = [&](std::size_t i, Quad* to) {
            const auto dc = [&](std::size_t pair) {
                return static_cast<int>((pairs[pair].dither[i] << 16) + minus_mean(pairs[pair].sum[i], up));
            };
            first_pass(pairs[0].samples + kSamples * i, Pair{1} << up,
                       Quad(_mm_set_epi32(dc(3), dc(2), dc(1), dc(0))), window, to);
        };
        chirp(0, rows.data());
        chirp(1, &rows[kFftLength / 2]);
        share(rows);
        second_pass(rows, out);
        return;
    }
    for (const ChirpPair& pair : pairs) {
        range_fft(pair, window, out);
        out += 2;
    }
}
#endif

}  // namespace dsp
