/// DC removal, window and transform of two real chirps in one go.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "dsp/fft64.hpp"
#include "dsp/packed.hpp"
#include "dsp/window.hpp"

namespace dsp {

/// A window as the first level of butterflies takes it.
class RangeWindow {
  public:
    explicit RangeWindow(const Window& window);

    /// What the first pass needs for samples n, n + 8 .., in the order it is read.
    struct Column {
        /// (w[n + 8 m], w[n + 8 m + 32]), Q14, for m = 0, 2, 1, 3, the last two followed by themselves times
        /// cos 45 degrees
        std::array<packed::Pair, 6> weight;
        std::array<packed::Pair, 3> root;  ///< exp(-j 2 pi n k / 64), Q15, for k = 1, 3, 2
        packed::Pair rounding;             ///< of the products with them
    };
    [[nodiscard]] const Column* columns() const { return columns_.data(); }

  private:
    alignas(8) std::array<Column, 8> columns_{};
};

/// Two chirps next to each other in memory, and what their DC removal needs.
struct ChirpPair {
    const std::int16_t* samples;         ///< 2 x 64
    std::array<std::int32_t, 2> sum;     ///< of each chirp's samples: 64 times its mean
    int exponent;                        ///< (sample - mean) / 2^exponent is within +-2^kFftInputBits; -11..5
    std::array<packed::Pair, 2> dither;  ///< 0 or 1: sign of each chirp's bias, see below
};

/// X[k] = sum_n w[n] (x[n] - mean) exp(-j 2 pi n k / 64) of both chirps for k = 0..31, to out[64 k] and
/// out[64 k + 1]: two columns of a matrix with rows of 64. X = out * 2^(exponent + kRangeFftExponent).
///
/// A real transform of two passes, 8 x 8, in packed 16-bit arithmetic. The first takes samples n and n + 32
/// in one word: two dual products are window and first level of butterflies. Cells 8 i and 4 + 8 i of the
/// two chirps then share one complex transform, the others have their own.
///
/// Overflow: none for a window that adds up to at most one over half its length, w[n] + w[n + 32] <= 1, as
/// Hann and Blackman windows do; others need an exponent one higher. Parts of a cell that reach 2^15 clip:
/// only a square wave at half the sampling rate does. Noise at the output: 0.45 square steps in each part.
/// Bias: one in each of the samples 32..63, a quarter of a step before the window, whose sign is set by
/// dither, half a step in cell 0 and less than the noise in the next four; otherwise below 0.1.
/// The mean is rounded to a quarter of a step. Cost: about 830 instructions a chirp, more for exponents
/// above 2.
inline constexpr int kRangeFftExponent = 2;
void range_fft(const ChirpPair& chirps, const RangeWindow& window, Complex16* out);

/// As many pairs at once as the machine's words hold, with the same bits, to columns next to each other: one
/// on a board, four on a PC. The chirps of all pairs are next to each other in memory.
inline constexpr std::size_t kChirpPairs = DSP_PACKED_FOUR ? 4 : 1;
#if DSP_PACKED_FOUR
void range_fft_pairs(std::span<const ChirpPair, kChirpPairs> pairs, const RangeWindow& window,
                     Complex16* out);
#else
inline void range_fft_pairs(std::span<const ChirpPair, kChirpPairs> pairs, const RangeWindow& window,
                            Complex16* out) {
    range_fft(pairs[0], window, out);
}
#endif

}  // namespace dsp
