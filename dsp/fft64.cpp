#include "dsp/fft64.hpp"

#include <bit>

#include "dsp/packed.hpp"
#include "dsp/radix8.hpp"

namespace dsp {

namespace {

using namespace radix8;

/// Halving rounds down: the second pass takes a quarter of a step, on average, from what its second and third
/// level give. That is what impulses at three of its inputs would make of them, so these, negated, take the
/// bias away. For each n, quarters of a step of the first pass's result.
constexpr std::array<std::int32_t, 8> kBias{6, 1, 0, 0, 0, 1, 0, 0};

/// What the first pass needs for samples n, n + 8 .. but those of n = 0, in the order it is read; w(k) =
/// exp(-j 2 pi n k / 64).
struct Column {
    Pair rounding;                           ///< of the rotations; an odd number ends the loop
    std::array<Pair, 3> even;                ///< w(4), w(2), w(6)
    std::array<std::array<Pair, 2>, 4> odd;  ///< w(k) and w(k) turned by k eighths, k = 1, 5, 3, 7
};

alignas(8) constexpr auto kColumns = [] {
    std::array<Column, 7> columns{};
    for (int n = 1; n < 8; ++n) {
        Column& column = columns[static_cast<std::size_t>(n - 1)];
        column.rounding = static_cast<Pair>(kHalf + kBias[static_cast<std::size_t>(n)] * (1 << 14) + n / 7);
        column.even = {root(4 * n), root(2 * n), root(6 * n)};
        std::size_t i = 0;
        for (const int k : {1, 5, 3, 7}) column.odd[i++] = {root(n * k), root((n + 8) * k)};
    }
    return columns;
}();
constexpr Pair kOne = root(0);

/// First level of an 8-point transform: sums and differences of inputs 0 and 4, 2 and 6 (a), 1 and 5, 3 and 7
/// (b).
template <class Word>
struct FirstLevel {
    Word a0, a1, a2, a3;
    Word b0, b1, b2, b3;
};
template <class Load>
inline auto first_level(Load x) {
    using namespace packed;
    const auto x0 = x(0);
    const auto x4 = x(4);
    const auto a0 = saturated_add(x0, x4);
    const auto a1 = saturated_sub(x0, x4);
    const auto x2 = x(2);
    const auto x6 = x(6);
    const auto a2 = saturated_add(x2, x6);
    const auto a3 = saturated_sub(x2, x6);
    const auto x1 = x(1);
    const auto x5 = x(5);
    const auto b0 = saturated_add(x1, x5);
    const auto b1 = saturated_sub(x1, x5);
    const auto x3 = x(3);
    const auto x7 = x(7);
    return FirstLevel<decltype(x(0))>{a0, a1, a2, a3, b0, b1, saturated_add(x3, x7), saturated_sub(x3, x7)};
}

template <class Word>
struct Turned {
    Word by1;
    Word by3;
};

/// b1 - j b3 turned by one eighth and b1 + j b3 turned by one eighth (and a quarter, which the caller's sums
/// add), halved. The parts of both are sums of b1's and b3's parts with all signs, which are products with
/// one word; those of b1 serve both, and nothing is rounded before the end.
template <class Word>
inline Turned<Word> eighths(Word b1, Word b3, Pair eighth, std::int32_t half) {
    using namespace packed;
    const auto re = dot_minus(b1, eighth, half);
    const auto im = dot_cross(b1, eighth, half);
    return {pack_high(dot_cross(b3, eighth, re), dot_cross_minus(b3, eighth, im)),
            pack_high(dot(b3, eighth, re), dot_minus(b3, eighth, im))};
}

/// The first pass's column 0, whose w are all one: sums are halved, 25 instructions less than by products.
/// Halving takes a quarter of a step from sums, on average, and kBias asks for six quarters more: together
/// seven halves of a step of the first input, which gets three or four, by the lowest bits of `random`. Those
/// of the samples would not do, a block that was scaled up has none.
template <class Element, class Word>
inline void first_column(const Element* from, Word random, Pair eighth, std::int32_t half, Word* to) {
    using namespace packed;
    static_assert(kBias[0] == 6);
    const auto [a0, a1, a2, a3, b0, b1, b2, b3] = first_level([from, random](std::size_t m) {
        const Word x = load(from[8 * m]);
        return m == 0 ? add(x, add(random & both(1), both(3))) : x;
    });
    const Word even0 = add(a0, a2);
    const Word even2 = sub(a0, a2);
    const Word even1 = half_sub_j(a1, a3);
    const Word even3 = half_add_j(a1, a3);
    const Word odd0 = add(b0, b2);
    const Word odd2 = sub(b0, b2);
    to[8 * 0] = half_add(even0, odd0);
    to[8 * 4] = half_sub(even0, odd0);
    to[8 * 2] = half_sub_j(even2, odd2);
    to[8 * 6] = half_add_j(even2, odd2);
    const Turned<Word> odd = eighths(b1, b3, eighth, half);
    to[8 * 1] = add(even1, odd.by1);
    to[8 * 5] = sub(even1, odd.by1);
    to[8 * 3] = sub_j(even3, odd.by3);
    to[8 * 7] = add_j(even3, odd.by3);
}

/// `data`: Complex16 for one transform, Quad for four.
template <class Element>
inline void transform64(Element* data) {
    using namespace packed;
    using Word = decltype(load(*data));
    alignas(8) alignas(Word) std::array<Word, kFftLength> rows;  // [k][n]
    Word* to = rows.data();
    const Element* from = data;
    const Pair* factors = &kColumns[0].rounding;
    std::int32_t rounding = 0;
    Word last;
    do {  // columns 1 to 7, then 0, which wants something random and shares constants with the second pass
        ++from;
        ++to;
        const auto x = [&from](std::size_t m) { return load(from[8 * m]); };
        const auto [a0, a1, a2, a3, b0, b1, b2, b3] = first_level(x);
        const Word even0 = add(a0, a2);
        const Word even2 = sub(a0, a2);
        const Word even1 = sub_j(a1, a3);
        const Word even3 = add_j(a1, a3);
        const Word odd0 = add(b0, b2);
        const Word odd2 = sub(b0, b2);
        const Word odd1 = sub_j(b1, b3);
        const Word odd3 = add_j(b1, b3);
        Pair first = 0;
        Pair second = 0;
        Pair third = 0;
        Pair fourth = 0;
        take_pair(factors, first, second);
        rounding = static_cast<std::int32_t>(first);
        const Word sum = saturated_add(even0, odd0);
        to[8 * 4] = rotate(saturated_sub(even0, odd0), second, rounding);
        to[0] = rotate(sum, kOne, rounding);
        take_pair(factors, first, second);
        to[8 * 2] = rotate(saturated_sub_j(even2, odd2), first, rounding);
        to[8 * 6] = rotate(saturated_add_j(even2, odd2), second, rounding);
        const auto rotate_sum = [rounding](Word even, Word odd, Pair w, Pair turned) {
            return pack_high(dot_minus(odd, turned, dot_minus(even, w, rounding)),
                             dot_cross(odd, turned, dot_cross(even, w, rounding)));
        };
        take_four(factors, first, second, third, fourth);
        to[8 * 1] = rotate_sum(even1, odd1, first, second);
        to[8 * 5] = rotate_sum(even1, odd1, third, fourth);
        take_four(factors, first, second, third, fourth);
        to[8 * 3] = rotate_sum(even3, odd3, first, second);
        last = rotate_sum(even3, odd3, third, fourth);
        to[8 * 7] = last;
    } while (rounding % 2 == 0);
    const Pair eighth = in_register(kEighth);
    const std::int32_t half = in_register(kHalf);
    first_column(data, last, eighth, half, rows.data());
    const Word* row = rows.data();
    Element* out = data;
    const Element* const end = in_register(data + 8);
    do {
        const auto x = take_8(row);
        const auto [a0, a1, a2, a3, b0, b1, b2, b3] = first_level([&x](std::size_t n) { return x[n]; });
        const Word even0 = half_add(a0, a2);
        const Word even2 = half_sub(a0, a2);
        const Word even1 = half_sub_j(a1, a3);
        const Word even3 = half_add_j(a1, a3);
        const Word odd0 = half_add(b0, b2);
        const Word odd2 = half_sub(b0, b2);
        store(*out++, half_add(even0, odd0));
        store(out[8 * 4 - 1], half_sub(even0, odd0));
        store(out[8 * 2 - 1], half_sub_j(even2, odd2));
        store(out[8 * 6 - 1], half_add_j(even2, odd2));
        const Turned<Word> odd = eighths(b1, b3, eighth, half);
        store(out[8 * 1 - 1], half_add(even1, odd.by1));
        store(out[8 * 5 - 1], half_sub(even1, odd.by1));
        store(out[8 * 3 - 1], half_sub_j(even3, odd.by3));
        store(out[8 * 7 - 1], half_add_j(even3, odd.by3));
    } while (out != end);
}

}  // namespace

void fft64(std::span<Complex16, kFftLength> data) {
    transform64(data.data());
}

#if DSP_PACKED_FOUR
void fft64_rows(std::span<Spectrum64, kFftRows> rows) {
    std::array<packed::Quad, kFftLength> columns;
    for (std::size_t n = 0; n < kFftLength; n += 4) {
        packed::load_transposed(&rows[0][n], kFftLength, &columns[n]);
    }
    transform64(columns.data());
    for (std::size_t n = 0; n < kFftLength; n += 4) {
        packed::store_transposed(&columns[n], &rows[0][n], kFftLength);
    }
}
#endif

}  // namespace dsp
