// Expected values: the same chain in double precision.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "dsp/range_doppler.hpp"
#include "tests/bench/accuracy_dsp.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

using dsp::WindowKind;

TEST_GROUP(RangeDoppler) {
    std::unique_ptr<dsp::Spectrum> spectrum = std::make_unique<dsp::Spectrum>();
    std::unique_ptr<dsp::PowerMap> map = std::make_unique<dsp::PowerMap>();
    bench::Random random{21};

    double cell(std::size_t r, std::size_t d) const {
        return map->cell[r][d] / 1024.0;
    }

    /// Every cell's amplitude within 1 % (the logarithm's step and the windows' last place) and `rounding` of
    /// the map's largest amplitude, which the 16 bits of the spectra bound: a transform adds 0.16 square
    /// steps to each part, its 12-bit input 0.08, and the largest cell of a tone has 2^14 steps. Four
    /// standard deviations.
    void compare(const dsp::BeatFrame& frame, WindowKind range, WindowKind doppler,
                 double rounding = 1.2e-4) {
        dsp::range_doppler(frame, range, doppler, *spectrum, *map);
        const auto exact = bench::power_map(frame, range, doppler);
        const double peak = std::sqrt(*std::ranges::max_element(exact));
        for (std::size_t i = 0; i < 2048; ++i) {
            const double amplitude = std::sqrt(exact[i]);
            DOUBLES_EQUAL(amplitude, std::exp2(cell(i / 64, i % 64) / 2),
                          1 + 0.01 * amplitude + rounding * peak);
        }
    }
};

TEST(RangeDoppler, NoiseMapAgreesWithDouble) {
    for (const auto range :
         {WindowKind::rectangular, WindowKind::hann, WindowKind::hamming, WindowKind::blackman}) {
        for (const double sigma : {3.0, 200.0, 7000.0}) {
            bench::Samples samples(4096, 100.0);
            bench::add_noise(samples, sigma, random);
            compare(bench::convert(samples), range, WindowKind::hann, 2e-3);
        }
    }
}

TEST(RangeDoppler, ATargetPeaksInItsCell) {
    // Doppler cell 61 is 3 cells closing; range 10 cells plus the coupling of that speed.
    const double rate = -3 * 0.950539;
    bench::Samples samples(4096, 0.0);
    bench::add_tone(samples, {10 * 4.996541 - 0.082133 * rate, rate, 100, 1});
    dsp::range_doppler(bench::convert(samples), WindowKind::hann, WindowKind::hann, *spectrum, *map);
    std::size_t best = 0;
    for (std::size_t i = 0; i < 2048; ++i) {
        if (map->cell[i / 64][i % 64] > map->cell[best / 64][best % 64]) best = i;
    }
    LONGS_EQUAL(10, best / 64);
    LONGS_EQUAL(61, best % 64);
    // |A/2 * 32 * 32|^2 for a Hann window in both directions.
    DOUBLES_EQUAL(2 * std::log2(100.0 / 2 * 32 * 32), cell(10, 61), 0.01);
}

TEST(RangeDoppler, AWeakTargetBesideAStrongOneKeepsItsPower) {
    bench::Samples samples(4096, 0.0);
    bench::add_tone(samples, {10 * 4.996541, 0, 2000, 0.3});
    bench::add_tone(samples, {24 * 4.996541, 0, 1, 0.9});  // 66 dB below, another row
    bench::add_noise(samples, 0.5, random);
    compare(bench::convert(samples, 2047), WindowKind::hann, WindowKind::hann);
    DOUBLES_EQUAL(2 * std::log2(1.0 / 2 * 32 * 32), cell(24, 0), 0.3);
}

TEST(RangeDoppler, ABurstInTwoChirpsLeavesTheOthersTheirPrecision) {
    bench::Samples samples(4096, 0.0);
    bench::add_noise(samples, 2, random);
    for (std::size_t n = 0; n < 64; ++n) samples[64 * 20 + n] += n % 2 ? 30000 : -30000;
    const dsp::BeatFrame frame = bench::convert(samples);
    // A burst is no tone: its rounding, twice the power after the pair is taken apart, has no gain from the
    // sum over the chirps, and the largest cell, the last of a burst beyond the band, only 2^13 steps.
    compare(frame, WindowKind::hann, WindowKind::hann, 3.4e-4);
}

