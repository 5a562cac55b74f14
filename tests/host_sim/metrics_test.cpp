// GOSPA and the life stories of tracks worked by hand.
#include <cmath>
#include <vector>

#include "host_sim/metrics.hpp"

#include <CppUTest/TestHarness.h>

namespace {

sim::TruthObject target(int id, double range, double rate = 0) {
    return {id, range, rate, 30, false, true};
}
sim::TruthObject post(int id, double range, double rate) {
    return {sim::kFirstPostId + id, range, rate, 30, true, false};
}

}  // namespace

TEST_GROUP(Metrics) {
    sim::Metrics metrics;
    double time_s = 0;
    void frames(int n, const std::vector<sim::TruthObject>& truth,
                const std::vector<sim::TrackEstimate>& tracks) {
        for (int i = 0; i < n; ++i, time_s += 0.1) metrics.add_frame(time_s, truth, tracks);
    }
};

TEST(Metrics, GospaOfOneNearOneMissedOneFalse) {
    // d = sqrt(3^2 + (2 x 2)^2) = 5; c = 10, p = 2: 25 + 50 + 50.
    const std::vector<sim::TruthObject> truth{target(1, 50, 0), target(2, 100)};
    const std::vector<sim::TrackEstimate> tracks{{7, 53, 2}, {8, 20, 0}};
    const auto g = metrics.gospa(truth, tracks, metrics.match(truth, tracks));
    DOUBLES_EQUAL(25, g.localisation, 1e-9);
    DOUBLES_EQUAL(50, g.missed, 1e-9);
    DOUBLES_EQUAL(50, g.false_tracks, 1e-9);
    DOUBLES_EQUAL(std::sqrt(125.0), g.distance, 1e-9);
}

TEST(Metrics, AssignmentIsOptimalAndNeverBeyondTheCutoff) {
    const std::vector<sim::TruthObject> truth{target(1, 50), target(2, 54)};
    const std::vector<sim::TrackEstimate> tracks{{7, 52, 0}, {8, 46, 0}, {9, 64.1, 0}};
    const auto m = metrics.match(truth, tracks);
    LONGS_EQUAL(1, m.track_of_truth[0]);
    LONGS_EQUAL(0, m.track_of_truth[1]);
    LONGS_EQUAL(-1, m.truth_of_track[2]);
}

TEST(Metrics, DelayRmseAndFalseTracks) {
    frames(3, {target(1, 50, -1)}, {});
    frames(7, {target(1, 50, -1)}, {{7, 50.3, -1.1}});
    frames(2, {target(1, 50, -1)}, {{7, 50.3, -1.1}, {9, 120, 0}});
    const auto s = metrics.summary();
    LONGS_EQUAL(12, s.frames);
    LONGS_EQUAL(1, s.targets);
    LONGS_EQUAL(2, s.confirmed_tracks);
    LONGS_EQUAL(1, s.false_tracks);
    LONGS_EQUAL(0, s.never_confirmed);
    DOUBLES_EQUAL(0.3, *s.first_confirmation_s, 1e-9);
    DOUBLES_EQUAL(0.3, s.range_rmse_m, 1e-9);
    DOUBLES_EQUAL(0.1, s.velocity_rmse_mps, 1e-9);
    LONGS_EQUAL(9, metrics.targets()[0].tracked_frames);
}

TEST(Metrics, ATrackOfAPostOrOfSomethingTooFaintIsNotFalse) {
    auto faint = target(2, 150);
    faint.detectable = false;
    frames(10, {post(3, 40, -20), faint}, {{7, 40.5, -20}, {8, 150, 0}});
    const auto s = metrics.summary();
    LONGS_EQUAL(0, s.targets);
    LONGS_EQUAL(2, s.confirmed_tracks);
    LONGS_EQUAL(0, s.false_tracks);
    LONGS_EQUAL(1, s.stationary_tracks);
    DOUBLES_EQUAL(0, s.gospa.distance, 1e-9);
    CHECK(!s.first_confirmation_s);
}

TEST(Metrics, ATrackThatOutlivesItsTargetForAWhileIsNotFalse) {
    frames(10, {target(1, 50)}, {{7, 50, 0}});
    frames(5, {}, {{7, 50, 0}});
    frames(1, {}, {});
    LONGS_EQUAL(0, metrics.summary().false_tracks);
}

TEST(Metrics, AnExchangeOfIdentitiesThatStaysCountsForBothAndABriefOneDoesNot) {
    const std::vector<sim::TruthObject> truth{target(1, 50), target(2, 52)};
    frames(10, truth, {{7, 50, 0}, {8, 52, 0}});
    frames(4, truth, {{8, 50, 0}, {7, 52, 0}});
    frames(10, truth, {{7, 50, 0}, {8, 52, 0}});
    LONGS_EQUAL(0, metrics.summary().id_switches);
    LONGS_EQUAL(2, metrics.summary().brief_id_switches);
    frames(10, truth, {{8, 50, 0}, {7, 52, 0}});
    LONGS_EQUAL(2, metrics.summary().id_switches);
    LONGS_EQUAL(0, metrics.summary().track_losses);
}

TEST(Metrics, ATrackThatEndsOrIsReplacedIsALoss) {
    frames(10, {target(1, 50)}, {{7, 50, 0}});
    frames(4, {target(1, 50)}, {});
    frames(10, {target(1, 50)}, {{7, 50, 0}});
    LONGS_EQUAL(0, metrics.summary().track_losses);
    frames(5, {target(1, 50)}, {});
    LONGS_EQUAL(1, metrics.summary().track_losses);
    frames(10, {target(1, 50)}, {{9, 50, 0}});
    LONGS_EQUAL(1, metrics.summary().track_losses);
    frames(10, {target(1, 50)}, {{10, 50, 0}});
    LONGS_EQUAL(2, metrics.summary().track_losses);
    LONGS_EQUAL(0, metrics.summary().id_switches);
}
