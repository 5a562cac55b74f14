// Expected values: the formulas written out in double precision.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include "tests/tracking/synthetic_road.hpp"
#include "tracking/gating.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::constant;
using tracking::Gate;
using tracking::GateConfig;
using tracking::kMaxGated;
using tracking::Mat2;
using tracking::Measurement;
using tracking::Vec2;
using tracking_test::value;

namespace {
constexpr std::uint64_t kAll = ~std::uint64_t{0};

template <class S>
Measurement<S> at(S range, S rate) {
    Measurement<S> m;
    m.z = {range, rate};
    m.variance = {constant<S>(9, 100), constant<S>(1, 100)};
    return m;
}
template <class S>
Mat2<S> covariance() {
    Mat2<S> p;
    p << constant<S>(4, 100), constant<S>(1, 100), constant<S>(1, 100), constant<S>(2, 100);
    return p;
}

template <class S>
void row_is_the_textbooks() {
    const GateConfig<S> config;
    const Gate<S> gate(config);
    std::mt19937 random(1);
    std::vector<Measurement<S>> measurements;
    for (int i = 0; i < 20; ++i) {
        measurements.push_back(at<S>(constant<S>(4900 + static_cast<int>(random() % 400), 100),
                                     constant<S>(-1080 + static_cast<int>(random() % 160), 100)));
    }
    const Vec2<S> x(S(51), S(-10));
    AssociationRow<S> row;
    gate.fill(row, x, covariance<S>(), measurements, kAll, false);

    Eigen::Matrix2d s;
    s << .13, .01, .01, .03;
    std::vector<std::size_t> inside;
    for (std::size_t j = 0; j < measurements.size(); ++j) {
        const Eigen::Vector2d nu(value(measurements[j].z[0]) - 51, value(measurements[j].z[1]) + 10);
        if (nu.dot(s.inverse() * nu) <= 16) inside.push_back(j);
    }
    CHECK(inside.size() > 5);
    CHECK(inside.size() < kMaxGated);
    LONGS_EQUAL(inside.size(), row.count);
    LONGS_EQUAL(0, row.dropped);
    for (std::size_t i = 0; i < inside.size(); ++i) {
        LONGS_EQUAL(inside[i], row.item[i].measurement);
        const Eigen::Vector2d nu(value(measurements[inside[i]].z[0]) - 51,
                                 value(measurements[inside[i]].z[1]) + 10);
        const double density =
            std::exp(-0.5 * nu.dot(s.inverse() * nu)) / (2 * M_PI * std::sqrt(s.determinant()));
        DOUBLES_EQUAL(std::log(0.9 * density / 5e-4), value(row.item[i].log_ratio), 2e-4);
    }
    DOUBLES_EQUAL(std::log(1 - 0.9 * (1 - std::exp(-8.0))), value(row.log_missed), 1e-5);
}
}  // namespace

TEST_GROUP(Gating){};

TEST(Gating, RowIsTheTextbooks) {
    row_is_the_textbooks<double>();
    row_is_the_textbooks<Real>();
}

TEST(Gating, KeepsTheLikeliestOfTooManyAndCountsTheRest) {
    const Gate<Real> gate{GateConfig<Real>{}};
    std::vector<Measurement<Real>> measurements;
    for (int i = 0; i < 40; ++i) {  // 17 i mod 40 visits every distance 0..39 cm once, in disorder
        measurements.push_back(at<Real>(Real(50) + constant<Real>(17 * i % 40, 100), Real(-10)));
    }
    AssociationRow<Real> row;
    gate.fill(row, {Real(50), Real(-10)}, covariance<Real>(), measurements, kAll, false);
    LONGS_EQUAL(kMaxGated, row.count);
    LONGS_EQUAL(40 - kMaxGated, row.dropped);
    for (std::size_t i = 0; i < kMaxGated; ++i) {
        CHECK(17 * row.item[i].measurement % 40 < kMaxGated);
        if (i > 0) CHECK(row.item[i].measurement > row.item[i - 1].measurement);
    }
}

