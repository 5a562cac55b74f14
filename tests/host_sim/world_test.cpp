// Positions and rates worked by hand.
#include <algorithm>
#include <cmath>
#include <vector>

#include "host_sim/world.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(World) {
    sim::Scenario scenario;
    void setup() {
        scenario.duration_s = 10;
        scenario.ego = {0, 20, {}};
        scenario.front_end.field_of_view_deg = 90;
    }
    void add_target(double start_s, double range_m, double lateral_m, double speed_mps) {
        sim::TargetPlan t;
        t.range_m = range_m;
        t.lateral_m = lateral_m;
        t.motion = {start_s, speed_mps, {}};
        t.end_s = 8;
        scenario.targets.push_back(t);
    }
};

TEST(World, TimesOfFramesAndOfTheirMiddle) {
    const sim::World world(scenario, 1);
    LONGS_EQUAL(100, world.frames());
    DOUBLES_EQUAL(0.7, world.frame_start_s(7), 1e-12);
    DOUBLES_EQUAL(0.701024, world.frame_middle_s(7), 1e-12);
}

TEST(World, TargetsMoveRelativeToTheEgoCar) {
    add_target(2, 100, 0, 15);
    scenario.ego.acceleration_mps2 = {{4, -2}};
    const sim::World world(scenario, 1);
    LONGS_EQUAL(0, world.truth_at(1.9).size());
    LONGS_EQUAL(0, world.truth_at(8).size());
    // At 6 s: 4 s at -5 m/s, and the ego car has lost 2 x 2^2 / 2 = 4 m by braking to 16 m/s.
    const auto truth = world.truth_at(6);
    LONGS_EQUAL(1, truth.size());
    DOUBLES_EQUAL(84, truth[0].range_m, 1e-9);
    DOUBLES_EQUAL(-1, truth[0].range_rate_mps, 1e-9);
    DOUBLES_EQUAL(16, world.ego_at(6).speed_mps, 1e-12);
    DOUBLES_EQUAL(-2, world.ego_at(6).acceleration_mps2, 0);
    CHECK(truth[0].detectable);
}

TEST(World, ALateralOffsetTurnsTheRangeRateAndLeavesTheFieldOfView) {
    add_target(0, 40, 30, 0);
    const sim::World world(scenario, 1);
    auto truth = world.truth_at(0);
    DOUBLES_EQUAL(50, truth[0].range_m, 1e-9);
    DOUBLES_EQUAL(-16, truth[0].range_rate_mps, 1e-9);  // -20 * 40/50
    LONGS_EQUAL(1, world.truth_at(0.49).size());
    LONGS_EQUAL(0, world.truth_at(0.51).size());  // 45 degrees
}

TEST(World, OnlyWhatIsInsideTheMapAndStrongEnoughMustBeDetected) {
    add_target(0, 158, 0, 20);  // last cell
    add_target(0, 100, 0, 55);  // 35 m/s: ambiguous
    add_target(0, 100, 0, 20);
    scenario.targets.back().rcs_dbsm = -1;  // 19 dB
    add_target(0, 100, 0, 20);
    scenario.targets.back().rcs_dbsm = 1;  // 21 dB
    add_target(0, 4, 0, 20);               // first cell
    const auto truth = sim::World(scenario, 1).truth_at(0);
    LONGS_EQUAL(5, truth.size());
    CHECK(!truth[0].detectable);
    CHECK(!truth[1].detectable);
    CHECK(!truth[2].detectable);
    CHECK(truth[3].detectable);
    CHECK(!truth[4].detectable);
    DOUBLES_EQUAL(21, truth[3].snr_db, 1e-9);
}

