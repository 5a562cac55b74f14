#include "dsp/fft64.hpp"

#include <bit>

#include "dsp/packed.hpp"
#include "dsp/radix8.hpp"

namespace dsp {

namespace {

using namespace radix8;

/// Halving rounds down: the second pass takes a quarter of a step, on average, from what its second and third
/// level give. That is what impulses at its first two inputs would make of them, so these, negated, take the
/// bias away. For each n, quarters of a step of the first pass's result.
constexpr std::array<std::int32_t, 8> kBias{6, 2, 0, 0, 0, 0, 0, 0};

/// What the first pass needs for samples n, n + 8 .., in the order it is read; w(k) = exp(-j 2 pi n k / 64).
struct Column {
    Pair rounding;                           ///< of the rotations
    std::array<Pair, 3> even;                ///< w(4), w(2), w(6)
    std::array<std::array<Pair, 2>, 4> odd;  ///< w(k) and w(k) turned by k eighths, k = 1, 5, 3, 7
};

alignas(8) constexpr auto kColumns = [] {
    std::array<Column, 8> columns{};
    for (int n = 0; n < 8; ++n) {
        Column& column = columns[static_cast<std::size_t>(n)];
        column.rounding = static_cast<Pair>(kHalf + kBias[static_cast<std::size_t>(n)] * (1 << 14));
        column.even = {root(4 * n), root(2 * n), root(6 * n)};
        std::size_t i = 0;
        for (const int k : {1, 5, 3, 7}) column.odd[i++] = {root(n * k), root((n + 8) * k)};
    }
    return columns;
}();
constexpr Pair kOne = root(0);

/// `data`: Complex16 for one transform, Quad for four.
template <class Element>
inline void transform64(Element* data) {
    using namespace packed;
    using Word = decltype(load(*data));
    alignas(8) alignas(Word) std::array<Word, kFftLength> rows;  // [k][n]
    Word* to = rows.data();
    const Element* from = data;
    const Pair* factors = &kColumns[0].rounding;
    do {
        const auto x = [&from](std::size_t m) { return load(from[8 * m]); };
        const Word x0 = x(0);
        const Word x4 = x(4);
        const Word a0 = saturated_add(x0, x4);
        const Word a1 = saturated_sub(x0, x4);
        const Word x2 = x(2);
        const Word x6 = x(6);
        const Word a2 = saturated_add(x2, x6);
        const Word a3 = saturated_sub(x2, x6);
        const Word even0 = add(a0, a2);
        const Word even2 = sub(a0, a2);
        const Word even1 = sub_j(a1, a3);
        const Word even3 = add_j(a1, a3);
        const Word x1 = x(1);
        const Word x5 = x(5);
        const Word b0 = saturated_add(x1, x5);
        const Word b1 = saturated_sub(x1, x5);
        const Word x3 = x(3);
        const Word x7 = x(7);
        const Word b2 = saturated_add(x3, x7);
        const Word b3 = saturated_sub(x3, x7);
        const Word odd0 = add(b0, b2);
        const Word odd2 = sub(b0, b2);
        const Word odd1 = sub_j(b1, b3);
        const Word odd3 = add_j(b1, b3);
        ++from;
        Pair first = 0;
        Pair second = 0;
        take_pair(factors, first, second);
        const auto rounding = static_cast<std::int32_t>(first);
        const Word sum = saturated_add(even0, odd0);
        to[8 * 4] = rotate(saturated_sub(even0, odd0), second, rounding);
        to[0] = rotate(sum, kOne, rounding);
        take_pair(factors, first, second);
        to[8 * 2] = rotate(saturated_sub_j(even2, odd2), first, rounding);
        to[8 * 6] = rotate(saturated_add_j(even2, odd2), second, rounding);
        const auto rotate_sum = [&](Word even, Word odd) {
            Pair w = 0;
            Pair turned = 0;
            take_pair(factors, w, turned);
            return pack_high(dot_minus(odd, turned, dot_minus(even, w, rounding)),
                             dot_cross(odd, turned, dot_cross(even, w, rounding)));
        };
        to[8 * 1] = rotate_sum(even1, odd1);
        to[8 * 5] = rotate_sum(even1, odd1);
        to[8 * 3] = rotate_sum(even3, odd3);
        to[8 * 7] = rotate_sum(even3, odd3);
        ++to;
    } while (to != rows.data() + 8);
    const Word* row = rows.data();
    Element* out = data;
    do {
        const auto x = load_8(row);
        transform<Halving::second_and_third>([&x](std::size_t n) { return x[n]; },
                                             [out](std::size_t q, Word low, Word high) {
                                                 store(out[8 * q], low);
                                                 store(out[8 * q + 32], high);
                                             });
        row += 8;
        ++out;
    } while (row != rows.data() + kFftLength);
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
