/// 64-point transform in packed 16-bit arithmetic: what every frame runs 64 times.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dsp/packed_x86.hpp"

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

/// Bits of the input, before a window, that just fill the 16 bits of the output.
inline constexpr int kFftInputBits = 12;

/// X[k] = sum_n x[n] exp(-j 2 pi n k / 64) = data[k] * 2^kFftExponent, in place, natural order in and out.
/// Block floating point is completed by the caller, who scales a block to kFftInputBits while it applies a
/// window.
///
/// Scaling and overflow: nothing can overflow for |x[n]| <= 2^12, nor for x[n] = w[n] y[n] with the real and
/// imaginary parts of y within +-2^12 and a window that adds up to one over half its length, w[n] + w[n + 32]
/// <= 1, as Hann and Blackman windows do; |X[k]| is then below 2^14.5 * 2^kFftExponent. Without a window,
/// corners of a square of +-2^12 clip where many of them add up. The first of two passes of 8-point
/// transforms halves in the twiddles, the second at its second and third level. Twiddles are Q15 and round,
/// one rounding for the turn by 45 degrees and the twiddle of odd results together; the other halvings round
/// down, and constants added with the twiddles take that bias off again. Noise at the output: 0.15 square
/// steps in each part, no bias. Cost: about 920 instructions.
inline constexpr int kFftExponent = 3;
void fft64(std::span<Complex16, kFftLength> data);

/// As many at once as the machine's words hold, with the same bits: one on a board, four on a PC.
inline constexpr std::size_t kFftRows = DSP_PACKED_FOUR ? 4 : 1;
#if DSP_PACKED_FOUR
void fft64_rows(std::span<Spectrum64, kFftRows> rows);
#else
inline void fft64_rows(std::span<Spectrum64, kFftRows> rows) {
    fft64(rows[0]);
}
#endif

}  // namespace dsp
