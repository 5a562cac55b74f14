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

}  // namespace

void fft64(std::span<Complex16, kFftLength> data) {
    alignas(8) std::array<Pair, kFftLength> work;  // [n][i], i as in Column
    Pair* to = work.data();
    const Complex16* from = data.data();
    for (const Column& column : kColumns) {
        transform<Halving::none>([from](std::size_t m) { return load(from[8 * m]); },
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
            transform<Halving::second_and_third>([row = &work[2 * k + half]](std::size_t n) { return row[8 * n]; },
                         [out](std::size_t q, Pair low, Pair high) {
                             out[8 * q] = std::bit_cast<Complex16>(low);
                             out[8 * q + 32] = std::bit_cast<Complex16>(high);
                         });
        }
    }
}

}  // namespace dsp
