// Expected values: the discrete Fourier transform in double precision, from its definition.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>

#include "dsp/fft64.hpp"
#include "dsp/window.hpp"
#include "tests/bench/accuracy_dsp.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

namespace {

using Complex = std::complex<double>;

constexpr int kLargest = 1 << dsp::kFftInputBits;

}  // namespace

TEST_GROUP(Fft64) {
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
        for (Complex& s : spectrum) s = std::ldexp(1.0, -dsp::kFftExponent) * s;
        return spectrum;
    }
    /// Every bin: six standard deviations.
    void check(double tolerance = 2.4) {
        const auto expected = exact();
        dsp::fft64(data);
        for (std::size_t k = 0; k < 64; ++k) {
            DOUBLES_EQUAL(expected[k].real(), data[k].re, tolerance);
            DOUBLES_EQUAL(expected[k].imag(), data[k].im, tolerance);
        }
    }
};

TEST(Fft64, RandomData) {
    for (const auto kind : {dsp::WindowKind::hann, dsp::WindowKind::blackman}) {
        window = dsp::window(kind);
        for (int t = 0; t < 200; ++t) {
            for (std::size_t n = 0; n < 64; ++n) set(n, draw(), draw());
            check();
        }
    }
}

TEST(Fft64, CannotOverflowWithAWindow) {
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

TEST(Fft64, CannotOverflowInsideTheCircle) {
    window = dsp::window(dsp::WindowKind::rectangular);
    for (int k = 0; k < 64; ++k) {
        for (int start = 0; start < 16; ++start) {
            for (std::size_t n = 0; n < 64; ++n) {
                const double phase = 2 * std::acos(-1.0) * (static_cast<double>(n) * k + start) / 64;
                set(n, (kLargest - 1) * std::cos(phase), (kLargest - 1) * std::sin(phase));
            }
            check(3);  // the largest twiddle is one step below one
        }
    }
}

TEST(Fft64, ClipsBeyond) {
    data.fill({kLargest, kLargest});
    dsp::fft64(data);
    CHECK(data[0].re >= 32766);
    CHECK(data[0].im >= 32766);
}

TEST(Fft64, NoiseIsAsStatedAndBiasNone) {
    constexpr int kTransforms = 4000;
    for (const int step : {1, 8}) {  // also of a block that was scaled up, whose lowest bits are all zero
        double noise = 0;
        std::array<Complex, 64> bias{};
        for (int t = 0; t < kTransforms; ++t) {
            for (std::size_t n = 0; n < 64; ++n) {
                set(n, draw() / step, draw() / step);
                data[n].re = static_cast<std::int16_t>(data[n].re * step);
                data[n].im = static_cast<std::int16_t>(data[n].im * step);
            }
            const auto expected = exact();
            dsp::fft64(data);
            for (std::size_t k = 0; k < 64; ++k) {
                const Complex error = Complex(data[k].re, data[k].im) - expected[k];
                noise += std::norm(error) / (2 * 64 * kTransforms);
                bias[k] += error / static_cast<double>(kTransforms);
            }
        }
        CHECK(noise < 0.15);
        for (const Complex& b : bias) CHECK(std::abs(b.real()) < 0.04 && std::abs(b.imag()) < 0.04);
    }
}

TEST(Fft64, AccuracyTable) {
    for (const auto& row : bench::fft_accuracy()) CHECK_TEXT(row.met(), row.what.c_str());
}

TEST(Fft64, RowsAtOnceAreTheSameBits) {
    std::array<dsp::Spectrum64, dsp::kFftRows> rows;
    for (int trial = 0; trial < 200; ++trial) {
        for (auto& row : rows) {
            for (std::size_t n = 0; n < 64; ++n) {
                set(n, draw(), draw());
                row[n] = data[n];
            }
        }
        std::array<dsp::Spectrum64, dsp::kFftRows> expected = rows;
        for (auto& row : expected) dsp::fft64(row);
        dsp::fft64_rows(rows);
        CHECK(rows == expected);
    }
}