TEST(Gating, OnlyUsableMeasurementsEnter) {
    const Gate<Real> gate{GateConfig<Real>{}};
    const std::vector<Measurement<Real>> measurements(3, at<Real>(Real(50), Real(-10)));
    AssociationRow<Real> row;
    gate.fill(row, {Real(50), Real(-10)}, covariance<Real>(), measurements, 0b101, false);
    LONGS_EQUAL(2, row.count);
    LONGS_EQUAL(0, row.item[0].measurement);
    LONGS_EQUAL(2, row.item[1].measurement);
    gate.fill(row, {Real(50), Real(-10)}, covariance<Real>(), {}, kAll, false);
    LONGS_EQUAL(0, row.count);
}

TEST(Gating, FoldedRangeRatesAreUnfoldedTowardsTheTrackAndTheRangeWithThem) {
    const Gate<Real> gate{GateConfig<Real>{}};
    // True 80 m, -40 m/s: measured 60.834 m/s higher, and one range cell short by the wrong coupling.
    const Vec2<Real> nu = gate.innovation({Real(80), Real(-40)}, {constant<Real>(75'003'459, 1'000'000),
                                                                  constant<Real>(20'834'496, 1'000'000)});
    DOUBLES_EQUAL(0, value(nu[0]), 1e-5);
    DOUBLES_EQUAL(0, value(nu[1]), 1e-5);
    const Vec2<Real> back = gate.innovation({Real(80), Real(40)}, {constant<Real>(84'996'541, 1'000'000),
                                                                   constant<Real>(-20'834'496, 1'000'000)});
    DOUBLES_EQUAL(0, value(back[0]), 1e-5);
    DOUBLES_EQUAL(0, value(back[1]), 1e-5);
    GateConfig<Real> unambiguous;
    unambiguous.rate_span_mps = Real(0);
    DOUBLES_EQUAL(
        100, value(Gate<Real>(unambiguous).innovation({Real(80), Real(-40)}, {Real(80), Real(60)})[1]), 0);
}

