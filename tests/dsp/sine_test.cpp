// Expected values: the C library's cosine.
#include <cmath>
#include <numbers>

#include "dsp/sine.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Sine){};

TEST(Sine, MatchesTheLibraryAllTheWayRound) {
    for (const int n : {8, 64, 1024}) {
        for (int i = -2 * n; i <= 2 * n; ++i) {
            const double angle = 2 * std::numbers::pi * i / n;
            DOUBLES_EQUAL(std::cos(angle) * (1 << 30), dsp::cosine_q30(i, n), 4);
            DOUBLES_EQUAL(std::sin(angle) * (1 << 30), dsp::sine_q30(i, n), 4);
            LONGS_EQUAL(dsp::cosine_q30(i, n), dsp::cosine_q30(-i, n));
            LONGS_EQUAL(-dsp::cosine_q30(i, n), dsp::cosine_q30(i + n / 2, n));
        }
        LONGS_EQUAL(1 << 30, dsp::cosine_q30(0, n));
        LONGS_EQUAL(0, dsp::sine_q30(0, n));
    }
}
