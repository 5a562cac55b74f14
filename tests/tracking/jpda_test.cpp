// Expected marginals come from listing every one-to-one joint event, never from the recursion itself.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <type_traits>
#include <vector>

#include "tests/tracking/joint_events.hpp"
#include "tracking/jpda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::JpdaStatus;
using tracking::JpdaWorkspace;
using namespace joint_events;

namespace {

JpdaWorkspace<double> g_work;
JpdaWorkspace<Real> g_fixed_work;

template <class S>
JpdaStatus associate(std::vector<AssociationRow<S>>& rows) {
    if constexpr (std::is_same_v<S, double>) {
        return tracking::jpda<S>(rows, g_work);
    } else {
        return tracking::jpda<S>(rows, g_fixed_work);
    }
}

}  // namespace

TEST_GROUP(Jpda){};

TEST(Jpda, DoubleEqualsListingAllEvents) {
    std::mt19937 random(1);
    double worst = 0.0;
    for (const Shape& shape : kShapes) {
        for (int i = 0; i < 30; ++i) {
            Rows rows = random_rows(random, shape);
            const EventList events(rows);
            const JpdaStatus status = associate(rows);
            LONGS_EQUAL(0, status.approximated);
            worst = std::max(worst, largest_error(rows, events));
        }
    }
    CHECK(worst <= 1e-12);
}

TEST(Jpda, FixedPointEqualsListingAllEvents) {
    std::mt19937 random(2);
    double worst = 0.0;
    double worst_sum = 0.0;
    for (const Shape& shape : kShapes) {
        for (int i = 0; i < 30; ++i) {
            Rows rows = random_rows(random, shape);
            auto fixed = to_fixed(rows);
            const EventList events(rows);
            const JpdaStatus status = associate(fixed);
            LONGS_EQUAL(0, status.approximated);
            worst = std::max(worst, largest_error(fixed, events));
            worst_sum = std::max(worst_sum, worst_row_sum(fixed));
        }
    }
    CHECK(worst <= 2e-3);
    CHECK(worst_sum <= 1e-3);
}

TEST(Jpda, NoTracksNoMeasurementsAndOneOfEach) {
    Rows none;
    LONGS_EQUAL(0, associate(none).clusters);

    Rows rows(2);
    rows[0].log_missed = -2.0;
    rows[1].log_missed = -2.0;
    LONGS_EQUAL(0, associate(rows).clusters);
    DOUBLES_EQUAL(1.0, rows[0].missed, 1e-15);

    add(rows[0], 5, 1.0);
    LONGS_EQUAL(0, associate(rows).clusters);
    DOUBLES_EQUAL(1.0 / (1.0 + std::exp(-3.0)), rows[0].item[0].beta, 1e-15);
    DOUBLES_EQUAL(1.0, rows[1].missed, 1e-15);
}

TEST(Jpda, IdenticalTracksShareIdenticalMeasurementsEvenly) {
    Rows rows(3);
    for (auto& row : rows) {
        row.log_missed = std::log(0.1);
        for (int j = 0; j < 4; ++j) add(row, 10 + j, 2.0);
    }
    auto fixed = to_fixed(rows);
    const EventList events(rows);
    associate(rows);
    associate(fixed);
    CHECK(largest_error(rows, events) <= 1e-14);
    CHECK(largest_error(fixed, events) <= 2e-6);
    for (const auto& row : rows)
        for (const auto& c : row.candidates()) DOUBLES_EQUAL(rows[0].item[0].beta, c.beta, 1e-14);
}

TEST(Jpda, CertainDetectionSharesTheOnlyMeasurement) {
    // PD PG = 1: ln(1 - PD PG) is -inf. One of the two must still go without.
    Rows rows(2);
    for (auto& row : rows) {
        row.log_missed = -std::numeric_limits<double>::infinity();
        add(row, 0, 3.0);
    }
    auto fixed = to_fixed(rows);
    associate(rows);
    associate(fixed);
    for (std::size_t t = 0; t < 2; ++t) {
        DOUBLES_EQUAL(0.5, rows[t].missed, 1e-12);
        DOUBLES_EQUAL(0.5, rows[t].item[0].beta, 1e-12);
        DOUBLES_EQUAL(0.5, to_double(fixed[t].missed), 1e-6);
        DOUBLES_EQUAL(0.5, to_double(fixed[t].item[0].beta), 1e-6);
    }
}

TEST(Jpda, NoClutterTakesThePairsForCertain) {
    Rows rows(2);
    for (std::size_t t = 0; t < 2; ++t) {
        rows[t].log_missed = std::log(0.1);
        add(rows[t], 0, t == 0 ? std::numeric_limits<double>::infinity() : 3.0);
        add(rows[t], 1, t == 1 ? std::numeric_limits<double>::infinity() : 3.0);
    }
    auto fixed = to_fixed(rows);
    associate(rows);
    associate(fixed);
    for (std::size_t t = 0; t < 2; ++t) {
        DOUBLES_EQUAL(1.0, rows[t].item[t].beta, 1e-12);
        DOUBLES_EQUAL(1.0, to_double(fixed[t].item[t].beta), 1e-6);
        DOUBLES_EQUAL(0.0, to_double(fixed[t].missed), 1e-6);
    }
}

