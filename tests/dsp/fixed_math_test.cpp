// Expected values: the C library in double precision, whose error is far below the bounds claimed.
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "dsp/fixed_math.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Fixed;
using dsp::Real;

namespace {
template <int F>
double value(Fixed<F> x) {
    return std::ldexp(x.raw(), -F);
}
template <int F>
double clamp(double v) {
    return std::min(std::max(v, value(Fixed<F>::min())), value(Fixed<F>::max()));
}

struct Worst {
    double lsb = 0;  // largest error, in units of the bound
    std::int32_t at = 0;
    void take(double error, double bound, std::int32_t raw) {
        if (std::abs(error) / bound > lsb) {
            lsb = std::abs(error) / bound;
            at = raw;
        }
    }
};

template <int F>
void sweep_functions(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const double lsb = std::ldexp(1.0, -F);
    Worst exp_error, ln_error, sqrt_error;
    for (int i = 0; i < 400'000; ++i) {
        // Uniform in the number of leading zeros too, so that small numbers are met as often as large ones.
        const auto raw = static_cast<std::int32_t>(static_cast<std::uint32_t>(random())) >> (random() % 32);
        const auto x = Fixed<F>::from_raw(raw);
        const double e = std::exp(value(x));
        exp_error.take(value(dsp::exp(x)) - clamp<F>(e),
                       0.5 * lsb + std::min(e, value(Fixed<F>::max())) * std::ldexp(1.0, -26), raw);
        if (raw <= 0) continue;
        ln_error.take(value(dsp::ln(x)) - clamp<F>(std::log(value(x))), 0.5 * lsb + std::ldexp(1.0, -26),
                      raw);
        sqrt_error.take(value(dsp::sqrt(x)) - clamp<F>(std::sqrt(value(x))), 0.5 * lsb * (1 + 1e-9), raw);
    }
    CHECK(exp_error.lsb <= 1);
    CHECK(ln_error.lsb <= 1);
    CHECK(sqrt_error.lsb <= 1);
}
/// Roots of numbers beside squares and beside the middles between them, where rounding turns.
template <int F>
void check_roots() {
    const auto check = [](std::int64_t raw) {
        if (raw < 1 || raw > 0x7FFF'FFFF) return;
        const auto root =
            static_cast<std::uint64_t>(dsp::sqrt(Fixed<F>::from_raw(static_cast<std::int32_t>(raw))).raw());
        const std::uint64_t four_squares = static_cast<std::uint64_t>(raw) << (F + 2);
        CHECK((2 * root - 1) * (2 * root - 1) < four_squares &&
              four_squares < (2 * root + 1) * (2 * root + 1));
    };
    std::mt19937_64 random(F);
    for (int bit = 0; bit < 31; ++bit) {
        for (int i = -2; i <= 2; ++i) check((std::int64_t{1} << bit) + i);
        for (int i = 0; i < 3000; ++i) {
            const std::int64_t root = static_cast<std::int64_t>(random() & ((1ULL << (bit / 2 + 1)) - 1));
            for (int beside = -1; beside <= 1; ++beside) {
                check(root * root + beside);
                check(root * root + root + beside);
            }
            check(static_cast<std::int64_t>(random() & ((2ULL << bit) - 1)));
        }
    }
    check(0x7FFF'FFFF);
}
}  // namespace

TEST_GROUP(FixedMath){};

TEST(FixedMath, SquareRootIsTheNearestNumber) {
    check_roots<4>();
    check_roots<16>();
    check_roots<22>();
    check_roots<26>();
    check_roots<30>();
}

TEST(FixedMath, ExpLnSqrtStayWithinTheirBoundsInEveryFormat) {
    sweep_functions<22>(1);
    sweep_functions<16>(2);
    sweep_functions<26>(3);
    sweep_functions<30>(4);
    sweep_functions<4>(5);
}

TEST(FixedMath, DivisionStaysWithinItsBound) {
    std::mt19937_64 random(6);
    double worst = 0;
    for (int i = 0; i < 1'000'000; ++i) {
        const auto a = Real::from_raw(static_cast<std::int32_t>(static_cast<std::uint32_t>(random())) >>
                                      (random() % 32));
        const auto b = Real::from_raw(static_cast<std::int32_t>(static_cast<std::uint32_t>(random())) >>
                                      (random() % 32));
        if (b == Real(0)) continue;
        const double exact = clamp<22>(static_cast<double>(a.raw()) / b.raw());
        const double bound = 0.5 * std::ldexp(1.0, -22) + std::abs(exact) * std::ldexp(1.0, -29);
        worst = std::max(worst, std::abs(value(dsp::divide(a, b)) - exact) / bound);
    }
    CHECK(worst <= 1);
}

TEST(FixedMath, ShareOfAWholeIsTheProductBitForBit) {
    std::mt19937 random(3);
    for (int trial = 0; trial < 200'000; ++trial) {
        const auto whole = static_cast<std::int32_t>(random() >> (1 + random() % 30) | 1U);
        const auto part = static_cast<std::int32_t>(random() % (static_cast<std::uint32_t>(whole) + 1));
        const dsp::Reciprocal<22> inverse(dsp::Real::from_raw(whole));
        for (const std::int32_t p : {0, 1, part, whole - 1, whole}) {
            const auto share = dsp::Real::from_raw(p);
            LONGS_EQUAL((share * inverse).raw(), inverse.share(share).raw());
        }
    }
}

TEST(FixedMath, DivisionAtTheEndsOfTheFormat) {
    const auto lsb = Real::from_raw(1);
    CHECK(dsp::divide(Real(1), Real(0)) == Real::max());
    CHECK(dsp::divide(Real(-1), Real(0)) == Real::min());
    CHECK(dsp::divide(Real(0), Real(0)) == Real(0));
    CHECK(dsp::divide(Real::min(), Real::ratio(1, 2)) == Real::min());
    CHECK(dsp::divide(Real::min(), Real(-1)) == Real::max());
    CHECK(dsp::divide(Real(1), lsb) == Real::max());
    CHECK(dsp::divide(Real(-1), lsb) == Real::min());
    CHECK(dsp::divide(lsb, Real::max()) == Real(0));
    CHECK(dsp::divide(lsb, lsb) == Real(1));
    CHECK(dsp::divide(Real::min(), Real::min()) == Real(1));
    CHECK(dsp::divide(Real(6), Real(3)) == Real(2));
    CHECK(dsp::divide(Real(1), Real(-4)) == Real::ratio(-1, 4));
}

TEST(FixedMath, KnownPoints) {
    CHECK(dsp::exp(Real(0)) == Real(1));
    CHECK(dsp::ln(Real(1)) == Real(0));
    CHECK(dsp::sqrt(Real(144)) == Real(12));
    CHECK(dsp::ln(Real(0)) == Real::min());
    CHECK(dsp::ln(Real(-1)) == Real::min());
    CHECK(dsp::sqrt(Real(-1)) == Real(0));
    CHECK(dsp::exp(Real(7)) == Real::max());
    CHECK(dsp::exp(Real::max()) == Real::max());
    CHECK(dsp::exp(Real::min()) == Real(0));
    static_assert(dsp::exp(Real(1)) == Real::from_raw(11'401'300));  // e * 2^22 = 11401300.08
    static_assert(dsp::ln(Real(2)) == Real::from_raw(2'907'270));    // ln 2 * 2^22 = 2907269.99
}

TEST(FixedMath, ExpAndLnAreMonotone) {
    Real last_exp = dsp::exp(Real(-16));
    for (std::int32_t raw = Real(-16).raw(); raw <= Real(7).raw(); raw += 101) {
        const Real e = dsp::exp(Real::from_raw(raw));
        CHECK(e >= last_exp);
        last_exp = e;
    }
    Real last_ln = Real::min();
    for (std::int32_t raw = 1; raw < (1 << 22); raw += 13) {
        const Real l = dsp::ln(Real::from_raw(raw));
        CHECK(l >= last_ln);
        last_ln = l;
    }
}
