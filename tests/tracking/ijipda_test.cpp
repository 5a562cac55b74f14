// Expected values: listing of all joint events, and hand-checked vectors of the formulas (six printed
// digits).
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <span>
#include <vector>

#include "tests/tracking/existence_scenes.hpp"
#include "tracking/ijipda.hpp"
#include "tracking/ipda.hpp"
#include "tracking/jipda.hpp"
#include "tracking/lm_ipda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using existence_scenes::by_listing;
using existence_scenes::fixed_of;
using existence_scenes::largest_error;
using existence_scenes::random_scene;
using existence_scenes::Scene;
using existence_scenes::scene_of;
using tracking::AssociationRow;
using tracking::IjipdaConfig;
using tracking::IjipdaStatus;

namespace {
template <class S>
IjipdaStatus ijipda(std::vector<AssociationRow<S>>& rows, std::vector<S>& psi, int level,
                    std::uint32_t budget = 100'000'000) {
    const auto work = std::make_unique<tracking::IjipdaWorkspace<S>>();
    return tracking::ijipda<S>(rows, psi, IjipdaConfig{.level = level, .budget = budget}, *work);
}
Scene vector_scene() {
    return scene_of(0.8, {.9, .6, .3}, {{2, 1, .5}, {1, 3, 0}, {0, 2, 1}});
}
void check_psi(std::vector<double> expected, const std::vector<double>& psi) {
    for (std::size_t i = 0; i < expected.size(); ++i) DOUBLES_EQUAL(expected[i], psi[i], 6e-7);
}
}  // namespace

TEST_GROUP(Ijipda){};

TEST(Ijipda, PrintedVectors) {
    const std::vector<std::vector<double>> expected{
        {.964286, .836066, .527027}, {.949620, .740544, .386731}, {.947480, .732940, .357388}};
    for (int level = 0; level < 3; ++level) {
        Scene s = vector_scene();
        const IjipdaStatus status = ijipda(s.rows, s.existence, level);
        check_psi(expected[static_cast<std::size_t>(level)], s.existence);
        LONGS_EQUAL(level == 2 ? tracking::kMaxLevel : level, status.level);
        LONGS_EQUAL(0, status.limited);
    }
    Scene s = vector_scene();
    ijipda(s.rows, s.existence, 2);
    const std::vector<double> beta{.604013, .136679, .159532};
    DOUBLES_EQUAL(.099776, s.rows[0].missed, 6e-7);
    for (std::size_t c = 0; c < 3; ++c) DOUBLES_EQUAL(beta[c], s.rows[0].item[c].beta, 6e-7);
}

TEST(Ijipda, PrintedVectorOfTheModulatedClutter) {
    const Scene s = vector_scene();
    const auto work = std::make_unique<tracking::IjipdaWorkspace<double>>();
    std::vector<AssociationRow<double>> rows = s.rows;
    std::vector<double> psi = s.existence;
    // Only track 1 has a level to reach: the last root evaluated leaves its modulation, so it goes last.
    std::rotate(rows.begin(), rows.begin() + 1, rows.end());
    std::rotate(psi.begin(), psi.begin() + 1, psi.end());
    tracking::ijipda<double>(rows, psi, IjipdaConfig{.level = 2, .budget = 1000}, *work);
    const std::vector<double> expected{1.321506, 2.92, 1.250857};
    for (std::size_t c = 0; c < 3; ++c) DOUBLES_EQUAL(expected[c], work->best[c], 6e-7);
}

TEST(Ijipda, LmIpdaPrintedVector) {
    Scene s = vector_scene();
    const auto work = std::make_unique<tracking::LmWorkspace<double>>();
    tracking::lm_ipda<double>(s.rows, s.existence, *work);
    check_psi({.952675, .749725, .391248}, s.existence);
}

TEST(Ijipda, LevelZeroIsIpda) {
    std::mt19937 random(2);  // NOLINT
    for (int i = 0; i < 200; ++i) {
        Scene a = random_scene(random, 1 + i % 8, i % 14, 0.6, 8);
        Scene b = a;
        const IjipdaStatus status = ijipda(a.rows, a.existence, 0, 0);  // even without any budget
        LONGS_EQUAL(0, status.limited);
        tracking::ipda<double>(b.rows, b.existence);
        for (std::size_t t = 0; t < a.rows.size(); ++t) {
            DOUBLES_EQUAL(b.existence[t], a.existence[t], 1e-12);
            DOUBLES_EQUAL(b.rows[t].missed, a.rows[t].missed, 1e-12);
            for (std::size_t c = 0; c < static_cast<std::size_t>(a.rows[t].count); ++c)
                DOUBLES_EQUAL(b.rows[t].item[c].beta, a.rows[t].item[c].beta, 1e-12);
        }
    }
}

TEST(Ijipda, FullLevelIsJipdaByListing) {
    std::mt19937 random(3);  // NOLINT
    for (int i = 0; i < 120; ++i) {
        const int tracks = 1 + i % 5;
        Scene s = random_scene(random, tracks, 1 + i % 6, i % 2 == 0 ? 1.0 : 0.5, 6);
        const auto expected = by_listing(s);
        const IjipdaStatus status = ijipda(s.rows, s.existence, tracks - 1);
        LONGS_EQUAL(tracking::kMaxLevel, status.level);
        CHECK(largest_error<double>(s.rows, s.existence, expected) <= 1e-12);
    }
}

