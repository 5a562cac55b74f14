// Expected values: the windowed discrete Fourier transform in double precision, from its definition.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>

#include "dsp/range_fft.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

namespace {

using Complex = std::complex<double>;

constexpr std::int16_t kUntouched = 12345;

}  // namespace

TEST_GROUP(RangeFft) {
    std::array<std::int16_t, 128> samples{};
    std::array<dsp::Complex16, 32 * 64> out;
    dsp::Window window = dsp::window(dsp::WindowKind::hann);
    bench::Random random{31};

    dsp::packed::Pair dither = 0;

    dsp::ChirpPair pair(int exponent) const {
        dsp::ChirpPair chirps{samples.data(), {0, 0}, exponent, {dither, 1 - dither}};
        for (std::size_t n = 0; n < 128; ++n) chirps.sum[n / 64] += samples[n];
        return chirps;
    }
    /// The smallest exponent that lets the deviations fit, as the interface asks for.
    int smallest_exponent() const {
        const dsp::ChirpPair chirps = pair(0);
        int largest = 0;
        for (std::size_t n = 0; n < 128; ++n) {
            largest = std::max(largest, std::abs(64 * samples[n] - chirps.sum[n / 64]));
        }
        int exponent = -11;
        while (largest > std::ldexp(64 << dsp::kFftInputBits, exponent)) ++exponent;
        return exponent;
    }
    std::array<Complex, 64> exact(std::size_t chirp, int exponent) const {
        const double mean = pair(0).sum[chirp] / 64.0;
        std::array<Complex, 64> x;
        for (std::size_t n = 0; n < 64; ++n) {
            x[n] = (samples[64 * chirp + n] - mean) * window[n] / 32768;
        }
        std::array<Complex, 64> spectrum = bench::dft64(x);
        for (Complex& s : spectrum) s = std::ldexp(1.0, -exponent - dsp::kRangeFftExponent) * s;
        return spectrum;
    }
    const std::array<dsp::Complex16, 32 * 64>& transformed(int exponent) {
        out.fill({kUntouched, kUntouched});
        dsp::range_fft(pair(exponent), dsp::RangeWindow(window), out.data());
        return out;
    }
    /// Every cell, against clipped sums where these exceed 16 bits: six standard deviations, and
    /// a step for factors just below one; in cell 0 also its bias and what rounding the mean by an eighth of
    /// a step gives 32 times.
    void check(int exponent) {
        transformed(exponent);
        for (std::size_t c = 0; c < 2; ++c) {
            const auto expected = exact(c, exponent);
            for (std::size_t k = 0; k < 32; ++k) {
                const dsp::Complex16 got = out[64 * k + c];
                const double tolerance = k == 0 ? 5 + 0.5 + 1 : 5;
                DOUBLES_EQUAL(std::clamp(expected[k].real(), -32768.0, 32767.0), got.re, tolerance);
                DOUBLES_EQUAL(std::clamp(expected[k].imag(), -32768.0, 32767.0), got.im, tolerance);
                CHECK((out[64 * k + 2] == dsp::Complex16{kUntouched, kUntouched}));
            }
        }
    }
};

TEST(RangeFft, RandomChirpsOfEveryScale) {
    for (const auto kind : {dsp::WindowKind::hann, dsp::WindowKind::blackman}) {
        window = dsp::window(kind);
        for (const int scale : {1, 3, 50, 300, 2047, 7000, 32767}) {
            for (int t = 0; t < 100; ++t) {
                for (std::size_t n = 0; n < 128; ++n) {
                    const int draw =
                        static_cast<int>(random() % static_cast<unsigned>(2 * scale + 1)) - scale;
                    samples[n] = static_cast<std::int16_t>(n < 64 ? draw : draw / (t % 4 + 1));
                }
                check(smallest_exponent());
                check(smallest_exponent() + 1);
            }
        }
    }
}

TEST(RangeFft, NoiseIsAsStatedAndBiasNone) {
    for (const int scale : {40, 2047, 32767}) {
        constexpr int kTransforms = 1500;
        double noise = 0;
        std::array<Complex, 64> bias{};
        for (int t = 0; t < kTransforms; ++t) {
            for (auto& s : samples) {
                s = static_cast<std::int16_t>(static_cast<int>(random() % static_cast<unsigned>(2 * scale)) -
                                              scale);
            }
            const int exponent = smallest_exponent();
            dither = static_cast<dsp::packed::Pair>(t % 2);
            transformed(exponent);
            for (std::size_t c = 0; c < 2; ++c) {
                const auto expected = exact(c, exponent);
                for (std::size_t k = 0; k < 32; ++k) {
                    const Complex error = Complex(out[64 * k + c].re, out[64 * k + c].im) - expected[k];
                    noise += std::norm(error) / (2 * 2 * 32 * kTransforms);
                    bias[2 * k + c] += error / static_cast<double>(kTransforms);
                }
            }
        }
        CHECK(noise < 0.46);
        for (const Complex& b : bias) CHECK(std::abs(b.real()) < 0.1 && std::abs(b.imag()) < 0.1);
    }
}

