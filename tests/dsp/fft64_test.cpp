// Expected values: the discrete Fourier transform in double precision, from its definition.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>

#include "dsp/fft64.hpp"
#include "tests/bench/accuracy_dsp.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

namespace {

using Complex = std::complex<double>;

std::int16_t code(int v) {
    return static_cast<std::int16_t>(v);
}

}  // namespace

TEST_GROUP(Fft64) {
    dsp::Spectrum64 data;
    bench::Random random{12};

    int draw(int peak) {
        return static_cast<int>(random() % static_cast<unsigned>(2 * peak + 1)) - peak;
    }

    /// Transforms `data` and compares every bin: half a unit of the last place, and a little of the 32-bit
    /// inside.
    void check(int bits = 15, double tolerance = 0.51) {
        std::array<Complex, 64> x;
        for (std::size_t n = 0; n < 64; ++n) x[n] = Complex(data[n].re, data[n].im);
        const auto exact = bench::dft64(x);
        const int exponent = dsp::fft64(data, bits);
        const double top = (1 << bits) - 1;
        int largest = 0;
        for (std::size_t k = 0; k < 64; ++k) {
            const Complex expected = exact[k] * std::ldexp(1.0, -exponent);
            // The very top saturates instead of rounding up.
            DOUBLES_EQUAL(std::min(expected.real(), top), data[k].re, tolerance);
            DOUBLES_EQUAL(std::min(expected.imag(), top), data[k].im, tolerance);
            largest = std::max<int>({largest, std::abs(data[k].re), std::abs(data[k].im)});
        }
        CHECK(largest <= 1 << bits);
        CHECK(largest >= 1 << (bits - 1) || largest == 0);
    }
};

TEST(Fft64, RandomDataAtAllLevels) {
    for (const int peak : {1, 2, 5, 33, 1000, 16384, 32767}) {
        for (int t = 0; t < 50; ++t) {
            for (auto& z : data) z = {code(draw(peak)), code(draw(peak))};
            // Small inputs come out scaled up by 2^9 at most, so the arithmetic's own rounding shows.
            check(15, peak < 33 ? 12 : (peak < 1000 ? 2 : 0.6));
        }
    }
}

TEST(Fft64, FewerBitsOnRequest) {
    for (int bits = 2; bits <= 15; ++bits) {
        for (auto& z : data) z = {code(draw(20000)), code(draw(20000))};
        check(bits);
    }
}

TEST(Fft64, CannotOverflow) {
    // Every tone at the corners of the input range drives one bin to the largest value there is.
    for (int k = 0; k < 64; ++k) {
        for (std::size_t n = 0; n < 64; ++n) {
            const double phase = 2 * std::acos(-1.0) * (static_cast<double>(n) * k + 8) / 64;
            data[n] = {code(std::cos(phase) >= 0 ? 32767 : -32768),
                       code(std::sin(phase) >= 0 ? 32767 : -32768)};
        }
        check();
    }
    data.fill({-32768, -32768});
    check();
    for (std::size_t n = 0; n < 64; ++n)
        data[n] = {code(n % 2 ? -32768 : 32767), code(n % 2 ? -32768 : 32767)};
    check();
}

TEST(Fft64, ImpulsesAndZero) {
    for (std::size_t n = 0; n < 64; ++n) {
        data.fill({});
        data[n] = {code(-12345), code(23456)};
        check();
    }
    data.fill({});
    LONGS_EQUAL(-15, dsp::fft64(data));
    for (const auto z : data) CHECK(z == dsp::Complex16{});
}

TEST(Fft64, RealPairsComeApart) {
    for (const int peak : {3, 100, 32767}) {
        std::array<Complex, 64> x;
        std::array<Complex, 64> y;
        for (std::size_t n = 0; n < 64; ++n) {
            data[n] = {code(draw(peak)), code(draw(peak / 3))};
            x[n] = data[n].re;
            y[n] = data[n].im;
        }
        const auto exact_a = bench::dft64(x);
        const auto exact_b = bench::dft64(y);
        const double tolerance = peak < 33 ? 8 : 1.1;
        std::array<dsp::Complex16, 32> a;
        std::array<dsp::Complex16, 32> b;
        const double unit = std::ldexp(1.0, -dsp::fft64_real_pair(data, a, b));
        for (std::size_t k = 0; k < 32; ++k) {
            DOUBLES_EQUAL(exact_a[k].real() * unit, a[k].re, tolerance);
            DOUBLES_EQUAL(exact_a[k].imag() * unit, a[k].im, tolerance);
            DOUBLES_EQUAL(exact_b[k].real() * unit, b[k].re, tolerance);
            DOUBLES_EQUAL(exact_b[k].imag() * unit, b[k].im, tolerance);
        }
    }
}

TEST(Fft64, AccuracyTable) {
    for (const auto& row : bench::fft_accuracy()) CHECK_TEXT(row.met(), row.what.c_str());
}
