/// Beat frame to range-Doppler map: window and transform along range, then along the chirps, then log-power.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "dsp/dc_removal.hpp"
#include "dsp/fft64.hpp"
#include "dsp/window.hpp"

namespace dsp {

/// Range spectra of all chirps, one row a range cell, so that the second transform walks memory forward.
struct RangeSpectra {
    std::array<std::array<Complex16, kChirps>, kRangeCells> row;
    /// Of chirps 2i and 2i+1: value = row * 2^exponent, in converter codes. A burst of interference costs
    /// precision only in the chirps it hits.
    std::array<std::int8_t, kChirps / 2> exponent;
};

/// log2 of the power of each cell, Q6.10: log2 |sum of w x exp(..)|^2 over the windowed samples in converter
/// codes. One absolute scale for the whole map and for every frame: exponents only add to a logarithm, so no
/// cell loses precision to a stronger one in another row. Powers below one read 0; the largest possible is
/// 54.0.
struct PowerMap {
    std::array<std::array<std::uint16_t, kDopplerCells>, kRangeCells> cell;  ///< Doppler cell 0: standstill
};

/// DC removal, window and range transform, two chirps at a time. The window is Q15.
void range_transform(const BeatFrame& frame, const DcLevels& levels, const Window& window,
                     RangeSpectra& spectra);

/// Window and transform over the chirps of one range cell, log-power of the result. Each row has its own
/// exponent, from its own largest sample.
void doppler_transform(const RangeSpectra& spectra, const Window& window, int range_cell,
                       std::span<std::uint16_t, kDopplerCells> log_power);

/// All of it.
void range_doppler(const BeatFrame& frame, WindowKind range_window, WindowKind doppler_window,
                   RangeSpectra& spectra, PowerMap& map);

}  // namespace dsp
