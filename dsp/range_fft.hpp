/// DC removal, window and transform of real chirps.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "dsp/fft64.hpp"
#include "dsp/packed.hpp"
#include "dsp/window.hpp"

namespace dsp {

/// A window for chirps of one scale, as range_fft takes it. Cost: about 450 instructions.
class RangeWindow {
  public:
    /// `window`: any of WindowKind. `exponent`: (sample - mean) / 2^exponent is within +-2^kFftInputBits;
    /// -11..5.
    RangeWindow(const Window& window, int exponent);

    /// Chirps of a higher exponent are scaled down first.
    static constexpr int kHighestExponent = 2;
    [[nodiscard]] int exponent() const { return exponent_; }

    // What follows is for range_fft, each table in the order it is read.

    /// w and w turned by k eighths of a circle, Q15: both real parts, both imaginary parts, one of them
    /// negated.
    struct Turn {
        packed::Pair re;
        packed::Pair im;
        packed::Pair minus;
    };
    /// What turns results 1, 2 and 3 of the first pass by w = exp(-j 2 pi n k / 64) / 2, in two columns n.
    struct Turns {
        std::array<packed::Pair, 2> second;  ///< w
        std::array<Turn, 2> first;           ///< minus: re
        std::array<Turn, 2> third;           ///< minus: im
    };
    /// What the first pass needs for columns n and n + 1 of 8, n even.
    struct Columns {
        /// w[n] 2^(2 - exponent), Q15, of both, the second negated, in rows 0, 1, 4, 5, 2, 3, 6, 7: the upper
        /// 32 of 48 bits of a product with a sample are a deviation of kFftInputBits + 1 bits.
        std::array<std::int32_t, 16> weight;
        Turns turns;
    };
    /// What the second pass needs.
    struct SecondPass {
        packed::Pair mean0;  ///< what a mean of -1/64 adds to the real part of cell 0, in units of 2^-16
        packed::Pair mean1;  ///< what one of 1/64 adds to that of cell 1
        packed::Pair root1;  ///< exp(-j 2 pi n / 16) / 2, n = 1, 2, 3, Q15; odd n negative
        packed::Pair root2;
        packed::Pair root3;
        packed::Pair unused;
        packed::Pair plus;  ///< a fourth and its product with cos 45 degrees
        packed::Pair minus;
        packed::Pair mean2;  ///< and of cell 2
    };
    [[nodiscard]] const packed::Pair* table() const { return reinterpret_cast<const packed::Pair*>(&table_); }

  private:
    struct Table {
        std::array<Columns, 4> columns;
        SecondPass second_pass;
    };
    alignas(8) Table table_;
    int exponent_;
};

/// X[k] = sum_n w[n] (x[n] - mean) exp(-j 2 pi n k / 64) of each chirp for k = 0..31, to out[64 k], that of
/// the next chirp to the element after it: columns of a matrix with rows of 64. X = out * 2^(exponent +
/// kRangeFftExponent). `chirps`: 64 samples each, next to each other, aligned to four bytes. `sums`: of the
/// samples of each, 64 times its mean.
///
/// A real transform of two passes, 8 x 8, in packed 16-bit arithmetic: the first over samples 8 apart, in
/// eight columns. Its results 0 and 4 are real, and shorter second passes give cells 8 i and 4 + 8 i; those
/// of 1, 2 and 3 give the other cells, half of them conjugated.
///
/// Overflow: none for a window that adds up to at most one over half its length, w[n] + w[n + 32] <= 1, as
/// Hann and Blackman windows do; others need an exponent one higher. Parts of a cell that reach 2^15 clip:
/// only a square wave at half the sampling rate does. Noise at the output: 0.28 square steps in each part;
/// bias below 0.1. The mean is exact. Cost: about 660 instructions a chirp; 1,000 more for exponents above
/// kHighestExponent. On a PC four chirps at once, with the same bits.
inline constexpr int kRangeFftExponent = 2;
void range_fft(const std::int16_t* chirps, std::span<const std::int32_t> sums, const RangeWindow& window,
               Complex16* out);

}  // namespace dsp
