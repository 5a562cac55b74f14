/// From reflectors to ADC codes: what the mixer, the filter and the converter of the front end deliver.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dsp/beat_frame.hpp"
#include "host_sim/random.hpp"
#include "host_sim/scenario.hpp"

namespace sim {

/// A point reflector as the antenna sees it during one frame.
struct Echo {
    double range_m = 0;         ///< at the start of the frame
    double range_rate_mps = 0;  ///< constant within the frame: R(t) = range + rate t
    double snr = 0;             ///< integrated, linear; see integrated_snr_db()
    double phase_cycles = 0;    ///< of the reflection itself
};

/// Integrated SNR of a reflector by the radar equation: the peak of the rectangular-window range-Doppler map
/// over the mean noise of a cell, scalloping excluded.
double integrated_snr_db(const FrontEnd& front_end, double rcs_dbsm, double range_m);

/// Amplitude at the converter of an echo with this integrated SNR (linear): a real tone of amplitude A makes
/// a peak of (A N / 2)^2 over a noise of N sigma^2, N = 64 x 64.
double amplitude_lsb(const FrontEnd& front_end, double integrated_snr);

class BeatSynthesis {
  public:
    BeatSynthesis(const dsp::Waveform& waveform, const FrontEnd& front_end, std::uint64_t seed);

    /// One frame. Phase of a reflector at sample n (time u = n/fs in the chirp) of chirp k (starting at k
    /// Tc): 2 pi [fc tau + S (tau - tau0)(u - T/2)], tau = 2 R(u + k Tc) / c, S the sweep rate, fc the centre
    /// of the sampled band, tau0 the delay of cell 0. Doppler, range migration within the frame and
    /// range-Doppler coupling all follow from it. An ideal filter removes what lies above the highest range
    /// cell. Then leakage, offset, bursts of interference, thermal noise, rounding and clipping to the
    /// converter's range.
    ///
    /// The frame depends on its arguments and the seed alone, bit for bit, on any machine. About 60 us plus 5
    /// us an echo with a range rate of its own; neighbours in the list with equal range rate share most of
    /// that.
    void synthesise(std::span<const Echo> echoes, std::span<const Interference> bursts,
                    std::uint64_t frame_index, dsp::BeatFrame& frame) const;

  private:
    void add_burst(const Interference& burst, Random& random, std::span<float> chirp) const;

    FrontEnd front_end_;
    std::uint64_t seed_;
    double carrier_hz_;
    double sweep_hz_per_s_;
    double sample_s_;
    double sampled_s_;
    double chirp_s_;
    double range_offset_m_;
};

}  // namespace sim
