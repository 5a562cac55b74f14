#include "host_sim/beat_synthesis.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_sim/portable_math.hpp"

namespace sim {

namespace {

constexpr double kLight_mps = static_cast<double>(dsp::Waveform::speed_of_light_mps);
constexpr std::size_t kSamples = dsp::kSamples;
constexpr std::size_t kChirps = dsp::kChirps;

enum Purpose : std::uint64_t { kNoise = 1, kBurst = 2 };

/// The analytic signal of one chirp, a lane a sample, so that stepping from chirp to chirp vectorises.
struct Lanes {
    std::array<float, kSamples> re;
    std::array<float, kSamples> im;
};

using Signal = std::array<std::array<float, kSamples>, kChirps>;

/// phase0 + n * step for each sample n, in cycles, as unit phasors times `scale`.
void fill(double phase0, double step, double scale, std::array<Phasor, kSamples>& out) {
    Phasor z = phasor(phase0);
    z = {z.re * scale, z.im * scale};
    const Phasor w = phasor(step);
    for (auto& p : out) {
        p = z;
        z = z * w;
    }
}

/// Adds the real part of `tone` to every chirp, turning each lane by `turn` from chirp to chirp.
void accumulate(Lanes tone, const Lanes& turn, Signal& signal) {
    for (auto& chirp : signal) {
        for (std::size_t n = 0; n < kSamples; ++n) {
            chirp[n] += tone.re[n];
            const float re = tone.re[n] * turn.re[n] - tone.im[n] * turn.im[n];
            tone.im[n] = tone.re[n] * turn.im[n] + tone.im[n] * turn.re[n];
            tone.re[n] = re;
        }
    }
}

Lanes to_lanes(const std::array<Phasor, kSamples>& in) {
    Lanes out;
    for (std::size_t n = 0; n < kSamples; ++n) {
        out.re[n] = static_cast<float>(in[n].re);
        out.im[n] = static_cast<float>(in[n].im);
    }
    return out;
}

}  // namespace

double integrated_snr_db(const FrontEnd& front_end, double rcs_dbsm, double range_m) {
    return front_end.reference_snr_db + (rcs_dbsm - 10) - 4 * db_from_power(std::max(range_m, 0.1) / 100);
}

double amplitude_lsb(const FrontEnd& front_end, double integrated_snr) {
    return front_end.noise_lsb * std::sqrt(4 * integrated_snr / (kSamples * kChirps));
}

BeatSynthesis::BeatSynthesis(const dsp::Waveform& waveform, const FrontEnd& front_end, std::uint64_t seed)
    : front_end_(front_end),
      seed_(seed),
      carrier_hz_(static_cast<double>(waveform.carrier_hz)),
      sweep_hz_per_s_(static_cast<double>(waveform.bandwidth_hz) /
                      (kSamples / static_cast<double>(waveform.sample_rate_hz))),
      sample_s_(1 / static_cast<double>(waveform.sample_rate_hz)),
      sampled_s_(kSamples * sample_s_),
      chirp_s_(static_cast<double>(waveform.chirp_interval_ns) * 1e-9),
      range_offset_m_(static_cast<double>(waveform.range_offset_um) * 1e-6) {}

void BeatSynthesis::synthesise(std::span<const Echo> echoes, std::span<const Interference> bursts,
                               std::uint64_t frame_index, dsp::BeatFrame& frame) const {
    alignas(64) Signal signal{};
    std::array<Phasor, kSamples> tone{};
    std::array<Phasor, kSamples> part{};

    const auto add_echo = [&](double range_m, double rate_mps, double amplitude, double phase) {
        const double tau = 2 * range_m / kLight_mps;
        const double swept = sweep_hz_per_s_ * (tau - 2 * range_offset_m_ / kLight_mps);
        const double doppler_hz = carrier_hz_ * 2 * rate_mps / kLight_mps;
        if (swept + doppler_hz >= 0.5 / sample_s_) return;
        // The sweep moves on by S (2 v / c) u within the chirp as well: below 2e-4 cycles over a chirp at 30
        // m/s.
        fill(carrier_hz_ * tau - swept * sampled_s_ / 2 + phase, (swept + doppler_hz) * sample_s_, amplitude,
             part);
        for (std::size_t n = 0; n < kSamples; ++n) {
            tone[n].re += part[n].re;
            tone[n].im += part[n].im;
        }
    };
    for (std::size_t i = 0; i < echoes.size();) {
        const double rate = echoes[i].range_rate_mps;
        tone.fill({});
        for (; i < echoes.size() && echoes[i].range_rate_mps == rate; ++i) {
            add_echo(echoes[i].range_m, rate, amplitude_lsb(front_end_, echoes[i].snr),
                     echoes[i].phase_cycles);
        }
        const double per_chirp = 2 * rate * chirp_s_ / kLight_mps;
        std::array<Phasor, kSamples> turn{};
        fill(per_chirp * (carrier_hz_ - sweep_hz_per_s_ * sampled_s_ / 2),
             per_chirp * sweep_hz_per_s_ * sample_s_, 1, turn);
        accumulate(to_lanes(tone), to_lanes(turn), signal);
    }

    // Leakage comes over a fixed path: the same in every chirp.
    std::array<Phasor, kSamples> leakage{};
    fill(0.125, sweep_hz_per_s_ * 2 * front_end_.leakage_range_m / kLight_mps * sample_s_,
         front_end_.leakage_lsb, leakage);
    for (auto& chirp : signal)
        for (std::size_t n = 0; n < kSamples; ++n)
            chirp[n] += static_cast<float>(leakage[n].re + front_end_.offset_lsb);

    for (std::size_t b = 0; b < bursts.size(); ++b) {
        Random random(seed_, kBurst + (b << 8), frame_index);
        for (auto& chirp : signal)
            if (random.uniform() < bursts[b].chirp_share) add_burst(bursts[b], random, chirp);
    }

    Random noise(seed_, kNoise, frame_index);
    for (auto& chirp : signal) noise.add_noise(chirp, static_cast<float>(front_end_.noise_lsb));

    const auto half = static_cast<float>(1 << (front_end_.adc_bits - 1));
    for (std::size_t k = 0; k < kChirps; ++k) {
        for (std::size_t n = 0; n < kSamples; ++n) {
            // Shifted to be positive, so that truncation rounds down.
            const float shifted = std::clamp(signal[k][n], -half, half - 1) + half + 0.5F;
            frame.chirp[k][n] = static_cast<std::int16_t>(static_cast<int>(shifted) - static_cast<int>(half));
        }
    }
}

void BeatSynthesis::add_burst(const Interference& burst, Random& random, std::span<float> chirp) const {
    // The interferer sweeps through the receiver's band, from -fs/2 to +fs/2, while the burst lasts.
    const double length_s = burst.burst_us * 1e-6;
    const double start_s = random.uniform() * sampled_s_ - length_s / 2;
    const double phase = random.uniform();
    const double sweep = 1 / (sample_s_ * length_s);
    for (std::size_t n = 0; n < chirp.size(); ++n) {
        const double u = static_cast<double>(n) * sample_s_ - start_s;
        if (u < 0 || u >= length_s) continue;
        const double from_centre = u - length_s / 2;
        chirp[n] += static_cast<float>(burst.amplitude_lsb *
                                       phasor(phase + sweep * from_centre * from_centre / 2).re);
    }
}

}  // namespace sim
