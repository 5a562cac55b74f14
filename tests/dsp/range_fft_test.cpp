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

    std::array<std::int32_t, 2> sums() const {
        std::array<std::int32_t, 2> sum{};
        for (std::size_t n = 0; n < 128; ++n) sum[n / 64] += samples[n];
        return sum;
    }
    /// The smallest exponent that lets the deviations fit, as the interface asks for.
    int smallest_exponent() const {
        const auto sum = sums();
        int largest = 0;
        for (std::size_t n = 0; n < 128; ++n) {
            largest = std::max(largest, std::abs(64 * samples[n] - sum[n / 64]));
        }
        int exponent = -11;
        while (largest > std::ldexp(64 << dsp::kFftInputBits, exponent)) ++exponent;
        return exponent;
    }
    std::array<Complex, 64> exact(std::size_t chirp, int exponent) const {
        const double mean = sums()[chirp] / 64.0;
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
        dsp::range_fft(samples.data(), sums(), dsp::RangeWindow(window, exponent), out.data());
        return out;
    }
    /// Every cell, against clipped sums where these exceed 16 bits: more than six standard deviations, and a
    /// step for factors just below one.
    void check(int exponent) {
        transformed(exponent);
        for (std::size_t c = 0; c < 2; ++c) {
            const auto expected = exact(c, exponent);
            for (std::size_t k = 0; k < 32; ++k) {
                const dsp::Complex16 got = out[64 * k + c];
                constexpr double tolerance = 5;
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

TEST(RangeFft, AnyMeanIsRemovedFromAnyWindow) {
    for (const auto kind : {dsp::WindowKind::rectangular, dsp::WindowKind::hann, dsp::WindowKind::hamming,
                            dsp::WindowKind::blackman}) {
        window = dsp::window(kind);
        for (const int mean : {-32000, -77, 0, 5, 1999, 32000}) {
            for (const int scale : {1, 2, 5, 20, 90, 700}) {
                for (int t = 0; t < 20; ++t) {
                    for (auto& s : samples) {
                        const auto draw = static_cast<int>(random() % static_cast<unsigned>(2 * scale + 1));
                        s = static_cast<std::int16_t>(mean + draw - scale);
                    }
                    check(smallest_exponent() + 1);
                }
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
        CHECK(noise < 0.29);
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
        transformed(-11);
        for (std::size_t k = 0; k < 32; ++k) {
            CHECK(out[64 * k] == dsp::Complex16{} && out[64 * k + 1] == dsp::Complex16{});
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

TEST(RangeFft, ChirpsAtOnceAreTheSameBits) {
    std::array<std::int16_t, 64 * 11> chirps;
    for (int trial = 0; trial < 300; ++trial) {
        const std::size_t count = 1 + static_cast<std::size_t>(trial) % 11;
        const int exponent = trial % 6 - 2;
        std::array<std::int32_t, 11> sum{};
        for (std::size_t n = 0; n < chirps.size(); ++n) {
            chirps[n] = static_cast<std::int16_t>(
                std::ldexp(static_cast<double>(random() % 8192) - 4096, std::min(exponent, 1)));
            sum[n / 64] += chirps[n];
        }
        const dsp::RangeWindow weights(window, exponent);
        std::array<dsp::Complex16, 32 * 64> expected;
        expected.fill({kUntouched, kUntouched});
        out = expected;
        for (std::size_t i = 0; i < count; ++i) {
            dsp::range_fft(&chirps[64 * i], std::span(&sum[i], 1), weights, &expected[i]);
        }
        dsp::range_fft(chirps.data(), std::span(sum.data(), count), weights, out.data());
        CHECK(out == expected);
    }
}
