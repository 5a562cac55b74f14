/// 64-point transform of windowed data in packed 16-bit arithmetic: what every frame runs 64 times.
#pragma once

#include <cstddef>
#include <span>

#include "dsp/fft64.hpp"

namespace dsp {

/// X[k] = sum_n x[n] exp(-j 2 pi n k / 64) = data[k] * 2^kTaperedExponent, in place, natural order in and
/// out.
///
/// Scaling and overflow: for x[n] = w[n] y[n] with the real and imaginary parts of y within +-2^14 and a
/// window that adds up to one over half its length, w[n] + w[n + 32] <= 1, as Hann and Blackman windows do.
/// No sum can then grow past 16 bits, |X[k]| <= 2^14.5 * 2^kTaperedExponent: the first of two passes of
/// 8-point transforms halves at its second and third level and in the twiddles, the second pass at its first
/// and second level. The twiddles are Q15 and round; the other halvings round down, and constants between
/// them take that bias off again. Noise at the output: 0.26 square steps in each part. Cost: about 1050
/// instructions.
inline constexpr int kTaperedExponent = 5;
void tapered_fft64(std::span<Complex16, kFftLength> data);

/// Two such real sequences with one transform of z = a + j b, which is overwritten: for the lower half of the
/// cells A[k] = (Z[k] + conj Z[64-k]) / 2 to ab[k * stride] and B[k] = (Z[k] - conj Z[64-k]) / 2j to the
/// element after it, both in units of 2^kTaperedPairExponent: the sums fit without the division by two.
inline constexpr int kTaperedPairExponent = kTaperedExponent - 1;
void tapered_fft64_real_pair(std::span<Complex16, kFftLength> z, Complex16* ab, std::size_t stride);

}  // namespace dsp