TEST(Jpda, ProductsOfManySmallLikelihoodsDoNotUnderflow) {
    // Eight tracks want the same measurement; each joint event weighs about e^-140.
    Rows rows(8);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        rows[t].log_missed = -20.0;
        add(rows[t], 0, -0.1 * static_cast<double>(t));
        if (t > 0) add(rows[t], static_cast<int>(t), -20.0);
        if (t + 1 < rows.size()) add(rows[t], static_cast<int>(t) + 1, -19.0);
    }
    auto fixed = to_fixed(rows);
    const EventList events(rows);
    associate(rows);
    associate(fixed);
    CHECK(largest_error(rows, events) <= 1e-12);
    CHECK(largest_error(fixed, events) <= 2e-3);
    CHECK(worst_row_sum(fixed) <= 1e-3);
}

TEST(Jpda, IndependentClustersDoNotDisturbEachOther) {
    std::mt19937 random(3);
    Rows left = random_rows(random, {4, 6, 0.8, 8.0, -2.0});
    Rows right = random_rows(random, {4, 6, 0.8, 8.0, -2.0});
    Rows both = left;
    for (AssociationRow<double> row : right) {
        for (auto& c : row.candidates()) c.measurement = static_cast<std::uint16_t>(c.measurement + 50);
        both.push_back(row);
    }
    associate(left);
    associate(right);
    const JpdaStatus status = associate(both);
    LONGS_EQUAL(2, status.clusters);
    LONGS_EQUAL(4, status.largest);
    for (std::size_t t = 0; t < 4; ++t) {
        for (std::size_t c = 0; c < static_cast<std::size_t>(left[t].count); ++c)
            DOUBLES_EQUAL(left[t].item[c].beta, both[t].item[c].beta, 1e-13);
        DOUBLES_EQUAL(right[t].missed, both[t + 4].missed, 1e-13);
    }
}

TEST(Jpda, LargestExactClusterAndTheFirstPastIt) {
    std::mt19937 random(4);
    Rows exact = random_rows(random, {8, 12, 1.0, 8.0, -2.0});
    const JpdaStatus at_capacity = associate(exact);
    LONGS_EQUAL(1, at_capacity.clusters);
    LONGS_EQUAL(8, at_capacity.largest);
    LONGS_EQUAL(0, at_capacity.approximated);

    Rows wide = random_rows(random, {8, 13, 1.0, 8.0, -2.0});
    LONGS_EQUAL(1, associate(wide).approximated);

    // Many tracks on few measurements: subsets of the measurements.
    Rows few = random_rows(random, {12, 8, 1.0, 8.0, -2.0});
    LONGS_EQUAL(0, associate(few).approximated);
}

TEST(Jpda, FixedPointHoldsAtFullCapacity) {
    // 8 tracks, 12 shared measurements, the most joint events there can be; listing 3e8 of them takes
    // minutes, so the reference is the recursion in double, which is checked against events above.
    std::mt19937 random(7);
    double worst = 0.0;
    for (const double spread : {0.0, 1.0, 4.0, 12.0, 30.0}) {
        for (int i = 0; i < 5; ++i) {
            Rows rows = random_rows(random, {8, 12, 1.0, spread, -2.3});
            auto fixed = to_fixed(rows);
            LONGS_EQUAL(0, associate(rows).approximated);
            LONGS_EQUAL(0, associate(fixed).approximated);
            for (std::size_t t = 0; t < rows.size(); ++t) {
                worst = std::max(worst, std::abs(rows[t].missed - to_double(fixed[t].missed)));
                for (std::size_t c = 0; c < 12; ++c)
                    worst =
                        std::max(worst, std::abs(rows[t].item[c].beta - to_double(fixed[t].item[c].beta)));
            }
            CHECK(worst_row_sum(fixed) <= 1e-3);
        }
    }
    CHECK(worst <= 2e-3);
}

TEST(Jpda, ApproximationOfLargeClustersIsCloserToTheEventsThanPda) {
    // A convoy: ten tracks, each in reach of three measurements, two of them shared with the neighbours.
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-3.0, 5.0);
    double error = 0.0;
    double fixed_error = 0.0;
    double pda_error = 0.0;
    constexpr int kRuns = 20;
    for (int i = 0; i < kRuns; ++i) {
        Rows rows(10);
        for (int t = 0; t < 10; ++t) {
            auto& row = rows[static_cast<std::size_t>(t)];
            row.log_missed = std::log(0.1);
            for (int j = t; j < t + 3; ++j) add(row, j, uniform(random));
        }
        auto fixed = to_fixed(rows);
        const EventList events(rows);
        Rows alone;
        for (const auto& row : rows) {
            Rows one{row};
            associate(one);
            alone.push_back(one[0]);
        }
        LONGS_EQUAL(1, associate(rows).approximated);
        LONGS_EQUAL(1, associate(fixed).approximated);
        error += largest_error(rows, events) / kRuns;
        fixed_error += largest_error(fixed, events) / kRuns;
        pda_error += largest_error(alone, events) / kRuns;
        CHECK(worst_row_sum(fixed) <= 1e-3);
    }

    CHECK(error <= 0.15);
    CHECK(fixed_error <= 0.15);
    CHECK(pda_error >= 3.0 * error);
}

TEST(Jpda, FullCapacityOfTracksAndMeasurements) {
    std::mt19937 random(6);
    Rows rows = random_rows(random, {tracking::kMaxTracks, tracking::kMaxGated, 1.0, 8.0, -2.0});
    auto fixed = to_fixed(rows);
    LONGS_EQUAL(1, associate(rows).approximated);
    LONGS_EQUAL(1, associate(fixed).approximated);
    LONGS_EQUAL(tracking::kMaxTracks, associate(fixed).largest);
    CHECK(worst_row_sum(rows) <= 1e-9);
    CHECK(worst_row_sum(fixed) <= 1e-3);
}
