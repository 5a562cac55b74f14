// Against the phase written out for every sample in long double, and against closed forms of signal and noise
// power.
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <vector>

#include "dsp/waveform.hpp"
#include "host_sim/beat_synthesis.hpp"

#include <CppUTest/TestHarness.h>

namespace {

sim::FrontEnd clean_front_end() {
    sim::FrontEnd f;
    f.adc_bits = 16;
    f.noise_lsb = 0.01;
    f.offset_lsb = 0;
    f.leakage_lsb = 0;
    return f;
}

/// The integrated SNR that makes an amplitude.
double snr_for(const sim::FrontEnd& f, double amplitude) {
    return 1024 * std::pow(amplitude / f.noise_lsb, 2);
}

/// Lee and Kim 2000's waveform, every figure written out: R(t) = R + v t at each sample, round trip delay,
/// mixer.
long double beat(double range_m, double rate_mps, int chirp, int sample) {
    const auto range = static_cast<long double>(range_m);
    const auto rate = static_cast<long double>(rate_mps);
    constexpr long double kLight = 299792458.0L;
    const long double sweep = 30e6L / 32e-6L;
    const long double u = sample / 2e6L;
    const long double tau = 2 * (range + rate * (u + chirp * 32e-6L)) / kLight;
    const long double cycles = 77e9L * tau + sweep * tau * (u - 16e-6L);
    return std::cos(2 * std::numbers::pi_v<long double> * (cycles - std::floor(cycles)));
}

double power_at(const dsp::BeatFrame& frame, double range_cell, double doppler_cell) {
    std::complex<double> sum = 0;
    for (int k = 0; k < 64; ++k)
        for (int n = 0; n < 64; ++n)
            sum += double(frame.chirp[std::size_t(k)][std::size_t(n)]) *
                   std::polar(1.0, -2 * std::numbers::pi * (range_cell * n + doppler_cell * k) / 64);
    return std::norm(sum);
}

}  // namespace

TEST_GROUP(BeatSynthesis) {
    dsp::BeatFrame frame;
};

TEST(BeatSynthesis, EverySampleHasThePhaseOfTheRoundTrip) {
    const sim::FrontEnd f = clean_front_end();
    const sim::BeatSynthesis synthesis({}, f, 1);
    const double amplitude = 8000;
    // 1e-3 cycles would be 50 LSB; what is left is the sweep within the chirp (2e-4 cycles at 30 m/s),
    // rounding, noise.
    for (const auto& [range, rate] : {std::pair{3.0, 0.0}, {57.3, -28.4}, {140.1, 29.9}, {99.9, 11.1}}) {
        const sim::Echo echo{range, rate, snr_for(f, amplitude), 0};
        synthesis.synthesise({&echo, 1}, {}, 0, frame);
        double worst = 0;
        for (int k = 0; k < 64; ++k) {
            for (int n = 0; n < 64; ++n) {
                const double expected = amplitude * static_cast<double>(beat(range, rate, k, n));
                worst = std::max(worst, std::fabs(expected - frame.chirp[std::size_t(k)][std::size_t(n)]));
            }
        }
        CHECK_TEXT(worst < 12,
                   StringFromFormat("%.2f LSB at %.1f m, %.1f m/s", worst, range, rate).asCharString());
    }
}

TEST(BeatSynthesis, EchoesAddUpWhetherOrNotTheyShareARangeRate) {
    const sim::FrontEnd f = clean_front_end();
    const sim::BeatSynthesis synthesis({}, f, 1);
    const double a = 3000;
    const double snr = snr_for(f, a);
    const std::vector<sim::Echo> echoes{{20, -5, snr, 0}, {60, -5, snr, 0.25}, {61, 7, snr, 0}};
    synthesis.synthesise(echoes, {}, 0, frame);
    const sim::Echo shifted{60, -5, snr, 0.25};
    dsp::BeatFrame part;
    synthesis.synthesise({&shifted, 1}, {}, 0, part);
    double worst = 0;
    for (int k = 0; k < 64; ++k)
        for (int n = 0; n < 64; ++n)
            worst =
                std::max(worst, std::fabs(a * static_cast<double>(beat(20, -5, k, n) + beat(61, 7, k, n)) +
                                          part.chirp[std::size_t(k)][std::size_t(n)] -
                                          frame.chirp[std::size_t(k)][std::size_t(n)]));
    CHECK_TEXT(worst < 12, StringFromFormat("%.2f LSB", worst).asCharString());
}

TEST(BeatSynthesis, SignalToNoiseRatioIsThatOfTheRadarEquation) {
    sim::FrontEnd f = clean_front_end();
    f.noise_lsb = 20;  // rounding adds 1/12 LSB^2 only
    // 30 dB at 100 m for 10 dBsm by definition; 12 dB less at twice the range, 10 dB less for 0 dBsm.
    DOUBLES_EQUAL(30, sim::integrated_snr_db(f, 10, 100), 1e-9);
    DOUBLES_EQUAL(30 - 12.0412, sim::integrated_snr_db(f, 10, 200), 1e-4);
    DOUBLES_EQUAL(20, sim::integrated_snr_db(f, 0, 100), 1e-9);

    const sim::BeatSynthesis synthesis({}, f, 7);
    const double cell_m = 299792458.0 / 60e6;
    const double range = 20 * cell_m;  // in the middle of cell 20 and of Doppler cell 0
    const sim::Echo echo{range, 0, std::pow(10, sim::integrated_snr_db(f, 10, range) / 10), 0};
    double peak = 0;
    double noise = 0;
    constexpr int kFrames = 40;
    for (int i = 0; i < kFrames; ++i) {
        synthesis.synthesise({&echo, 1}, {}, std::uint64_t(i), frame);
        peak += power_at(frame, 20, 0) / kFrames;
        synthesis.synthesise({}, {}, std::uint64_t(i), frame);
        double square = 0;
        for (const auto& chirp : frame.chirp)
            for (const auto s : chirp) square += double(s) * s;
        noise += square / kFrames;  // the mean power of a cell of an unscaled 64 x 64 transform
    }
    DOUBLES_EQUAL(30, 10 * std::log10(peak / noise), 0.1);
    DOUBLES_EQUAL(400, noise / 4096, 400 * 0.02);
}

