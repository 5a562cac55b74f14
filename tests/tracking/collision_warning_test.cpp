#include <array>

#include "tracking/collision_warning.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::CollisionWarning;
using tracking::CollisionWarningConfig;
using tracking::constant;
using tracking::Motion;
using tracking::Track;
using tracking::WarningLevel;

namespace {
template <class S>
Track<S> track(int range_m, int rate_mps, std::uint8_t id = 7) {
    Track<S> t;
    t.id = id;
    t.state = tracking::TrackState::confirmed;
    t.x = {S(range_m), S(rate_mps)};
    return t;
}
}  // namespace

TEST_GROUP(CollisionWarning){};

TEST(CollisionWarning, TimeAndDecelerationOfAClosingTrack) {
    CollisionWarning<Real> warning{CollisionWarningConfig<Real>{}};
    const std::array<Track<Real>, 1> tracks{track<Real>(41, -20)};
    const auto result = warning.step(tracks, {Real(30), true});
    // 41 / 20 = 2.05 s; 20^2 / (2 (41 - 1)) = 5 m/s^2.
    LONGS_EQUAL(2050, result.time_to_collision_s->in_units(1000));
    LONGS_EQUAL(5000, result.required_deceleration_mps2.in_units(1000));
    LONGS_EQUAL(7, result.track_id);
    CHECK(result.motion[0] == Motion::moving);
    CHECK(result.level == WarningLevel::none);  // one frame is not enough
    CHECK(warning.step(tracks, {Real(30), true}).level == WarningLevel::warn);
}
