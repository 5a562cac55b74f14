// Expected values from the C library's long double functions.
#include <cmath>
#include <numbers>

#include "host_sim/portable_math.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(PortableMath){};

TEST(PortableMath, PhasorIsCosineAndSineOfTurns) {
    for (int i = -4000; i <= 4000; ++i) {
        const double cycles = i * 0.000977 + (i % 7) * 100000.0;
        const long double angle =
            2 * std::numbers::pi_v<long double> * static_cast<long double>(cycles - std::floor(cycles));
        const auto z = sim::phasor(cycles);
        DOUBLES_EQUAL(static_cast<double>(std::cos(angle)), z.re, 1e-15);
        DOUBLES_EQUAL(static_cast<double>(std::sin(angle)), z.im, 1e-15);
    }
    DOUBLES_EQUAL(-1, sim::phasor(0.5).re, 0);
    DOUBLES_EQUAL(1, sim::phasor(-0.75).im, 0);
}

TEST(PortableMath, ExponentialAndLogarithmAreWithinAFewUlp) {
    for (int i = -600; i <= 600; ++i) {
        const double x = i * 0.513;
        const double expected = static_cast<double>(std::exp(static_cast<long double>(x)));
        DOUBLES_EQUAL(1, sim::exponential(x) / expected, 2e-15 * (1 + std::fabs(x)));
        DOUBLES_EQUAL(x, sim::logarithm(expected), 1e-15 * (1 + std::fabs(x)));
    }
    DOUBLES_EQUAL(0, sim::logarithm(1), 0);
}

TEST(PortableMath, DecibelsAndBack) {
    DOUBLES_EQUAL(1000, sim::power_from_db(30), 1e-10);
    DOUBLES_EQUAL(-13, sim::db_from_power(sim::power_from_db(-13)), 1e-12);
}
