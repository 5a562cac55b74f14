/// Beat frame to range-Doppler map: window and transform along range, then along the chirps, then log-power.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "dsp/dc_levels.hpp"
#include "dsp/fft64.hpp"
#include "dsp/window.hpp"

namespace dsp {

/// Spectra with one row a range cell, so that the second transform walks memory forward. First of range for
/// each chirp, [range][chirp]; the second transform replaces each row in place by [range][Doppler].
struct Spectrum {
    std::array<std::array<Complex16, kChirps>, kRangeCells> row;
    /// Of chirps 2i and 2i+1 before the second transform: value = row * 2^exponent, in converter codes. A
    /// burst of interference costs precision only in the chirps it hits.
    std::array<std::int16_t, kChirps / 2> chirp_exponent;
    std::array<std::int16_t, kRangeCells> row_exponent;  ///< of each row after the second transform
};

/// log2 of the power of each cell, Q6.10: log2 |sum of w x exp(..)|^2 over the windowed samples in converter
/// codes. One absolute scale for the whole map and for every frame: exponents only add to a logarithm, so no
/// cell loses precision to a stronger one in another row. Powers below one read 0; the largest possible is
/// 54.0.
struct PowerMap {
    alignas(4) std::array<std::array<std::uint16_t, kDopplerCells>,
                          kRangeCells> cell;  ///< Doppler cell 0: standstill

    /// Doppler cells repeat every kDopplerCells.
    [[nodiscard]] constexpr std::uint16_t at(int range, int doppler) const {
        return cell[static_cast<std::size_t>(range)]
                   [static_cast<std::size_t>(doppler) & (std::size_t{kDopplerCells} - 1)];
    }
};

/// DC removal, window and range transform; see range_fft. The window is Q15. Windowed deviations have 13 bits
/// (12 for windows that add up to more than one over half their length), the spectrum 15.
void range_transform(const BeatFrame& frame, const DcLevels& levels, const Window& window,
                     Spectrum& spectrum);

/// The window over the chirps of one frame, whose chirps may have different exponents.
class ChirpTaper {
  public:
    /// `exponent`: of chirps 2i and 2i+1, at most 15 apart.
    ChirpTaper(const Window& window, const std::array<std::int16_t, kChirps / 2>& exponent);

    /// Applies it in place, rounded down, and returns the row's exponent: the largest number of the row gets
    /// kFftInputBits, or one less for windows that add up to more than one over half their length.
    int apply(std::array<Complex16, kChirps>& row) const;

  private:
    using Weights = std::array<std::int32_t, kChirps>;
    static constexpr std::size_t kScaled = 4;
    static constexpr int kNone = 1 << 15;

    Weights weight_;  ///< Q31: window * 2^(exponent - highest)
    /// A frame needs some five, mostly neighbours, and most rows one that a row shortly before needed: each
    /// at down modulo kScaled.
    mutable std::array<Weights, kScaled> scaled_;
    mutable std::array<int, kScaled> scaled_down_{kNone, kNone, kNone, kNone};
    std::array<std::uint8_t, kChirps / 2> smaller_;  ///< highest - exponent
    int highest_;
    int guard_;
    bool even_;  ///< all exponents equal
};

/// Window and transform over the chirps of kFftRows range cells (one, on a board), in place. Each row has its
/// own exponent, from its own largest sample.
void doppler_transform(Spectrum& spectrum, const ChirpTaper& taper, int first_range_cell);

/// One row of the map from one row of the spectrum. By log2_coarse_q10.
void log_power(std::span<const Complex16, kDopplerCells> row, int exponent,
               std::span<std::uint16_t, kDopplerCells> power);

/// All of it. `levels`: of this frame, by inspect().
void range_doppler(const BeatFrame& frame, const DcLevels& levels, WindowKind range_window,
                   WindowKind doppler_window, Spectrum& spectrum, PowerMap& map);

/// The same for a frame whose quality nobody asks for.
void range_doppler(const BeatFrame& frame, WindowKind range_window, WindowKind doppler_window,
                   Spectrum& spectrum, PowerMap& map);

}  // namespace dsp
