// Expected values follow from HealthConfig's documented limits.
#include "firmware/health.hpp"

#include <CppUTest/TestHarness.h>

using can::Fault;
using firmware::CycleObservation;
using firmware::Health;
using firmware::HealthConfig;

namespace {

CycleObservation good_cycle() {
    CycleObservation c;
    c.beat = hal::BeatResult::ok;
    c.detected = true;
    c.noise_log2_q10 = 10 * 1024;
    c.strongest_snr_cdb = 2500;
    c.ego_received = true;
    c.ego_speed_mmps = 20'000;
    return c;
}

dsp::FrameQuality good_frame() {
    static std::uint32_t hash = 0;
    dsp::FrameQuality q;
    q.min = -100;
    q.max = 100;
    q.hash = ++hash;
    return q;
}

void run_cycles(Health& health, const CycleObservation& cycle, int times) {
    for (int i = 0; i < times; ++i) {
        CHECK(health.inspect(good_frame()));
        health.update(cycle);
    }
}

}  // namespace

TEST_GROUP(Health){};

TEST(Health, StartsThenOperates) {
    Health health;
    CHECK(!health.output_valid());
    CHECK(health.mode() == can::Mode::starting);
    run_cycles(health, good_cycle(), HealthConfig{}.start_cycles);
    CHECK(health.mode() == can::Mode::starting);
    run_cycles(health, good_cycle(), 1);
    CHECK(health.mode() == can::Mode::operating);
    CHECK(health.output_valid());
    LONGS_EQUAL(0, health.faults());
}

TEST(Health, EveryObservationSetsItsBitAndHoldsIt) {
    struct Case {
        Fault fault;
        bool blinding;
        void (*spoil)(CycleObservation&);
    };
    const Case cases[] = {
        {Fault::frame_missing, true, [](CycleObservation& c) { c.beat = hal::BeatResult::missing; }},
        {Fault::frame_missing, true, [](CycleObservation& c) { c.frames_lost = 1; }},
        {Fault::frame_invalid, true, [](CycleObservation& c) { c.beat = hal::BeatResult::invalid; }},
        {Fault::over_capacity, false, [](CycleObservation& c) { c.over_capacity = true; }},
        {Fault::overrun, false, [](CycleObservation& c) { c.overrun = true; }},
        {Fault::internal, true, [](CycleObservation& c) { c.internal_error = true; }},
        {Fault::can_error, false, [](CycleObservation& c) { c.can_state = hal::CanState::bus_off; }},
        {Fault::can_error, false, [](CycleObservation& c) { c.can_state = hal::CanState::passive; }},
        {Fault::interference, false, [](CycleObservation& c) { c.noise_log2_q10 = 13 * 1024; }},
    };
    for (const Case& item : cases) {
        Health health;
        run_cycles(health, good_cycle(), 10);
        CycleObservation bad = good_cycle();
        item.spoil(bad);
        run_cycles(health, bad, 1);
        LONGS_EQUAL(static_cast<int>(item.fault), health.faults());
        CHECK_EQUAL(!item.blinding, health.output_valid());
        CHECK(health.mode() == (item.blinding ? can::Mode::failed : can::Mode::degraded));
        run_cycles(health, good_cycle(), HealthConfig{}.hold_cycles - 1);
        CHECK(health.has(item.fault));
        run_cycles(health, good_cycle(), 1);
        LONGS_EQUAL(0, health.faults());
        LONGS_EQUAL(static_cast<int>(item.fault), health.faults_seen());
    }
}

TEST(Health, LostFramesOfTheBusAreNoticedOnce) {
    Health health;
    run_cycles(health, good_cycle(), 10);
    CycleObservation c = good_cycle();
    c.can.dropped = 7;
    run_cycles(health, c, 1);
    CHECK(health.has(Fault::can_error));
    run_cycles(health, c, HealthConfig{}.hold_cycles);  // the counter stays at 7
    LONGS_EQUAL(0, health.faults());
}

TEST(Health, DeadStuckAndClippedFramesAreKeptFromTheSignalProcessing) {
    Health health;
    run_cycles(health, good_cycle(), 10);

    dsp::FrameQuality dead = good_frame();
    dead.min = dead.max = 5;
    dead.repeated_chirps = 63;
    CHECK(!health.inspect(dead));
    health.update(good_cycle());
    LONGS_EQUAL(static_cast<int>(Fault::adc_dead), health.faults());
    CHECK(!health.output_valid());

    Health again;
    run_cycles(again, good_cycle(), 10);
    dsp::FrameQuality same = good_frame();
    CHECK(again.inspect(same));
    again.update(good_cycle());
    CHECK(!again.inspect(same));
    again.update(good_cycle());
    LONGS_EQUAL(static_cast<int>(Fault::adc_stuck), again.faults());

    Health clipped;
    run_cycles(clipped, good_cycle(), 10);
    dsp::FrameQuality some = good_frame();
    some.saturated = 100;
    CHECK(clipped.inspect(some));
    clipped.update(good_cycle());
    LONGS_EQUAL(static_cast<int>(Fault::adc_saturated), clipped.faults());
    CHECK(clipped.output_valid());
    dsp::FrameQuality most = good_frame();
    most.saturated = 1024;
    CHECK(!clipped.inspect(most));
    clipped.update(good_cycle());
    CHECK(clipped.has(Fault::frame_invalid));
    CHECK(!clipped.output_valid());
}

TEST(Health, EgoMotionGoesStale) {
    Health health;
    run_cycles(health, good_cycle(), 10);
    CycleObservation silent = good_cycle();
    silent.ego_received = false;
    run_cycles(health, silent, HealthConfig{}.ego_stale_cycles);
    CHECK(health.ego_valid());
    run_cycles(health, silent, 1);
    CHECK(!health.ego_valid());
    CHECK(health.has(Fault::ego_stale));
    CHECK(health.output_valid());

    Health never;
    run_cycles(never, silent, 1);
    CHECK(never.has(Fault::ego_stale));
}

TEST(Health, BlockedWhenNothingIsSeenWhileMoving) {
    const HealthConfig config;
    CycleObservation nothing = good_cycle();
    nothing.strongest_snr_cdb = config.blocked_snr_cdb - 1;

    Health moving;
    run_cycles(moving, nothing, config.blocked_cycles - 1);
    CHECK(!moving.has(Fault::blocked));
    run_cycles(moving, nothing, 1);
    CHECK(moving.has(Fault::blocked));
    CHECK(!moving.output_valid());

    Health standing;
    nothing.ego_speed_mmps = config.blocked_speed_mmps - 1;
    run_cycles(standing, nothing, 3 * config.blocked_cycles);
    CHECK(!standing.has(Fault::blocked));
}

TEST(Health, InterferenceIsARiseNotALevel) {
    Health health;
    CycleObservation c = good_cycle();
    for (int i = 0; i < 200; ++i) {  // one octave in 20 s: the front end warms up
        c.noise_log2_q10 = static_cast<std::uint16_t>(10 * 1024 + 5 * i);
        run_cycles(health, c, 1);
    }
    LONGS_EQUAL(0, health.faults());
    c.noise_log2_q10 = static_cast<std::uint16_t>(c.noise_log2_q10 + 4 * 1024);
    run_cycles(health, c, 1);
    CHECK(health.has(Fault::interference));
}
