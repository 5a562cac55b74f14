// Degenerate input for NN, PDA, JPDA and their order statistics, in both scalars, through the gate as the
// tracker does it. What is expected is what any sound association must give; the few numbers are worked
// beside the test.
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "tracking/associator.hpp"
#include "tracking/gating.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::Associator;
using tracking::constant;
using tracking::Gate;
using tracking::GateConfig;
using tracking::Mat2;
using tracking::Measurement;
using tracking::Vec2;

namespace {

constexpr std::array kAll{Associator::nn, Associator::pda, Associator::ospda, Associator::jpda,
                          Associator::osjpda};

double number(double v) {
    return v;
}
double number(Real v) {
    return std::ldexp(v.raw(), -Real::fraction_bits);
}

template <class S>
struct Scene {
    GateConfig<S> gate;
    std::vector<Vec2<S>> tracks;
    std::vector<Mat2<S>> covariance;
    std::vector<Measurement<S>> measurements;

    void track(int range_cm, int rate_cmps, bool singular = false) {
        tracks.push_back({constant<S>(range_cm, 100), constant<S>(rate_cmps, 100)});
        Mat2<S> p = Mat2<S>::Zero();
        p(0, 0) = singular ? S(0) : constant<S>(1, 4);
        p(1, 1) = singular ? S(0) : constant<S>(1, 25);
        covariance.push_back(p);
    }
    void measurement(int range_cm, int rate_cmps) {
        Measurement<S> m;
        m.z = {constant<S>(range_cm, 100), constant<S>(rate_cmps, 100)};
        m.variance = {constant<S>(1, 4), constant<S>(1, 100)};
        measurements.push_back(m);
    }
    std::vector<AssociationRow<S>> associate(Associator associator) const {
        static tracking::JpdaWorkspace<S> work;
        std::vector<AssociationRow<S>> rows(tracks.size());
        const Gate<S> g(gate);
        for (std::size_t t = 0; t < tracks.size(); ++t)
            g.fill(rows[t], tracks[t], covariance[t], measurements, ~std::uint64_t{0}, false);
        tracking::associate<S>(rows, associator, {}, work);
        return rows;
    }
};

template <class S>
void check_proper(const std::vector<AssociationRow<S>>& rows) {
    for (const auto& row : rows) {
        double weights = number(row.missed_weight);
        double betas = number(row.missed);
        CHECK(number(row.missed_weight) >= 0 && number(row.missed) >= 0);
        for (const auto& c : row.candidates()) {
            CHECK(number(c.weight) >= 0 && number(c.beta) >= 0);
            weights += number(c.weight);
            betas += number(c.beta);
        }
        DOUBLES_EQUAL(1.0, weights, 1e-3);
        DOUBLES_EQUAL(1.0, betas, 1e-3);
    }
}

/// Runs the check for each associator and scalar.
template <class Check>
void for_all(Check check) {
    for (const Associator a : kAll) {
        check(Scene<double>{}, a);
        check(Scene<Real>{}, a);
    }
}

}  // namespace

TEST_GROUP(Associator){};

TEST(Associator, NamesAreATableInBothDirections) {
    for (std::size_t i = 0; i < tracking::kAssociatorNames.size(); ++i) {
        const auto a = static_cast<Associator>(i);
        CHECK(tracking::associator_named(tracking::name_of(a)) == a);
    }
    CHECK(tracking::associator_named("osjpda") == Associator::osjpda);
    CHECK(!tracking::associator_named("kalman"));
    CHECK(!tracking::associator_named(""));
}

TEST(Associator, NoTracksNoMeasurements) {
    for_all([](auto scene, Associator a) {
        CHECK(scene.associate(a).empty());
        scene.measurement(5000, 0);
        CHECK(scene.associate(a).empty());
        scene.measurements.clear();
        scene.track(5000, 0);
        const auto rows = scene.associate(a);
        check_proper(rows);
        DOUBLES_EQUAL(1.0, number(rows[0].missed_weight), 0.0);
    });
}

TEST(Associator, OneMeasurementExactlyOnTheOnlyPrediction) {
    for_all([](auto scene, Associator a) {
        scene.track(5000, 0);
        scene.measurement(5000, 0);
        const auto rows = scene.associate(a);
        check_proper(rows);
        // Ratio PD N(0; 0, S) / lambda = .9 / (2 pi sqrt(.5 * .05)) / 5e-4 = 1812, against 1 - PD PG = .1003.
        const double expected = a == Associator::nn ? 1.0 : 1812.0 / 1812.1;
        DOUBLES_EQUAL(expected, number(rows[0].item[0].weight), 1e-5);
    });
}