TEST(RangeFft, CannotOverflowWithAWindow) {
    // Every square wave drives one cell, and what leads to it, to the largest value there is. A converter's
    // range just below and just above a power of two, at every exponent.
    for (const auto kind : {dsp::WindowKind::hann, dsp::WindowKind::blackman}) {
        window = dsp::window(kind);
        for (const int top : {3, 64, 511, 2047, 2048, 4095, 32767}) {
            for (int k = 0; k <= 32; ++k) {
                for (int start = 0; start < 8; ++start) {
                    for (std::size_t n = 0; n < 128; ++n) {
                        const auto turn = static_cast<double>(n % 64) * k + 4 * start + (n < 64 ? 2 : 10);
                        const bool high = std::cos(std::acos(-1.0) * turn / 32) >= 0;
                        samples[n] = static_cast<std::int16_t>(high ? top : -top - 1);
                    }
                    check(smallest_exponent());
                }
            }
        }
    }
    for (int t = 0; t < 500; ++t) {
        for (auto& s : samples) s = static_cast<std::int16_t>(random() % 2 == 0 ? 32767 : -32768);
        check(smallest_exponent());
    }
}

TEST(RangeFft, WindowsOfALargerSumWithOneBitLess) {
    for (const auto kind : {dsp::WindowKind::rectangular, dsp::WindowKind::hamming}) {
        window = dsp::window(kind);
        for (const int scale : {5, 2047, 32767}) {
            for (int k = 0; k <= 32; ++k) {
                for (std::size_t n = 0; n < 128; ++n) {
                    const bool high = std::cos(std::acos(-1.0) * static_cast<double>(n % 64) * k / 32) >= 0;
                    samples[n] = static_cast<std::int16_t>(high ? scale : -scale - 1);
                }
                check(smallest_exponent() + 1);
            }
        }
    }
}

TEST(RangeFft, LargestStepsAboveTheMean) {
    // 63 samples at one end and one at the other.
    for (const int sign : {-1, 1}) {
        for (std::size_t at = 0; at < 64; ++at) {
            samples.fill(static_cast<std::int16_t>(sign > 0 ? -32768 : 32767));
            samples[at] = samples[64 + (at + 21) % 64] = static_cast<std::int16_t>(sign > 0 ? 32767 : -32768);
            check(smallest_exponent());
            check(5);
        }
    }
}

TEST(RangeFft, ConstantChirpsBecomeZero) {
    for (const int level : {-32768, -1, 0, 1234, 32767}) {
        samples.fill(static_cast<std::int16_t>(level));
        for (dither = 0; dither < 2; ++dither) {
            transformed(-11);
            for (std::size_t k = 0; k < 32; ++k) {
                CHECK(out[64 * k] == dsp::Complex16{} && out[64 * k + 1] == dsp::Complex16{});
            }
        }
    }
}

TEST(RangeFft, OneCodeIsLifted) {
    samples.fill(700);
    samples[64 + 32] = 701;
    check(-11);
    CHECK(out[64 + 1].re < -300);
    CHECK(out[64] == dsp::Complex16{});
}

TEST(RangeFft, PairsAtOnceAreTheSameBits) {
    constexpr std::size_t kPairs = dsp::kChirpPairs;
    std::array<std::int16_t, 128 * kPairs> chirps;
    const dsp::RangeWindow weights(window);
    for (int trial = 0; trial < 300; ++trial) {
        const int exponent = trial % 6 - 2;
        for (std::int16_t& x : chirps) {
            x = static_cast<std::int16_t>(
                std::ldexp(static_cast<double>(random() % 8192) - 4096, std::min(exponent, 1)));
        }
        std::array<dsp::ChirpPair, kPairs> pairs;
        for (std::size_t i = 0; i < kPairs; ++i) {
            pairs[i] = {&chirps[128 * i], {0, 0}, exponent, {static_cast<unsigned>(i % 2), 1}};
            for (std::size_t n = 0; n < 128; ++n) pairs[i].sum[n / 64] += chirps[128 * i + n];
        }
        if (trial % 7 == 0) ++pairs.back().exponent;  // four at once need one exponent
        std::array<dsp::Complex16, 32 * 64> expected;
        expected.fill({kUntouched, kUntouched});
        out = expected;
        for (std::size_t i = 0; i < kPairs; ++i) dsp::range_fft(pairs[i], weights, &expected[2 * i]);
        dsp::range_fft_pairs(pairs, weights, out.data());
        CHECK(out == expected);
    }
}
