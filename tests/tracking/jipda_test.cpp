// Expected values: listing of all joint events.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <span>
#include <vector>

#include "tests/tracking/existence_scenes.hpp"
#include "tracking/ijipda.hpp"
#include "tracking/jipda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using existence_scenes::by_listing;
using existence_scenes::fixed_of;
using existence_scenes::largest_error;
using existence_scenes::random_scene;
using existence_scenes::Scene;
using existence_scenes::scene_of;
using tracking::AssociationRow;

namespace {
template <class S>
tracking::JpdaStatus jipda(std::vector<AssociationRow<S>>& rows, std::vector<S>& psi) {
    const auto work = std::make_unique<tracking::JpdaWorkspace<S>>();
    return tracking::jipda<S>(rows, psi, *work);
}
}  // namespace

TEST_GROUP(Jipda){};

TEST(Jipda, AbsentMissedAndEachMeasurementByListing) {
    std::mt19937 random(11);  // NOLINT
    for (int i = 0; i < 200; ++i) {
        Scene s = random_scene(random, 1 + i % 6, 1 + i % 7, i % 2 == 0 ? 1.0 : 0.4, i % 5 == 0 ? 30 : 6);
        if (i % 6 == 5 && i % 7 > 5) continue;  // 6 x 7 all gated: too many events for a unit test
        const auto expected = by_listing(s);
        LONGS_EQUAL(0, jipda(s.rows, s.existence).approximated);
        CHECK(largest_error<double>(s.rows, s.existence, expected) <= 1e-12);
    }
}

TEST(Jipda, FixedPointByListing) {
    std::mt19937 random(12);  // NOLINT
    for (int i = 0; i < 200; ++i) {
        const Scene s = random_scene(random, 1 + i % 5, 1 + i % 6, 0.7, i % 5 == 0 ? 30 : 6);
        auto [rows, psi] = fixed_of(s);
        jipda(rows, psi);
        CHECK(largest_error<Real>(rows, psi, by_listing(s)) <= 2e-3);
        for (const auto& row : rows) {
            double sum = row.missed.raw();
            for (const auto& c : row.candidates()) sum += c.beta.raw();
            DOUBLES_EQUAL(4194304, sum, 4194);
        }
    }
}

TEST(Jipda, CertainExistenceIsJpda) {
    std::mt19937 random(13);  // NOLINT
    Scene a = random_scene(random, 4, 6, 0.8, 4);
    for (double& psi : a.existence) psi = 1;
    Scene b = a;
    jipda(a.rows, a.existence);
    const auto work = std::make_unique<tracking::JpdaWorkspace<double>>();
    tracking::jpda<double>(b.rows, *work);
    for (std::size_t t = 0; t < 4; ++t) {
        DOUBLES_EQUAL(1, a.existence[t], 1e-12);
        DOUBLES_EQUAL(b.rows[t].missed, a.rows[t].missed, 1e-12);
    }
}

TEST(Jipda, IsTheFullLevelOfTheIterativeForm) {
    std::mt19937 random(14);  // NOLINT
    const auto iterative = std::make_unique<tracking::IjipdaWorkspace<double>>();
    for (int i = 0; i < 30; ++i) {
        Scene a = random_scene(random, 6, 9, 0.5, 6);
        Scene b = a;
        LONGS_EQUAL(0, jipda(a.rows, a.existence).approximated);
        tracking::ijipda<double>(b.rows, b.existence, {.level = 5, .budget = 100'000'000}, *iterative);
        for (std::size_t t = 0; t < 6; ++t) {
            DOUBLES_EQUAL(a.existence[t], b.existence[t], 1e-12);
            for (std::size_t c = 0; c < static_cast<std::size_t>(a.rows[t].count); ++c)
                DOUBLES_EQUAL(a.rows[t].item[c].beta, b.rows[t].item[c].beta, 1e-12);
        }
    }
}

TEST(Jipda, AbsentTargetsAndCertainOnes) {
    Scene s = scene_of(0.9, {0, 1, .5}, {{1, 2}, {1, 2}, {0, 0}});
    const auto expected = by_listing(s);
    jipda(s.rows, s.existence);
    DOUBLES_EQUAL(0, s.existence[0], 1e-15);
    DOUBLES_EQUAL(1, s.existence[1], 1e-15);
    DOUBLES_EQUAL(1 - expected[2].absent, s.existence[2], 1e-15);
    DOUBLES_EQUAL(expected[1].missed, s.rows[1].missed, 1e-12);
}

namespace {
/// For PCs: 12 tracks with 64 shared measurements, 14 with 16.
constexpr tracking::JpdaCapacity kLarge{.items = 14, .table = 1 << 18};
}  // namespace

TEST(Jipda, LargeCapacityIsExactToo) {
    std::mt19937 random(15);  // NOLINT
    const auto large = std::make_unique<tracking::JpdaWorkspace<double, kLarge>>();
    const auto iterative = std::make_unique<tracking::IjipdaWorkspace<double>>();
    for (int i = 0; i < 10; ++i) {
        Scene a = random_scene(random, 10, 12, 0.3, 4);
        Scene b = a;
        LONGS_EQUAL(0, tracking::jipda<double>(a.rows, a.existence, *large).approximated);
        tracking::ijipda<double>(b.rows, b.existence, {.level = 9, .budget = 100'000'000}, *iterative);
        for (std::size_t t = 0; t < 10; ++t) DOUBLES_EQUAL(b.existence[t], a.existence[t], 1e-12);
    }
}

// The cluster of the 2020 paper, whose full level takes 1429 ms.
TEST(Jipda, TenTracksTwentyEightMeasurementsExactly) {
    std::mt19937 random(7);  // NOLINT
    const Scene s = random_scene(random, 10, 28, 0.25, 3);
    const auto large = std::make_unique<tracking::JpdaWorkspace<double, kLarge>>();
    double best_ms = 1e9;
    for (int i = 0; i < 5; ++i) {
        Scene a = s;
        const auto start = std::chrono::steady_clock::now();
        const tracking::JpdaStatus status = tracking::jipda<double>(a.rows, a.existence, *large);
        best_ms = std::min(
            best_ms,
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
        LONGS_EQUAL(0, status.approximated);
        LONGS_EQUAL(10, status.largest);
    }
    Scene small = s;
    LONGS_EQUAL(1, jipda(small.rows, small.existence).approximated);  // refused by the capacity of the radar
    std::printf("\n  10 tracks x 28 measurements, exact: %.3f ms (the paper's full level: 1429 ms)\n  ",
                best_ms);
}
