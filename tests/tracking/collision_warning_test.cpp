// Expected values: kinematics by hand, beside each test.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tracking/collision_warning.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::CollisionWarning;
using tracking::CollisionWarningConfig;
using tracking::CollisionWarningResult;
using tracking::constant;
using tracking::EgoState;
using tracking::Motion;
using tracking::Track;
using tracking::WarningLevel;

namespace {
template <class S = Real>
Track<S> track(S range_m, S rate_mps, std::uint8_t id = 7) {
    Track<S> t;
    t.id = id;
    t.state = tracking::TrackState::confirmed;
    t.x = {range_m, rate_mps};
    return t;
}

struct Rig {
    CollisionWarning<Real> warning{CollisionWarningConfig<Real>{}};

    CollisionWarningResult<Real> step(Real range, Real rate, EgoState<Real> ego, std::uint8_t id = 7) {
        const std::array tracks{track(range, rate, id)};
        return warning.step(tracks, ego);
    }
    WarningLevel hold(int frames, Real range, Real rate, EgoState<Real> ego) {
        WarningLevel last = WarningLevel::none;
        for (int i = 0; i < frames; ++i) last = step(range, rate, ego).level;
        return last;
    }
};
const EgoState<Real> k30{Real(30), true};
}  // namespace

TEST_GROUP(CollisionWarning){};

TEST(CollisionWarning, TimeAndDecelerationOfAClosingTrack) {
    Rig rig;
    // 41 / 20 = 2.05 s; 20^2 / (2 (41 - 1)) = 5 m/s^2.
    const auto result = rig.step(Real(41), Real(-20), k30);
    LONGS_EQUAL(2050, result.time_to_collision_s->in_units(1000));
    LONGS_EQUAL(5000, result.required_deceleration_mps2.in_units(1000));
    LONGS_EQUAL(7, result.track_id);
    CHECK(result.motion[0] == Motion::moving);
    CHECK(result.level == WarningLevel::none);  // one frame is not enough
    CHECK(rig.step(Real(41), Real(-20), k30).level == WarningLevel::warn);
}

TEST(CollisionWarning, NothingClosesNothingIsSaid) {
    Rig rig;
    for (const int rate : {0, 5}) {
        const auto result = rig.step(Real(10), Real(rate), k30);
        LONGS_EQUAL(0, result.track_id);
        CHECK_FALSE(result.time_to_collision_s.has_value());
        CHECK(result.required_deceleration_mps2 == Real(0));
        CHECK(result.level == WarningLevel::none);
    }
    LONGS_EQUAL(0, rig.warning.step({}, k30).track_id);
}

TEST(CollisionWarning, ValuesAreLimitedNotWrapped) {
    Rig rig;
    CHECK(*rig.step(Real(500), constant<Real>(-11, 100), k30).time_to_collision_s == Real(100));
    CHECK(rig.step(constant<Real>(1, 2), Real(-20), k30).required_deceleration_mps2 == Real(100));
    CHECK(rig.step(Real(2), Real(-80), k30).required_deceleration_mps2 == Real(100));
    CHECK(*rig.step(Real(0), Real(-20), k30).time_to_collision_s == Real(0));
}

TEST(CollisionWarning, MotionClasses) {
    Rig rig;
    CHECK(rig.step(Real(80), Real(-30), k30).motion[0] == Motion::stationary);
    CHECK(rig.step(Real(80), Real(-28), k30).motion[0] ==
          Motion::stationary);  // within scale and sensor error
    CHECK(rig.step(Real(80), Real(-10), k30).motion[0] == Motion::moving);
    CHECK(rig.step(Real(80), Real(-50), k30).motion[0] == Motion::oncoming);
    CHECK(rig.step(Real(80), Real(-10), {Real(30), false}).motion[0] == Motion::unknown);
    // Reversing: what recedes at our speed stands.
    CHECK(rig.step(Real(20), Real(5), {Real(-5), true}, 8).motion[0] == Motion::stationary);
}

TEST(CollisionWarning, AVehicleSeenMovingIsStoppedLaterAGuardRailStaysStationary) {
    Rig rig;
    for (int i = 0; i < 5; ++i) rig.step(Real(80), Real(-10), k30);
    CHECK(rig.step(Real(80), Real(-30), k30).motion[0] == Motion::stopped);
    CHECK(rig.step(Real(80), Real(-30), k30, 9).motion[0] == Motion::stationary);
    // Its id given to another track later: nothing is remembered of the old one.
    CHECK(rig.step(Real(80), Real(-30), k30, 7).motion[0] == Motion::stationary);
    // A few frames of doubtful motion do not make a vehicle.
    rig.step(Real(80), Real(-25), k30, 7);
    CHECK(rig.step(Real(80), Real(-30), k30, 7).motion[0] == Motion::stationary);
}

TEST(CollisionWarning, GuardRailAndOncomingOnlyInform) {
    Rig rail;
    CHECK(rail.hold(20, Real(20), Real(-30), k30) == WarningLevel::inform);
    Rig oncoming;
    CHECK(oncoming.hold(20, Real(30), Real(-55), k30) == WarningLevel::inform);
    Rig unknown;
    CHECK(unknown.hold(20, Real(20), Real(-20), {Real(0), false}) == WarningLevel::inform);
    // The same geometry from a vehicle seen moving brakes, also when it stands by now.
    Rig vehicle;
    CHECK(vehicle.hold(20, Real(20), Real(-20), k30) == WarningLevel::brake);
    CHECK(vehicle.hold(20, Real(20), Real(-30), k30) == WarningLevel::brake);
    Rig bold;
    CollisionWarningConfig<Real> config;
    config.stationary_limit = WarningLevel::warn;
    bold.warning = CollisionWarning<Real>(config);
    CHECK(bold.hold(20, Real(20), Real(-30), k30) == WarningLevel::warn);
}

