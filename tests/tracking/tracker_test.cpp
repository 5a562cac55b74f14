#include <array>
#include <span>
#include <vector>

#include "tracking/collision_warning.hpp"
#include "tracking/tracker.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::constant;
using tracking::Measurement;
using tracking::Tracker;
using tracking::TrackerConfig;
using tracking::TrackState;

namespace {
template <class S>
Measurement<S> at(int range_cm, int rate_cmps) {
    Measurement<S> m;
    m.z = {constant<S>(range_cm, 100), constant<S>(rate_cmps, 100)};
    m.variance = {constant<S>(9, 100), constant<S>(4, 1000)};
    m.snr_db = S(20);
    return m;
}

template <class S>
void follows_one_target() {
    Tracker<S> tracker{TrackerConfig<S>{}};
    for (int frame = 0; frame < 50; ++frame) {
        const std::array<Measurement<S>, 1> m{at<S>(10000 - 100 * frame, -1000)};
        const auto report = tracker.step(m);
        LONGS_EQUAL(frame == 1 ? 1 : 0, report.initiated);
        LONGS_EQUAL(frame == 2 ? 1 : 0, report.confirmed);
        LONGS_EQUAL(frame == 0 ? 0 : 1, tracker.tracks().size());
    }
    const auto& t = tracker.tracks()[0];
    CHECK(t.state == TrackState::confirmed);
    LONGS_EQUAL(1, t.id);
    CHECK(tracking::absolute(S(t.x[0] - S(51))) < constant<S>(1, 100));
    CHECK(tracking::absolute(S(t.x[1] + S(10))) < constant<S>(1, 100));
}
}  // namespace

TEST_GROUP(Tracker){};

TEST(Tracker, FollowsOneTarget) {
    follows_one_target<double>();
    follows_one_target<Real>();
}
