// Expected values: long double, whose 64 digits hold every product of two numbers of 32 bits.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "tracking/scalar.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::product_exceeds;
using tracking::sqrt_above;

namespace {
/// The ends of the range and numbers of every size.
std::vector<std::int32_t> operands() {
    constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
    std::vector<std::int32_t> all{0, 1, -1, 2, -2, kMax, -kMax, -kMax - 1, kMax - 1, 1 << 22, -(1 << 22)};
    std::mt19937 random(1);
    for (int i = 0; i < 60; ++i) all.push_back(static_cast<std::int32_t>(random()) >> random() % 31);
    return all;
}
}  // namespace

TEST_GROUP(Scalar){};

TEST(Scalar, SquareRootAboveIsAboveAndNear) {
    CHECK(sqrt_above(Real(16), Real::from_raw(-1)) == Real(0));
    CHECK(sqrt_above(Real(1), Real(-1)) == Real(0));
    std::mt19937 random(2);
    const auto check = [](std::int32_t a, std::int32_t b) {
        const double root = std::sqrt(std::ldexp(a, -22)) * std::sqrt(std::ldexp(b, -22));
        const double above = std::ldexp(sqrt_above(Real::from_raw(a), Real::from_raw(b)).raw(), -22);
        CHECK(above >= root);
        CHECK(above <= std::max(1.07 * root, root + std::ldexp((1 << 15) + 2, -22)));
    };
    constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
    for (const std::int32_t other : {0, 1, 1 << 22, 1 << 26, kMax}) {
        for (std::int32_t raw = 1; raw < 10'000; ++raw) check(raw, other);
        for (int bit = 1; bit < 31; ++bit) {
            check((1 << bit) - 1, other);
            check(1 << bit, other);
            check((1 << bit) + 1, other);
        }
        check(kMax, other);
    }
    const auto of_any_size = [&] { return static_cast<std::int32_t>(random() >> 1) >> random() % 31 | 1; };
    for (int i = 0; i < 100'000; ++i) check(of_any_size(), of_any_size());
    for (const double x : {0.0, 1e-300, 2.0, 1e300}) CHECK(sqrt_above(x, 1.0) * sqrt_above(1.0, x) >= x);
}

TEST(Scalar, ProductsAreComparedExactly) {
    const std::vector<std::int32_t> all = operands();
    int exceeds = 0;
    for (const std::int32_t a : all) {
        for (const std::int32_t b : all) {
            for (const std::int32_t c : all) {
                const std::int32_t d = all[static_cast<std::size_t>(exceeds) % all.size()];
                const bool expected = static_cast<long double>(a) * b > static_cast<long double>(c) * d;
                CHECK_EQUAL(expected, product_exceeds(Real::from_raw(a), Real::from_raw(b), Real::from_raw(c),
                                                      Real::from_raw(d)));
                exceeds += expected ? 1 : 0;
            }
            CHECK_FALSE(
                product_exceeds(Real::from_raw(a), Real::from_raw(b), Real::from_raw(b), Real::from_raw(a)));
        }
    }
    CHECK(exceeds > 1000);
    CHECK(product_exceeds(2.0, 3.0, 5.0, 1.0));
}