TEST(Associator, NearestNeighbourTakesTheLikeliestAndOnlyThat) {
    for_all([](auto scene, Associator a) {
        if (a != Associator::nn) return;
        scene.track(5000, 0);
        scene.measurement(5100, 0);
        scene.measurement(4970, 10);
        scene.measurement(5050, -50);
        const auto rows = scene.associate(a);
        LONGS_EQUAL(3, rows[0].count);
        CHECK(number(rows[0].item[1].weight) == 1.0 && number(rows[0].item[0].weight) == 0.0);
        CHECK(number(rows[0].missed) == 0.0);
    });
}

TEST(Associator, IdenticalTracksOnIdenticalMeasurements) {
    for_all([](auto scene, Associator a) {
        for (int i = 0; i < 3; ++i) scene.track(5000, 0);
        for (int i = 0; i < 4; ++i) scene.measurement(5010, 5);
        const auto rows = scene.associate(a);
        check_proper(rows);
        // Whoever gets which, all are in the same place.
        for (const auto& row : rows) CHECK(number(row.missed_weight) < 0.01);
    });
}

TEST(Associator, MoreTracksThanMeasurementsLosesNobodyToNothing) {
    for_all([](auto scene, Associator a) {
        for (int i = 0; i < 6; ++i) scene.track(5000 + 10 * i, 0);
        scene.measurement(5020, 0);
        scene.measurement(5030, 0);
        check_proper(scene.associate(a));
    });
}

TEST(Associator, SingularCovarianceStillGates) {
    // P = 0: S = R. The ratio at distance 0 is .9 / (2 pi sqrt(.25 * .01)) / 5e-4.
    for_all([](auto scene, Associator a) {
        scene.track(5000, 0, true);
        scene.measurement(5000, 0);
        const auto rows = scene.associate(a);
        LONGS_EQUAL(1, rows[0].count);
        DOUBLES_EQUAL(std::log(.9 / (2 * 3.14159265 * .05) / 5e-4), number(rows[0].item[0].log_ratio), 1e-3);
        check_proper(rows);
    });
}

TEST(Associator, SingularInnovationCovarianceGatesNothing) {
    // P of rank one that cancels R: S = [1 1; 1 1] has no inverse.
    for_all([](auto scene, Associator a) {
        using S = std::decay_t<decltype(scene.gate.gate)>;
        scene.track(5000, 0);
        scene.covariance[0] << constant<S>(3, 4), S(1), S(1), constant<S>(99, 100);
        scene.measurement(5000, 0);
        const auto rows = scene.associate(a);
        LONGS_EQUAL(0, rows[0].count);
        DOUBLES_EQUAL(1.0, number(rows[0].missed_weight), 0.0);
    });
}

TEST(Associator, CertainDetectionAndNoClutter) {
    for_all([](auto scene, Associator a) {
        using S = std::decay_t<decltype(scene.gate.gate)>;
        scene.gate.detection_probability = S(1);
        scene.gate.obscured_detection_probability = S(1);
        scene.gate.clutter_density = S(0);
        scene.track(5000, 0);
        scene.track(5100, 0);
        scene.track(9000, 0);
        scene.measurement(5010, 0);
        scene.measurement(5090, 0);
        const auto rows = scene.associate(a);
        check_proper(rows);
        CHECK(number(rows[0].missed_weight) < 1e-3);
        DOUBLES_EQUAL(1.0, number(rows[2].missed_weight), 0.0);
    });
}

TEST(Associator, MoreMeasurementsInAGateThanFit) {
    for_all([](auto scene, Associator a) {
        scene.track(5000, 0);
        scene.track(5005, 0);
        for (int i = 0; i < tracking::kMaxMeasurements; ++i) scene.measurement(4950 + 2 * i, 0);
        const auto rows = scene.associate(a);
        for (const auto& row : rows) {
            LONGS_EQUAL(tracking::kMaxGated, row.count);
            LONGS_EQUAL(tracking::kMaxMeasurements - tracking::kMaxGated, row.dropped);
        }
        check_proper(rows);
    });
}

TEST(Associator, FullCapacityOfTracksInOneCluster) {
    for_all([](auto scene, Associator a) {
        for (int i = 0; i < tracking::kMaxTracks; ++i) scene.track(5000 + 5 * i, 0);
        for (int i = 0; i < 40; ++i) scene.measurement(5000 + 4 * i, 0);
        check_proper(scene.associate(a));
    });
}
