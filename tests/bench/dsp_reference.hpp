/// The signal processing in double precision and its synthetic input, to measure the fixed-point one against.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "dsp/beat_frame.hpp"
#include "dsp/fft64.hpp"
#include "dsp/waveform.hpp"
#include "dsp/window.hpp"

namespace bench {

using Random = std::mt19937_64;
using Complex = std::complex<double>;
using Samples = std::vector<double>;  ///< 4096 converter inputs, [chirp][sample], in codes before rounding

/// exp(-j 2 pi n k / 64), straight from the definition.
std::array<Complex, 64> dft64(const std::array<Complex, 64>& x);
/// The same by a recursive split, for maps; tested against dft64 by the caller's results.
std::array<Complex, 64> fft64(const std::array<Complex, 64>& x);

/// Block floating point as the windows' stages do it, for data without a window: scales to
/// dsp::kFftInputBits, rounding half to even, and one bit less where the block's energy could make a cell
/// clip. Returns the exponent of the input.
int scale_for_fft(std::span<dsp::Complex16, 64> data);

/// log2 |X|^2 of the whole chain (mean removal, windows as make_window gives them, both transforms), 32 x 64,
/// as linear power in squared codes.
std::vector<double> power_map(const dsp::BeatFrame& frame, dsp::WindowKind range, dsp::WindowKind doppler);

struct Tone {
    double range_m = 0;         ///< in the middle of the frame
    double range_rate_mps = 0;  ///< positive receding
    double amplitude = 0;       ///< codes
    double phase = 0;           ///< radians
};

/// Adds the echo of a point target: phase 2 pi tau f(t), tau = 2 R(t)/c, f the swept frequency at that
/// instant and R(t) moving through the whole frame, sample by sample.
void add_tone(Samples& samples, const Tone& tone, const dsp::Waveform& wave = dsp::kDefaultWaveform);

/// White Gaussian samples, from a pool that is made once (a random stretch of it, so cheap).
void add_noise(Samples& samples, double sigma, Random& random);

/// Rounds to codes and clips to +-full_scale.
dsp::BeatFrame convert(const Samples& samples, double full_scale = 32767);

/// Amplitude of a tone whose integrated SNR (rectangular-window peak over the mean noise of a cell) is as
/// given: |A/2 * 4096|^2 / (4096 sigma^2).
double amplitude_for(double integrated_snr_db, double sigma);

}  // namespace bench
