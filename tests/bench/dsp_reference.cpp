#include "tests/bench/dsp_reference.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bench {

namespace {

constexpr double kPi = std::numbers::pi;

void split_transform(std::array<Complex, 64>& x, std::size_t start, std::size_t stride, std::size_t length,
                     Complex* out) {
    if (length == 1) {
        out[0] = x[start];
        return;
    }
    const std::size_t half = length / 2;
    split_transform(x, start, 2 * stride, half, out);
    split_transform(x, start + stride, 2 * stride, half, out + half);
    static const std::array<Complex, 64> kRoots = [] {
        std::array<Complex, 64> roots;
        for (std::size_t i = 0; i < 64; ++i)
            roots[i] = std::polar(1.0, -2 * kPi * static_cast<double>(i) / 64);
        return roots;
    }();
    for (std::size_t k = 0; k < half; ++k) {
        const Complex even = out[k];
        const Complex odd = out[k + half] * kRoots[k * (64 / length)];
        out[k] = even + odd;
        out[k + half] = even - odd;
    }
}

}  // namespace

std::array<Complex, 64> dft64(const std::array<Complex, 64>& x) {
    std::array<Complex, 64> out{};
    for (std::size_t k = 0; k < 64; ++k) {
        for (std::size_t n = 0; n < 64; ++n) {
            out[k] += x[n] * std::polar(1.0, -2 * kPi * static_cast<double>(n * k % 64) / 64);
        }
    }
    return out;
}

std::array<Complex, 64> fft64(const std::array<Complex, 64>& x) {
    std::array<Complex, 64> copy = x;
    std::array<Complex, 64> out;
    split_transform(copy, 0, 1, 64, out.data());
    return out;
}

int scale_for_fft(std::span<dsp::Complex16, 64> data) {
    double largest = 1;
    double energy = 0;
    for (const dsp::Complex16 x : data) {
        const Complex value(x.re, x.im);
        largest = std::max({largest, std::abs(value.real()), std::abs(value.imag())});
        energy += std::norm(value);
    }
    int exponent = 0;
    const double top = std::ldexp(1.0, dsp::kFftInputBits);
    while (largest > top * std::ldexp(1.0, exponent)) ++exponent;
    while (largest <= top * std::ldexp(0.5, exponent)) --exponent;
    // |X|^2 <= 64 times the energy (Cauchy and Schwarz).
    if (std::sqrt(64 * energy) > std::ldexp(1.0, 15 + dsp::kFftExponent + exponent)) ++exponent;
    const auto scale = [exponent](std::int16_t x) {
        return static_cast<std::int16_t>(std::lrint(std::ldexp(x, -exponent)));
    };
    for (dsp::Complex16& x : data) x = {scale(x.re), scale(x.im)};
    return exponent;
}

std::vector<double> power_map(const dsp::BeatFrame& frame, dsp::WindowKind range, dsp::WindowKind doppler) {
    const dsp::Window& wr = dsp::window(range);
    const dsp::Window& wd = dsp::window(doppler);
    std::vector<std::array<Complex, 64>> rows(32);
    for (std::size_t k = 0; k < 64; ++k) {
        double mean = 0;
        for (const auto s : frame.chirp[k]) mean += s / 64.0;
        std::array<Complex, 64> x;
        for (std::size_t n = 0; n < 64; ++n) x[n] = (frame.chirp[k][n] - mean) * wr[n] / 32768.0;
        const auto spectrum = fft64(x);
        for (std::size_t r = 0; r < 32; ++r) rows[r][k] = spectrum[r] * (wd[k] / 32768.0);
    }
    std::vector<double> power;
    power.reserve(2048);
    for (const auto& row : rows) {
        for (const Complex& x : fft64(row)) power.push_back(std::norm(x));
    }
    return power;
}

void add_tone(Samples& samples, const Tone& tone, const dsp::Waveform& wave) {
    constexpr double kLight = static_cast<double>(dsp::Waveform::speed_of_light_mps);
    const double start_hz = static_cast<double>(wave.carrier_hz) - static_cast<double>(wave.bandwidth_hz) / 2;
    const double slope =
        static_cast<double>(wave.bandwidth_hz) / (static_cast<double>(wave.sampled_ns()) * 1e-9);
    const double interval = static_cast<double>(wave.chirp_interval_ns) * 1e-9;
    const double step = 1 / static_cast<double>(wave.sample_rate_hz);
    const double middle = 32 * interval;
    for (std::size_t k = 0; k < 64; ++k) {
        // The phase is a quadratic in t within a chirp, so a phasor turned by a turning phasor gives it.
        const auto phase = [&](double n) {
            const double t = n * step;
            const double now = static_cast<double>(k) * interval + t;
            const double range = tone.range_m - static_cast<double>(wave.range_offset_um) * 1e-6 +
                                 tone.range_rate_mps * (now - middle);
            const double cycles = 2 * range / kLight * (start_hz + slope * t);
            return 2 * kPi * (cycles - std::floor(cycles)) + tone.phase;
        };
        const double p0 = phase(0);
        const double p1 = phase(1);
        const double p2 = phase(2);
        Complex value = std::polar(tone.amplitude, p0);
        Complex turn = std::polar(1.0, p1 - p0);
        const Complex bend = std::polar(1.0, p2 - 2 * p1 + p0);
        for (std::size_t n = 0; n < 64; ++n) {
            samples[64 * k + n] += value.real();
            value *= turn;
            turn *= bend;
        }
    }
}

void add_noise(Samples& samples, double sigma, Random& random) {
    static std::array<double, 1 << 21> pool;
    static const bool filled = [] {
        Random seeded(20240229);
        std::normal_distribution<double> normal;
        for (double& x : pool) x = normal(seeded);
        return true;
    }();
    if (!filled) return;
    std::size_t at = random() % (pool.size() - samples.size());
    for (double& s : samples) s += sigma * pool[at++];
}

dsp::BeatFrame convert(const Samples& samples, double full_scale) {
    dsp::BeatFrame frame;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        frame.chirp[i / 64][i % 64] =
            static_cast<std::int16_t>(std::lrint(std::clamp(samples[i], -full_scale, full_scale)));
    }
    return frame;
}

double amplitude_for(double integrated_snr_db, double sigma) {
    return sigma * std::sqrt(std::pow(10, integrated_snr_db / 10) / 1024);
}

}  // namespace bench
