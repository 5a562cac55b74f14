// Expected values: the mean of a sequence by hand, and the logarithm in double precision.
#include <cmath>

#include "tests/tracking/synthetic_road.hpp"
#include "tracking/clutter_map.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::ClutterMap;
using tracking::constant;
using tracking::Vec2;
using tracking_test::value;

namespace {
template <class S>
ClutterMap<S> map() {
    return {constant<S>(5, 10'000), constant<S>(60'834'496, 1'000'000)};
}
template <class S>
void learns_the_mean_number_a_frame() {
    auto clutter = map<S>();
    for (int frame = 0; frame < 1000; ++frame) {
        clutter.add({S(10), S(-25)});
        clutter.add({S(11), S(-25)});
        clutter.forget();
    }
    // Two a frame over 20 m x 60.834 / 64 m/s, against 5e-4 everywhere. An eighth is forgotten every eight
    // frames, so the mean moves between 2 and 7/8 of it.
    const double cell = 20 * 60.834496 / 64;
    const double excess = value(clutter.log_excess({S(12), S(-25)}));
    CHECK(excess >= std::log(1 + 1.75 / (cell * 5e-4)) - 1e-3);
    CHECK(excess <= std::log(1 + 2 / (cell * 5e-4)) + 1e-3);
    CHECK(clutter.log_excess({S(30), S(-25)}) == S(0));  // the next band
    CHECK(clutter.log_excess({S(12), S(-23)}) == S(0));
}
}  // namespace

TEST_GROUP(ClutterMap){};

TEST(ClutterMap, LearnsTheMeanNumberAFrame) {
    learns_the_mean_number_a_frame<double>();
    learns_the_mean_number_a_frame<Real>();
}

TEST(ClutterMap, ForgetsAndResets) {
    auto clutter = map<Real>();
    const Vec2<Real> z(Real(10), Real(-25));
    for (int frame = 0; frame < 500; ++frame) {
        clutter.add(z);
        clutter.forget();
    }
    const double before = value(clutter.log_excess(z));
    for (int frame = 0; frame < 64; ++frame) clutter.forget();
    // One time constant, (7/8)^8 = 0.344: ln(1 + 0.344 n) for ln(1 + n).
    DOUBLES_EQUAL(std::log(1 + 0.344 * (std::exp(before) - 1)), value(clutter.log_excess(z)), 0.01);
    clutter.reset();
    CHECK(clutter.log_excess(z) == Real(0));
}

TEST(ClutterMap, WhatIsOffTheMapCountsAtItsEdge) {
    auto clutter = map<double>();
    for (const double range : {-1e300, 1e300, -5.0, 400.0}) {
        for (const double rate : {-1e300, 1e300, -31.0, 31.0}) {
            clutter.add({range, rate});
            CHECK(clutter.log_excess({range, rate}) > 0);
        }
    }
    ClutterMap<Real> unknown(Real(0), Real(0));  // no clutter expected, unambiguous range rate
    unknown.add({Real(10), Real(20)});
    CHECK(unknown.log_excess({Real(10), Real(20)}) > Real(0));
}