TEST(BeatSynthesis, WhatLiesBeyondTheHighestRangeCellIsFilteredOut) {
    const sim::FrontEnd f = clean_front_end();
    const sim::BeatSynthesis synthesis({}, f, 1);
    const sim::Echo echo{165, 0, snr_for(f, 8000), 0};
    synthesis.synthesise({&echo, 1}, {}, 0, frame);
    for (const auto& chirp : frame.chirp)
        for (const auto s : chirp) CHECK(s >= -1 && s <= 1);
}

TEST(BeatSynthesis, TheConverterClipsAndKeepsItsOffsetAndTheLeakage) {
    sim::FrontEnd f = clean_front_end();
    f.adc_bits = 12;
    const sim::BeatSynthesis loud({}, f, 1);
    const sim::Echo echo{50, 0, snr_for(f, 5000), 0};
    loud.synthesise({&echo, 1}, {}, 0, frame);
    int lowest = 0;
    int highest = 0;
    for (const auto& chirp : frame.chirp) {
        lowest = std::min<int>(lowest, *std::min_element(chirp.begin(), chirp.end()));
        highest = std::max<int>(highest, *std::max_element(chirp.begin(), chirp.end()));
    }
    LONGS_EQUAL(-2048, lowest);
    LONGS_EQUAL(2047, highest);

    f.offset_lsb = -37;
    f.leakage_lsb = 100;
    const sim::BeatSynthesis quiet({}, f, 1);
    quiet.synthesise({}, {}, 0, frame);
    // Leakage at 0.3 m: 0.06 cycles over the chirp, from a phase of 1/8 cycle.
    for (int n : {0, 21, 63}) {
        const double expected =
            -37 + 100 * std::cos(2 * std::numbers::pi * (0.125 + 0.3 / (299792458.0 / 60e6) * n / 64));
        DOUBLES_EQUAL(expected, frame.chirp[5][std::size_t(n)], 0.6);
    }
}

TEST(BeatSynthesis, ABurstHitsItsShareOfTheChirpsForItsTime) {
    const sim::FrontEnd f = clean_front_end();
    const sim::BeatSynthesis synthesis({}, f, 3);
    const sim::Interference burst{0, 1, 1000, 4, 0.25};
    int hit_chirps = 0;
    int longest = 0;
    for (std::uint64_t i = 0; i < 50; ++i) {
        synthesis.synthesise({}, {&burst, 1}, i, frame);
        for (const auto& chirp : frame.chirp) {
            const auto hit = [](std::int16_t s) { return s > 2 || s < -2; };
            const auto first = std::find_if(chirp.begin(), chirp.end(), hit);
            const auto last = std::find_if(chirp.rbegin(), chirp.rend(), hit);
            if (first == chirp.end()) continue;
            ++hit_chirps;
            longest = std::max(longest, static_cast<int>(last.base() - first));
        }
    }
    DOUBLES_EQUAL(0.25, hit_chirps / 3200.0, 5 * 0.0077);
    LONGS_EQUAL(8, longest);  // 4 us of 2 MS/s
}

TEST(BeatSynthesis, AFrameIsTheSameWheneverAndWhereverItIsMade) {
    sim::FrontEnd f;
    const std::vector<sim::Echo> echoes{{20, -5, 1e5, 0}, {60.5, -5, 1e4, 0.25}, {101, 17, 1e3, 0.5}};
    const sim::Interference burst{0, 1, 300, 4, 0.25};
    const sim::BeatSynthesis synthesis({}, f, 42);
    dsp::BeatFrame other;
    synthesis.synthesise(echoes, {&burst, 1}, 9, frame);
    synthesis.synthesise(echoes, {&burst, 1}, 10, other);
    CHECK(frame.chirp != other.chirp);
    synthesis.synthesise(echoes, {&burst, 1}, 9, other);
    CHECK(frame.chirp == other.chirp);
    sim::BeatSynthesis({}, f, 43).synthesise(echoes, {&burst, 1}, 9, other);
    CHECK(frame.chirp != other.chirp);
    // FNV-1a over the samples. Found equal with g++ -O0, g++ -O2 and clang++ -O2: a change here changes every
    // run.
    std::uint64_t hash = 14695981039346656037U;
    for (const auto& chirp : frame.chirp)
        for (const auto s : chirp) hash = (hash ^ static_cast<std::uint16_t>(s)) * 1099511628211U;
    CHECK_TEXT(hash == 0xef0609e5e17c4bcbU,
               StringFromFormat("0x%lx", static_cast<unsigned long>(hash)).asCharString());
}
