// Expected values: double precision.
#include <cmath>
#include <cstdint>
#include <random>

#include "tracking/weight.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::ScaledWeight;

namespace {
double of(Real x) {
    return x.raw() / 4194304.0;
}
double relative_error(ScaledWeight w, double expected, double at) {
    // Brought to the neighbourhood of `at` by a power of two, which is exact.
    int e = 0;
    std::frexp(expected / at, &e);
    const double scaled = of((w * ScaledWeight::normalised(1, -e)).to<22>());
    return std::abs(scaled - std::ldexp(expected, -e)) / std::ldexp(expected, -e);
}
}  // namespace

TEST_GROUP(Weight){};

TEST(Weight, RoundTripOfRealIsExact) {
    for (std::int32_t raw : {1, 2, 3, 12345, 4194304, 2147483647}) {
        LONGS_EQUAL(raw, ScaledWeight::of(Real::from_raw(raw)).to<22>().raw());
    }
    LONGS_EQUAL(0, ScaledWeight::of(Real(0)).to<22>().raw());
    LONGS_EQUAL(0, ScaledWeight::of(Real(-3)).to<22>().raw());
}

TEST(Weight, ExponentialOverTheWholeRangeOfReal) {
    for (int i = -5110; i <= 5110; ++i) {
        const Real x = Real::ratio(i, 10);
        CHECK(relative_error(ScaledWeight::exp(x), std::exp(of(x)), 256.0) < 5e-8);
    }
}

TEST(Weight, ArithmeticMatchesDouble) {
    std::mt19937 random(1);  // NOLINT: the same numbers every time are wanted
    std::uniform_real_distribution<double> uniform(-120, 120);
    for (int i = 0; i < 100'000; ++i) {
        const Real la = Real::from_raw(static_cast<std::int32_t>(uniform(random) * 4194304));
        const Real lb = Real::from_raw(static_cast<std::int32_t>(uniform(random) * 4194304));
        const auto a = ScaledWeight::exp(la);
        const auto b = ScaledWeight::exp(lb);
        const double da = std::exp(of(la));
        const double db = std::exp(of(lb));
        CHECK(relative_error(a + b, da + db, 256) < 1e-7);
        CHECK(relative_error(a * b, da * db, 256) < 1e-7);
        CHECK(relative_error(a / b, da / db, 256) < 1e-7);
        CHECK((a < b) == (da < db));
    }
}

TEST(Weight, ZeroIsOrdinary) {
    const ScaledWeight zero;
    const auto one = ScaledWeight::of(Real(1));
    CHECK(zero < one);
    CHECK(!(zero < zero));
    LONGS_EQUAL(0, (zero * one).to<22>().raw());
    LONGS_EQUAL(4194304, (zero + one).to<22>().raw());
    LONGS_EQUAL(0, (zero / zero).to<22>().raw());
    CHECK(ScaledWeight::exp(Real::max()) < one / zero);
    LONGS_EQUAL(Real::max().raw(), (one / zero).to<22>().raw());
}