TEST(Gating, ReachInRangeTurnsAwayNothingOfTheGate) {
    const Gate<Real> gate{GateConfig<Real>{}};
    std::mt19937 random(5);
    const auto centi = [&](int from, int to) {
        return constant<Real>(from + static_cast<int>(random() % static_cast<unsigned>(to - from)), 100);
    };
    int gated = 0;
    int folded = 0;
    for (int trial = 0; trial < 3000; ++trial) {
        const bool obscured = trial % 3 == 0;
        const Vec2<Real> x(Real(60), centi(-8000, 4500));
        Mat2<Real> p = covariance<Real>();
        p(0, 0) = centi(10, 10'000);
        std::vector<Measurement<Real>> measurements;
        Real variance(0);
        for (int i = 0; i < 12; ++i) {
            auto m = at<Real>(centi(2000, 10'000), Real(0));
            const int fold = static_cast<int>(random() % 3) - 1;
            m.z[1] = x[1] + centi(-60, 60) + gate.config().rate_span_mps * fold;
            m.variance[0] = centi(1, 200);
            variance = std::max(variance, m.variance[0]);
            measurements.push_back(m);
        }
        AssociationRow<Real> all;
        AssociationRow<Real> near;
        gate.fill(all, x, p, measurements, kAll, obscured);
        gate.fill(
            near, x, p, measurements, (1U << measurements.size()) - 1, obscured,
            [](const Vec2<Real>&) { return Real(0); }, gate.range_reach(p, variance, obscured));
        LONGS_EQUAL(all.count, near.count);
        for (int i = 0; i < all.count; ++i) {
            const auto& c = near.item[static_cast<std::size_t>(i)];
            LONGS_EQUAL(all.item[static_cast<std::size_t>(i)].measurement, c.measurement);
            const auto& m = measurements[c.measurement];
            if (tracking::absolute(Real(m.z[1] - x[1])) > Real(10)) ++folded;
            ++gated;
        }
    }
    CHECK(gated > 5000);
    CHECK(folded > 1000);
}

TEST(Gating, CertaintiesStayFinite) {
    GateConfig<Real> config;
    config.detection_probability = Real(1);
    config.gate = Real(100);  // PG = 1 to the last bit
    config.clutter_density = Real(0);
    CHECK(config.valid());
    const Gate<Real> gate(config);
    const std::vector<Measurement<Real>> measurements{at<Real>(Real(50), Real(-10)),
                                                      at<Real>(Real(51), Real(-10))};
    AssociationRow<Real> row;
    gate.fill(row, {Real(50), Real(-10)}, covariance<Real>(), measurements, kAll, false);
    LONGS_EQUAL(2, row.count);
    CHECK(row.item[0].log_ratio > row.item[1].log_ratio);
    CHECK(row.item[0].log_ratio < Real(100));
    CHECK(row.log_missed > Real(-100));
}

TEST(Gating, SingularCovarianceGatesNothing) {
    GateConfig<Real> config;
    const Gate<Real> gate(config);
    Mat2<Real> p;
    p << Real(-1), Real(0), Real(0), Real(1);
    const std::vector<Measurement<Real>> measurements{at<Real>(Real(50), Real(-10))};
    AssociationRow<Real> row;
    gate.fill(row, {Real(50), Real(-10)}, p, measurements, kAll, false);
    LONGS_EQUAL(0, row.count);
}

TEST(Gating, ObscuredTrackTrustsLessAndExpectsLess) {
    const Gate<Real> gate{GateConfig<Real>{}};
    const std::vector<Measurement<Real>> measurements{at<Real>(Real(50), Real(-10))};
    AssociationRow<Real> clear, obscured;
    gate.fill(clear, {Real(50), Real(-10)}, covariance<Real>(), measurements, kAll, false);
    gate.fill(obscured, {Real(50), Real(-10)}, covariance<Real>(), measurements, kAll, true);
    CHECK(obscured.log_missed > clear.log_missed);
    CHECK(obscured.item[0].log_ratio < clear.item[0].log_ratio);
    DOUBLES_EQUAL(0.09 + 1, value(gate.noise(measurements[0], true)[0]), 1e-6);
    DOUBLES_EQUAL(0.01 + 0.25, value(gate.noise(measurements[0], true)[1]), 1e-6);
}

namespace {
/// Of m measurements in a gate of volume V, PD PG psi are the target's.
template <class S>
void clutter_is_counted_in_the_gate() {
    const Gate<S> gate{GateConfig<S>{}};
    const Eigen::Matrix2d s{{.13, .01}, {.01, .03}};
    const double volume = M_PI * 16 * std::sqrt(s.determinant());
    tracking::Track<S> track;
    track.x = {S(50), S(-10)};
    track.covariance = covariance<S>();
    track.existence = constant<S>(3, 4);
    std::vector<Measurement<S>> measurements;
    AssociationRow<S> row;
    DOUBLES_EQUAL(0, value(gate.log_counted_excess(row, track, measurements)), 0);
    for (int m = 1; m <= 20; ++m) {
        measurements.push_back(at<S>(S(50), S(-10)));
        gate.fill(row, track.x, track.covariance, measurements, kAll, false);
        const double density = std::max(m - 0.9 * (1 - std::exp(-8.0)) * 0.75, 0.5) / volume;
        DOUBLES_EQUAL(std::log(density / 5e-4), value(gate.log_counted_excess(row, track, measurements)),
                      2e-4);
    }
}
}  // namespace

TEST(Gating, ClutterIsCountedInTheGateWhenNobodyKnowsIt) {
    clutter_is_counted_in_the_gate<double>();
    clutter_is_counted_in_the_gate<Real>();
}
