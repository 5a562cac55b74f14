// Expected: what the configuration promises on scenes of one and two targets.
#include <algorithm>
#include <cmath>
#include <vector>

#include "host_sim/plane_tracker.hpp"
#include "host_sim/random.hpp"

#include <CppUTest/TestHarness.h>

using sim::PlaneMeasurement;
using sim::PlaneTracker;
using sim::PlaneTrackerConfig;

namespace {
PlaneTrackerConfig pixels(tracking::Associator associator) {
    PlaneTrackerConfig c;
    c.motion = tracking::constant_velocity<double, 2>(1, 1);
    c.clutter_density = 1e-4;
    c.snr = 10;
    c.associator = associator;
    c.start_from = sim::StartFrom::untaken;
    return c;
}

/// Two targets in 400 x 200 pixels that pass at 6 pixels.
std::vector<PlaneMeasurement> crossing(int frame, sim::Random& random) {
    std::vector<PlaneMeasurement> out;
    for (const int way : {1, -1}) {
        if (random.uniform() > 0.95) continue;
        out.push_back(
            {{200 + way * (10.0 * frame - 100) + random.gaussian(), 100 + 3 * way + random.gaussian()},
             11 * random.exponential()});
    }
    for (int n = random.poisson(8); n > 0; --n)
        out.push_back({{400 * random.uniform(), 200 * random.uniform()}, random.exponential()});
    return out;
}
}  // namespace

TEST_GROUP(PlaneTracker){};

TEST(PlaneTracker, EveryAssociatorFollowsTwoTargetsThatCross) {
    using tracking::Associator;
    for (const Associator a : {Associator::ipda, Associator::lm_ipda, Associator::jipda, Associator::ijipda,
                               Associator::jihpda, Associator::lm_ihpda}) {
        int found = 0;
        for (std::uint64_t run = 0; run < 10; ++run) {
            PlaneTracker tracker(pixels(a));
            sim::Random random(5, 1, run);
            for (int frame = 0; frame <= 20; ++frame) tracker.step(crossing(frame, random));
            for (const int way : {1, -1}) {
                const tracking::Vec2<double> truth(200 + way * 100.0, 100 + 3 * way);
                found += std::any_of(tracker.tracks().begin(), tracker.tracks().end(),
                                     [&](const sim::PlaneTrack& t) {
                                         return t.confirmed && (t.x.head<2>() - truth).norm() < 5 &&
                                                std::abs(t.x[2] - 10 * way) < 3;
                                     })
                             ? 1
                             : 0;
            }
        }
        CHECK(found >= 18);
    }
}

TEST(PlaneTracker, NonparametricDensityConfirmsTheSameTarget) {
    PlaneTrackerConfig config = pixels(tracking::Associator::jipda);
    config.nonparametric = true;
    PlaneTracker tracker(config);
    for (int k = 0; k < 10; ++k) {
        const std::vector<PlaneMeasurement> m{{{10.0 * k, 50}, 20}};
        tracker.step(m);
    }
    LONGS_EQUAL(1, tracker.tracks().size());
    CHECK(tracker.tracks()[0].confirmed);
}

TEST(PlaneTracker, NothingInNothingOut) {
    PlaneTracker tracker(pixels(tracking::Associator::jipda));
    for (int k = 0; k < 3; ++k) LONGS_EQUAL(0, tracker.step({}).tracks);
    const std::vector<PlaneMeasurement> one{{{1, 1}, 1}};
    tracker.step(one);
    tracker.step(one);
    LONGS_EQUAL(1, tracker.tracks().size());
    for (int k = 0; k < 10; ++k) tracker.step({});
    LONGS_EQUAL(0, tracker.tracks().size());
}

TEST(PlaneTracker, MoreTracksThanASolverTakesAreSplitAndReported) {
    PlaneTrackerConfig config = pixels(tracking::Associator::ijipda);
    config.start = sim::TrackStart::one_point;
    config.merge = 0;
    PlaneTracker tracker(config);
    std::vector<PlaneMeasurement> crowd;
    for (int i = 0; i < 80; ++i) crowd.push_back({{2.0 * (i % 10), 2.0 * (i / 10)}, 5});
    tracker.step(crowd);
    const sim::PlaneReport report = tracker.step(crowd);
    CHECK(report.split > 0);
    CHECK(report.cluster_tracks > tracking::kMaxTracks);
    CHECK(report.cluster_measurements > 40);
    for (const auto& t : tracker.tracks())
        CHECK(t.existence >= 0 && t.existence <= 1 && std::isfinite(t.x.norm()));
}
