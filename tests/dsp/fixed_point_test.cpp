// Expected values worked by hand; the exhaustive cases are compared with exact integer arithmetic.
#include <cstdint>
#include <limits>
#include <random>

#include "dsp/fixed_point.hpp"
#include "dsp/waveform.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Fixed;
using dsp::Real;

TEST_GROUP(FixedPoint){};

TEST(FixedPoint, RoundShiftIsHalfToEvenAndUnbiased) {
    // 2 fraction bits: -1.5 -1.25 -1 ... by hand.
    LONGS_EQUAL(-2, dsp::round_shift(-6, 2));
    LONGS_EQUAL(-1, dsp::round_shift(-5, 2));
    LONGS_EQUAL(0, dsp::round_shift(-2, 2));
    LONGS_EQUAL(0, dsp::round_shift(2, 2));
    LONGS_EQUAL(2, dsp::round_shift(6, 2));
    long bias = 0;
    for (int v = -1024; v < 1024; ++v) bias += 8 * dsp::round_shift(v, 3) - v;
    LONGS_EQUAL(0, bias);
    LONGS_EQUAL(std::numeric_limits<std::int32_t>::max() / 2 + 1,
                dsp::round_shift(std::numeric_limits<std::int32_t>::max(), 1));
}

TEST(FixedPoint, ProductsAreRoundedAsRoundShiftDoes) {
    std::mt19937 random(4);
    for (int trial = 0; trial < 100'000; ++trial) {
        // Of every size, and often a tie.
        std::int64_t v =
            dsp::product(static_cast<std::int32_t>(random()), static_cast<std::int32_t>(random()));
        v >>= random() % 60;
        if (trial % 2 == 0) v = v / (1 << 21) * (1 << 21);
        const std::int64_t exact = dsp::round_shift(v, 22);
        LONGS_EQUAL(dsp::saturate32(exact), dsp::narrowed<22>(v));
        if (dsp::saturate32(exact) == exact) LONGS_EQUAL(exact, dsp::rounded<22>(v));
    }
}

TEST(FixedPoint, SixteenBitsSaturateAfterRoundingDown) {
    LONGS_EQUAL(32'767, dsp::saturate16(32'767));
    LONGS_EQUAL(32'767, dsp::saturate16(32'768));
    LONGS_EQUAL(-32'768, dsp::saturate16(-32'768));
    LONGS_EQUAL(-32'768, dsp::saturate16(std::numeric_limits<std::int32_t>::min()));
    LONGS_EQUAL(-1, dsp::saturate16<4>(-1));
    LONGS_EQUAL(32'767, dsp::saturate16<4>(16 * 32'767 + 15));
    LONGS_EQUAL(32'767, dsp::saturate16<4>(16 * 32'768));
    LONGS_EQUAL(-32'768, dsp::saturate16<4>(-16 * 32'768 - 1));
}

TEST(FixedPoint, RoundDivideMatchesExactComparison) {
    for (int num = -60; num <= 60; ++num) {
        for (int den = 1; den <= 12; ++den) {
            const int q = dsp::round_divide(num, den);
            const int twice_error = 2 * (num - q * den);
            CHECK(twice_error <= den && twice_error >= -den);
            if (twice_error == den || twice_error == -den) LONGS_EQUAL(0, q % 2);
        }
    }
}

TEST(FixedPoint, SaturatesInsteadOfWrapping) {
    CHECK(Real::max() + Real(1) == Real::max());
    CHECK(Real::min() - Real(1) == Real::min());
    CHECK(-Real::min() == Real::max());
    CHECK(Real(400) * Real(400) == Real::max());
    CHECK(Real(-400) * Real(400) == Real::min());
    CHECK(Real(100000) == Real::max());
    CHECK(Real(1) / Real(0) == Real::max());
    CHECK(Real(-1) / Real(0) == Real::min());
    CHECK(Real(0) / Real(0) == Real(0));
    CHECK(Real(511).to<30>() == Fixed<30>::max());
}

TEST(FixedPoint, ProductsAndQuotientsRoundToNearestEven) {
    const auto lsb = Fixed<4>::from_raw(1);
    const auto half = Fixed<4>::ratio(1, 2);
    LONGS_EQUAL(0, (lsb * half).raw());                    // 0.5 lsb -> 0
    LONGS_EQUAL(2, (Fixed<4>::from_raw(3) * half).raw());  // 1.5 lsb -> 2
    LONGS_EQUAL(5, (Fixed<4>(1) / Fixed<4>(3)).raw());     // 16/3 = 5.33
    LONGS_EQUAL(-5, (Fixed<4>(-1) / Fixed<4>(3)).raw());
    LONGS_EQUAL(-5, (Fixed<4>(1) / Fixed<4>(-3)).raw());
}

TEST(FixedPoint, ConvertsToIntegerUnits) {
    LONGS_EQUAL(12345, Real::ratio(12345, 1000).in_units(1000));
    LONGS_EQUAL(-12345, Real::ratio(-12345, 1000).in_units(1000));
}