TEST(CollisionWarning, CreepingUpToABumperIsNoEmergency) {
    Rig rig;  // 1 m/s at 3 m: 3 s, but 0.25 m/s^2 is enough
    CHECK(rig.hold(20, Real(3), Real(-1), {Real(3), true}) == WarningLevel::none);
}

TEST(CollisionWarning, LevelsRiseInOrderDuringAnApproach) {
    Rig rig;
    WarningLevel last = WarningLevel::none;
    std::array<double, 4> first_time{};
    for (int frame = 0; frame < 75; ++frame) {  // 20 m/s closing from 150 m, nobody brakes
        const auto result = rig.step(Real(150) - Real(2) * frame, Real(-20), k30);
        CHECK(result.level >= last);
        if (result.level > last) {
            first_time[static_cast<std::size_t>(result.level)] =
                result.time_to_collision_s->in_units(1000) / 1000.0;
        }
        last = result.level;
    }
    CHECK(last == WarningLevel::brake);
    // Thresholds 4, 2.7 and 1.4 s, at most one frame late by the rise time and one by the frame grid.
    DOUBLES_EQUAL(3.85, first_time[1], 0.1);
    DOUBLES_EQUAL(2.55, first_time[2], 0.1);
    DOUBLES_EQUAL(1.25, first_time[3], 0.1);
}

TEST(CollisionWarning, LevelFallsLateAndWithHysteresis) {
    Rig rig;
    CHECK(rig.hold(5, Real(41), Real(-20), k30) == WarningLevel::warn);
    // 2.7 s / 0.8 = 3.375 s and 2.5 * 0.8 = 2 m/s^2 still hold the level: 60 m at 18 m/s is 3.33 s, 2.75
    // m/s^2.
    CHECK(rig.hold(30, Real(60), Real(-18), k30) == WarningLevel::warn);
    // 70 m at 18 m/s is 3.9 s: only inform, but not before five frames.
    CHECK(rig.hold(4, Real(70), Real(-18), k30) == WarningLevel::warn);
    CHECK(rig.hold(1, Real(70), Real(-18), k30) == WarningLevel::inform);
    CHECK(rig.hold(5, Real(70), Real(1), k30) == WarningLevel::none);
}

TEST(CollisionWarning, TheMostUrgentTrackIsNamed) {
    Rig rig;
    const std::array tracks{track(Real(100), Real(-20), 1), track(Real(30), Real(-15), 2),
                            track(Real(15), Real(-1), 3)};
    LONGS_EQUAL(2, rig.warning.step(tracks, k30).track_id);
    // A guard rail nearer than a vehicle: the vehicle is the higher level.
    const std::array mixed{track(Real(10), Real(-30), 4), track(Real(35), Real(-20), 5)};
    LONGS_EQUAL(5, rig.warning.step(mixed, k30).track_id);
}

TEST(CollisionWarning, TentativeTracksWarnNobody) {
    Rig rig;
    std::array tracks{track(Real(20), Real(-20))};
    tracks[0].state = tracking::TrackState::tentative;
    for (int i = 0; i < 5; ++i) {
        const auto result = rig.warning.step(tracks, k30);
        CHECK(result.level == WarningLevel::none);
        CHECK(result.motion[0] == Motion::unknown);
    }
}

TEST(CollisionWarning, FixedPointSaysWhatDoubleSays) {
    CollisionWarning<Real> fixed{CollisionWarningConfig<Real>{}};
    CollisionWarning<double> reference{CollisionWarningConfig<double>{}};
    for (int frame = 0; frame < 400; ++frame) {
        // Swings between closing at 25 m/s and opening at 10 m/s, 5 to 125 m.
        const int range_cm = 6500 + 6000 * ((frame * 37) % 200 - 100) / 100;
        const int rate_cmps = -750 + 1750 * ((frame * 13) % 80 - 40) / 40;
        const std::array a{track(constant<Real>(range_cm, 100), constant<Real>(rate_cmps, 100))};
        const std::array b{track(constant<double>(range_cm, 100), constant<double>(rate_cmps, 100))};
        const auto x = fixed.step(a, {Real(30), true});
        const auto y = reference.step(b, {30.0, true});
        CHECK(x.level == y.level);
        CHECK(x.motion == y.motion);
        LONGS_EQUAL(y.track_id, x.track_id);
        CHECK_EQUAL(y.time_to_collision_s.has_value(), x.time_to_collision_s.has_value());
        DOUBLES_EQUAL(y.required_deceleration_mps2, x.required_deceleration_mps2.raw() / 4194304.0, 1e-3);
        if (y.time_to_collision_s) {
            DOUBLES_EQUAL(*y.time_to_collision_s, x.time_to_collision_s->raw() / 4194304.0, 1e-3);
        }
    }
}

TEST(CollisionWarning, ConfigurationIsChecked) {
    CHECK(CollisionWarningConfig<Real>{}.valid());
    CHECK(CollisionWarningConfig<double>{}.valid());
    CollisionWarningConfig<Real> c;
    c.threshold[2].time_to_collision_s = Real(10);
    CHECK_FALSE(c.valid());
    c = {};
    c.hysteresis = Real(2);
    CHECK_FALSE(c.valid());
    c = {};
    c.rise_frames = 0;
    CHECK_FALSE(c.valid());
}