TEST(RangeDoppler, TheTaperScalesEveryRowToItsLargestNumber) {
    for (const auto kind : {WindowKind::rectangular, WindowKind::hann, WindowKind::blackman}) {
        const dsp::Window& window = dsp::window(kind);
        const int full = kind == WindowKind::rectangular ? 11 : 12;  // bits
        for (const int spread : {0, 1, 6, 15}) {
            std::array<std::int16_t, 32> exponent{};
            for (auto& e : exponent)
                e = static_cast<std::int16_t>(
                    4 - static_cast<int>(random() % (1U + static_cast<unsigned>(spread))));
            exponent[7] = 4;
            const dsp::ChirpTaper taper(window, exponent);
            for (int bits = 0; bits <= 15; ++bits) {
                std::array<dsp::Complex16, 64> row{};
                const auto draw = [&] {
                    const std::uint32_t range = 2U << bits;
                    return static_cast<std::int16_t>(static_cast<int>(random() % range) - (1 << bits));
                };
                for (auto& x : row) x = {draw(), draw()};
                row[14].re = static_cast<std::int16_t>(-(1 << bits));
                std::array<dsp::Complex16, 64> tapered = row;
                const int result = taper.apply(tapered);
                LONGS_EQUAL(4 + std::max(bits, 1) - full, result);
                for (std::size_t k = 0; k < 64; ++k) {
                    // Rounded down; weights of small chirps end at the same place as the result does.
                    const double scale = std::ldexp(window[k] / 32768.0, exponent[k / 2] - result);
                    DOUBLES_EQUAL(row[k].re * scale - 0.5, tapered[k].re, spread == 0 ? 0.5 : 1.0);
                    DOUBLES_EQUAL(row[k].im * scale - 0.5, tapered[k].im, spread == 0 ? 0.5 : 1.0);
                    CHECK(std::max(std::abs(tapered[k].re), std::abs(tapered[k].im)) <= 1 << full);
                }
            }
        }
    }
}

TEST(RangeDoppler, PowerIsTheLogarithmOfTheSquare) {
    std::array<dsp::Complex16, 64> row{};
    std::array<std::uint16_t, 64> power{};
    for (int exponent = -17; exponent <= 14; ++exponent) {
        for (std::size_t d = 0; d < 64; ++d) {
            const auto draw = [&] {
                return static_cast<std::int16_t>(static_cast<std::int16_t>(random()) >> d / 4);
            };
            row[d] = {draw(), draw()};
        }
        row[5] = {-32768, -32768};
        row[6] = {};
        dsp::log_power(row, exponent, power);
        for (std::size_t d = 0; d < 64; ++d) {
            const double square = std::max(std::pow(row[d].re, 2) + std::pow(row[d].im, 2), 0.5);
            DOUBLES_EQUAL(std::max(1024 * (std::log2(square) + 2 * exponent), 0.0), power[d], 3.5);
        }
    }
}

TEST(RangeDoppler, FullScaleSquareWavesDoNotOverflow) {
    dsp::BeatFrame frame;
    for (std::size_t k = 0; k < 64; ++k) {
        for (std::size_t n = 0; n < 64; ++n) {
            frame.chirp[k][n] = static_cast<std::int16_t>((n / 4 + k / 8) % 2 ? 32767 : -32768);
        }
    }
    dsp::range_doppler(frame, WindowKind::rectangular, WindowKind::rectangular, *spectrum, *map);
    const auto exact = bench::power_map(frame, WindowKind::rectangular, WindowKind::rectangular);
    for (std::size_t i = 0; i < 2048; ++i) {
        if (exact[i] > 1e9) DOUBLES_EQUAL(std::log2(exact[i]), cell(i / 64, i % 64), 0.01);
    }
}

TEST(RangeDoppler, AFrameWithoutSignalIsAllZero) {
    dsp::BeatFrame frame;
    for (auto& chirp : frame.chirp) chirp.fill(77);
    dsp::range_doppler(frame, WindowKind::hann, WindowKind::hann, *spectrum, *map);
    for (const auto& row : map->cell) {
        for (const auto x : row) LONGS_EQUAL(0, x);
    }
}

TEST(RangeDoppler, AccuracyTable) {
    for (const auto& row : bench::noise_floor()) CHECK_TEXT(row.met(), row.what.c_str());
}
