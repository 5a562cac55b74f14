// Expected values: the discrete Fourier transform in double precision, from its definition.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>

#include "dsp/tapered_fft64.hpp"
#include "dsp/window.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

namespace {

using Complex = std::complex<double>;

constexpr int kLargest = 1 << 14;

}  // namespace

TEST_GROUP(TaperedFft64) {
    dsp::Spectrum64 data;
    dsp::Window window = dsp::window(dsp::WindowKind::hann);
    bench::Random random{12};

    double draw() {
        return static_cast<double>(random() % (2 * kLargest + 1)) - kLargest;
    }

    void set(std::size_t n, double re, double im) {
        const auto part = [&](double y) {
            return static_cast<std::int16_t>(std::lrint(y * window[n] / 32768));
        };
        data[n] = {part(re), part(im)};
    }
    std::array<Complex, 64> exact() const {
        std::array<Complex, 64> x;
        for (std::size_t n = 0; n < 64; ++n) x[n] = Complex(data[n].re, data[n].im);
        std::array<Complex, 64> spectrum = bench::dft64(x);
        for (Complex& s : spectrum) s = std::ldexp(1.0, -dsp::kTaperedExponent) * s;
        return spectrum;
    }
    /// Every bin: six standard deviations.
    void check(double tolerance = 3.1) {
        const auto expected = exact();
        dsp::tapered_fft64(data);
        for (std::size_t k = 0; k < 64; ++k) {
            DOUBLES_EQUAL(expected[k].real(), data[k].re, tolerance);
            DOUBLES_EQUAL(expected[k].imag(), data[k].im, tolerance);
        }
    }
};

TEST(TaperedFft64, RandomData) {
    for (const auto kind : {dsp::WindowKind::hann, dsp::WindowKind::blackman}) {
        window = dsp::window(kind);
        for (int t = 0; t < 200; ++t) {
            for (std::size_t n = 0; n < 64; ++n) set(n, draw(), draw());
            check();
        }
    }
}

TEST(TaperedFft64, CannotOverflow) {
    // Every tone at the corners of the input range drives one bin, and what leads to it, to the largest value
    // there is; eighths of a turn in steps of a sixteenth hit the rotations by 45 degrees. The same for every
    // pair of halves.
    for (int k = 0; k < 64; ++k) {
        for (int start = 0; start < 16; ++start) {
            for (const int top : {kLargest, kLargest - 1}) {
                for (std::size_t n = 0; n < 64; ++n) {
                    const double phase =
                        2 * std::acos(-1.0) * (static_cast<double>(n) * k + 4 * start + 2) / 64;
                    set(n, std::cos(phase) >= 0 ? top : -kLargest, std::sin(phase) >= 0 ? top : -kLargest);
                }
                check();
            }
        }
    }
    for (int t = 0; t < 2000; ++t) {
        for (std::size_t n = 0; n < 64; ++n) {
            set(n, draw() >= 0 ? kLargest : -kLargest, draw() >= 0 ? kLargest : -kLargest);
        }
        check();
    }
}

TEST(TaperedFft64, NoiseAndBiasAreAsStated) {
    constexpr int kTransforms = 4000;
    double noise = 0;
    std::array<Complex, 64> bias{};
    for (int t = 0; t < kTransforms; ++t) {
        for (std::size_t n = 0; n < 64; ++n) set(n, draw(), draw());
        const auto expected = exact();
        dsp::tapered_fft64(data);
        for (std::size_t k = 0; k < 64; ++k) {
            const Complex error = Complex(data[k].re, data[k].im) - expected[k];
            noise += std::norm(error) / (2 * 64 * kTransforms);
            bias[k] += error / static_cast<double>(kTransforms);
        }
    }
    CHECK(noise < 0.27);
    double mean = 0;
    for (const Complex& b : bias) {
        CHECK(std::abs(b.real()) < 0.45 && std::abs(b.imag()) < 0.45);
        mean += (std::abs(b.real()) + std::abs(b.imag())) / 128;
    }
    CHECK(mean < 0.08);
}

TEST(TaperedFft64, RealPairsComeApart) {
    for (int t = 0; t < 100; ++t) {
        for (std::size_t n = 0; n < 64; ++n) set(n, draw(), draw() / (t + 1));
        std::array<Complex, 64> x;
        std::array<Complex, 64> y;
        for (std::size_t n = 0; n < 64; ++n) {
            x[n] = data[n].re;
            y[n] = data[n].im;
        }
        const auto a = bench::dft64(x);
        const auto b = bench::dft64(y);
        std::array<dsp::Complex16, 32 * 3> ab{};
        dsp::tapered_fft64_real_pair(data, ab.data(), 3);
        const double unit = std::ldexp(1.0, -dsp::kTaperedPairExponent);
        for (std::size_t k = 0; k < 32; ++k) {
            DOUBLES_EQUAL(a[k].real() * unit, ab[3 * k].re, 4.4);
            DOUBLES_EQUAL(a[k].imag() * unit, ab[3 * k].im, 4.4);
            DOUBLES_EQUAL(b[k].real() * unit, ab[3 * k + 1].re, 4.4);
            DOUBLES_EQUAL(b[k].imag() * unit, ab[3 * k + 1].im, 4.4);
            CHECK(ab[3 * k + 2] == dsp::Complex16{});
        }
    }
}
