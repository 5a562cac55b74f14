// Expected values: every range rate looked at, in double precision.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/tracking/scalars.hpp"
#include "tracking/rate_index.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::kMaxMeasurements;
using tracking::RateIndex;
using tracking_test::scalar;
using tracking_test::value;

namespace {
template <class S>
void finds_all_and_little_else(double span) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> rate(-90, 90);
    std::uniform_real_distribution<double> size(-3, 2);
    RateIndex<S> index(scalar<S>(span));
    const double exact_span = value(scalar<S>(span));
    int found = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        index.clear(0);
        CHECK_EQUAL(0, index.near(S(0), index.width(S(500))));
        std::vector<double> rates(1 + random() % kMaxMeasurements);
        index.clear(rates.size());
        for (std::size_t i = 0; i < rates.size(); ++i) {
            const S s = scalar<S>(rate(random));
            rates[i] = value(s);
            index.add(i, s);
        }
        const S middle = scalar<S>(rate(random));
        const S reach = scalar<S>(std::pow(10, size(random)));
        const std::uint64_t near = index.near(middle, index.width(reach));
        for (std::size_t i = 0; i < 64; ++i) {
            const bool is_near = (near >> i & 1) != 0;
            if (i >= rates.size()) {
                CHECK_FALSE(is_near);
                continue;
            }
            const double away = std::abs(std::remainder(rates[i] - value(middle), exact_span));
            if (away <= value(reach)) {
                CHECK(is_near);
                ++found;
            }
            if (away > value(reach) + 0.02 * exact_span && value(reach) < 0.45 * exact_span)
                CHECK_FALSE(is_near);
        }
    }
    CHECK(found > 1000);
}
}  // namespace

TEST_GROUP(RateIndex){};

TEST(RateIndex, FindsAllWithinReachAndLittleElse) {
    for (const double span : {60.834496, 1.0, 25.0, 400.0}) {
        finds_all_and_little_else<double>(span);
        finds_all_and_little_else<Real>(span);
    }
}

TEST(RateIndex, EverythingIsNearWithoutASpan) {
    for (const double span : {0.0, 0.5}) {
        RateIndex<Real> index(scalar<Real>(span));
        index.clear(kMaxMeasurements);
        for (int i = 0; i < kMaxMeasurements; ++i) index.add(static_cast<std::size_t>(i), Real(i - 30));
        CHECK(index.near(Real(400), index.width(Real(0))) == ~std::uint64_t{0});
    }
}