TEST(Ijipda, FixedPointIsAsGood) {
    std::mt19937 random(4);  // NOLINT
    double worst = 0;
    for (int i = 0; i < 120; ++i) {
        const int tracks = 1 + i % 5;
        const Scene s = random_scene(random, tracks, 1 + i % 6, 0.8, i % 3 == 0 ? 40 : 8);
        auto [rows, psi] = fixed_of(s);
        ijipda(rows, psi, tracks - 1);
        worst = std::max(worst, largest_error<Real>(rows, psi, by_listing(s)));
    }
    CHECK(worst < 1e-5);
}

TEST(Ijipda, ErrorFallsWithTheLevel) {
    std::mt19937 random(5);  // NOLINT
    std::vector<double> mean(5);
    for (int i = 0; i < 60; ++i) {
        const Scene s = random_scene(random, 5, 7, 0.7, 3);
        const auto expected = by_listing(s);
        for (int level = 0; level < 5; ++level) {
            Scene a = s;
            ijipda(a.rows, a.existence, level);
            mean[static_cast<std::size_t>(level)] +=
                largest_error<double>(a.rows, a.existence, expected) / 60;
        }
    }
    std::printf("\n  mean of the largest error by level: %.3f %.3f %.4f %.5f %.1e\n  ", mean[0], mean[1],
                mean[2], mean[3], mean[4]);
    for (std::size_t level = 1; level < 5; ++level) CHECK(mean[level] < mean[level - 1]);
}

TEST(Ijipda, BudgetBoundsTheWorkAndIsReported) {
    std::mt19937 random(6);                           // NOLINT
    Scene s = random_scene(random, 32, 64, 0.25, 5);  // the largest rows there are
    const Scene again = s;
    IjipdaStatus status = ijipda(s.rows, s.existence, tracking::kMaxLevel, 10'000);
    LONGS_EQUAL(32, status.limited);
    CHECK(status.level >= 1 && status.level < 6);
    CHECK(status.visits < 32 * 10'100);
    // What a smaller level gives is what asking for it gives.
    Scene low = again;
    ijipda(low.rows, low.existence, status.level);
    int equal = 0;
    for (std::size_t t = 0; t < 32; ++t) equal += low.existence[t] == s.existence[t] ? 1 : 0;
    CHECK(equal >= 1);
}

TEST(Ijipda, DegenerateRows) {
    std::vector<AssociationRow<double>> none;
    std::vector<double> no_psi;
    ijipda(none, no_psi, 3);
    // Two certain, certainly detected targets, one measurement: one has it, the other cannot exist; by
    // symmetry the numbers must stay numbers.
    Scene s = scene_of(1.0, {1, 1}, {{1}, {1}});
    ijipda(s.rows, s.existence, 1);
    for (std::size_t t = 0; t < 2; ++t)
        CHECK(s.existence[t] >= 0 && s.existence[t] <= 1 && s.rows[t].missed >= 0);
    auto [rows, psi] = fixed_of(scene_of(0.9, {0, 1}, {{1, 2}, {1, 2}}));
    ijipda(rows, psi, 1);
    LONGS_EQUAL(0, psi[0].raw());
    LONGS_EQUAL(Real(1).raw(), psi[1].raw());
}

// The cluster of the 2020 paper: 10 tracks, 28 measurements, a quarter of the pairs gated. The paper needs 51
// ms at level 4 and 1429 ms at full level.
TEST(Ijipda, TenTracksTwentyEightMeasurements) {
    std::mt19937 random(7);  // NOLINT
    const Scene s = random_scene(random, 10, 28, 0.25, 3);
    using clock = std::chrono::steady_clock;
    const auto work = std::make_unique<tracking::IjipdaWorkspace<double>>();
    std::printf("\n");
    for (int level = 0; level <= 4; ++level) {
        double best_ms = 1e9;
        IjipdaStatus status;
        for (int i = 0; i < 5; ++i) {
            Scene a = s;
            const auto start = clock::now();
            status =
                tracking::ijipda<double>(a.rows, a.existence, {.level = level, .budget = 1'000'000}, *work);
            best_ms =
                std::min(best_ms, std::chrono::duration<double, std::milli>(clock::now() - start).count());
        }
        std::printf("  level %d: %.3f ms, %llu visits\n", level, best_ms,
                    static_cast<unsigned long long>(status.visits));
        LONGS_EQUAL(0, status.limited);
        if (level == 3) CHECK(status.visits < 50'000);  // 5 ms at 100 ns a visit
    }
    Scene a = s;
    const IjipdaStatus full = tracking::ijipda<double>(
        a.rows, a.existence, {.level = tracking::kMaxLevel, .budget = 50'000}, *work);
    std::printf("  full asked, 50000 visits a track: level %d, %d tracks short of it\n", full.level,
                full.limited);
    CHECK(full.level >= 3);
}
