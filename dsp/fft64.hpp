/// 64-point transforms of 16-bit data with an exponent for each transform (block floating point).
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace dsp {

/// Re and im next to each other, as packed 16-bit arithmetic wants them.
struct alignas(4) Complex16 {
    std::int16_t re = 0;
    std::int16_t im = 0;
    bool operator==(const Complex16&) const = default;
};
static_assert(sizeof(Complex16) == 4);

inline constexpr int kFftLength = 64;
using Spectrum64 = std::array<Complex16, kFftLength>;

/// Discrete Fourier transform in place: X[k] = sum_n x[n] exp(-j 2 pi n k / 64) = data[k] * 2^(returned
/// exponent). Natural order in and out.
///
/// Two passes of eight 8-point transforms. Everything between input and output is 32 bits wide with 9 extra
/// fraction bits, so nothing can overflow (growth at most 64 * sqrt 2) and the only rounding that matters is
/// the last one, half to even, to the exponent at which the largest component of this block takes `bits`
/// magnitude bits: the precision does not depend on the level of the input. 1 <= bits <= 15; the exponent is
/// -15..7 for 15 bits and one more for each bit less. All-zero input gives zeros and exponent -15.
int fft64(std::span<Complex16, kFftLength> data, int bits = 15);

/// Transforms two real sequences with one complex transform of z = a + j b: for the lower half of the cells
/// A[k] = (Z[k] + conj Z[64-k]) / 2, B[k] = (Z[k] - conj Z[64-k]) / 2j. z is overwritten.
/// A and B share the returned exponent. Exact but for the rounding inside fft64, which is asked for one bit
/// less so that the sums fit.
int fft64_real_pair(std::span<Complex16, kFftLength> z, std::span<Complex16, kFftLength / 2> a,
                    std::span<Complex16, kFftLength / 2> b);

}  // namespace dsp