TEST(World, PostsPassByAtMinusTheEgoSpeedAndKeepTheirIdentity) {
    scenario.guard_rail = sim::GuardRail{50, 3, 0};
    const sim::World world(scenario, 1);
    const auto early = world.truth_at(0);
    LONGS_EQUAL(3, early.size());
    DOUBLES_EQUAL(std::sqrt(2500 + 9.0), early[0].range_m, 1e-9);
    DOUBLES_EQUAL(-20 * 50 / std::sqrt(2509.0), early[0].range_rate_mps, 1e-9);
    CHECK(early[0].stationary && !early[0].detectable);
    const auto later = world.truth_at(3);  // 60 m on: the first is behind
    LONGS_EQUAL(early[1].id, later[0].id);
    DOUBLES_EQUAL(std::sqrt(1600 + 9.0), later[0].range_m, 1e-9);
}

TEST(World, SwerlingOnePowerIsExponentialAndFreshInEveryFrame) {
    add_target(0, 100, 0, 20);
    scenario.duration_s = 1000;
    scenario.targets[0].end_s = 1000;
    scenario.targets[0].fluctuation = sim::Fluctuation::swerling1;
    const sim::World world(scenario, 5);
    double mean = 0;
    int below_tenth = 0;
    constexpr int kFrames = 10000;
    for (int i = 0; i < kFrames; ++i) {
        const auto echoes = world.echoes(static_cast<std::uint64_t>(i));
        LONGS_EQUAL(1, echoes.size());
        mean += echoes[0].snr / kFrames;
        if (echoes[0].snr < 100) ++below_tenth;
    }
    DOUBLES_EQUAL(1000, mean, 50);  // 30 dB
    DOUBLES_EQUAL(1 - std::exp(-0.1), below_tenth / double{kFrames}, 0.015);
}

TEST(World, TheRoadIsSeenNearbyOnly) {
    scenario.road = sim::RoadSurface{};
    const sim::World world(scenario, 1);
    double near = 0;
    double far = 0;
    for (std::uint64_t i = 0; i < 200; ++i) {
        for (const auto& echo : world.echoes(i)) {
            DOUBLES_EQUAL(-20, echo.range_rate_mps, 1e-12);
            if (echo.range_m > 9 && echo.range_m < 11.5) near += echo.snr / 200;
            if (echo.range_m > 40 && echo.range_m < 45) far += echo.snr / 200;
        }
    }
    // Gamma model by hand: -30 dB x 0.5 m x 2.498 m x 0.1745 rad is -36.6 dBsm, 26.7 dB at 8 m to 20.9 dB at
    // 11 m.
    CHECK(near > 100 && near < 300);
    CHECK(far < 2);
}

TEST(World, FalseEchoesAreAsManyAsAskedForAndInsideTheMap) {
    scenario.false_echoes = {7, 20};
    const sim::World world(scenario, 1);
    double count = 0;
    for (std::uint64_t i = 0; i < 1000; ++i) {
        for (const auto& echo : world.echoes(i)) {
            ++count;
            CHECK(std::fabs(echo.range_rate_mps) < 30.5 && echo.range_m > 0 && echo.range_m < 163);
        }
    }
    DOUBLES_EQUAL(7, count / 1000, 5 * std::sqrt(7.0 / 1000));
}

TEST(World, RecordedTrafficTakesThePlaceOfTheTargets) {
    add_target(0, 100, 0, 20);
    const sim::World world(scenario, 1, {{3, {{0, 50, -2}, {1, 48, -2}}}, {4, {{0.5, 90, 1}, {2, 91.5, 1}}}},
                           {{0, 10}, {1, 11}});
    LONGS_EQUAL(20, world.frames());
    const auto truth = world.truth_at(0.5);
    LONGS_EQUAL(2, truth.size());
    DOUBLES_EQUAL(49, truth[0].range_m, 1e-12);
    DOUBLES_EQUAL(90, truth[1].range_m, 1e-12);
    DOUBLES_EQUAL(10.5, world.ego_at(0.5).speed_mps, 1e-12);
    DOUBLES_EQUAL(1, world.ego_at(0.5).acceleration_mps2, 1e-9);
}
