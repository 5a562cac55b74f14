// Expected values: the windows' textbook formulas in double precision (Harris 1978), periodic form.
#include <cmath>
#include <numbers>

#include "dsp/window.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Window){};

TEST(Window, CoefficientsAreTheFormulasRounded) {
    for (int n = 0; n < 64; ++n) {
        const double c1 = std::cos(2 * std::numbers::pi * n / 64);
        const double c2 = std::cos(4 * std::numbers::pi * n / 64);
        const auto i = static_cast<std::size_t>(n);
        LONGS_EQUAL(32767, dsp::window(dsp::WindowKind::rectangular)[i]);
        DOUBLES_EQUAL(32767 * (0.5 - 0.5 * c1), dsp::window(dsp::WindowKind::hann)[i], 0.51);
        DOUBLES_EQUAL(32767 * (0.54 - 0.46 * c1), dsp::window(dsp::WindowKind::hamming)[i], 0.51);
        DOUBLES_EQUAL(32767 * (0.42 - 0.5 * c1 + 0.08 * c2), dsp::window(dsp::WindowKind::blackman)[i], 0.51);
    }
}

TEST(Window, SymmetricAboutSample32) {
    for (const dsp::Window& w : dsp::kWindows) {
        for (std::size_t n = 1; n < 64; ++n) LONGS_EQUAL(w[n], w[64 - n]);
    }
}
