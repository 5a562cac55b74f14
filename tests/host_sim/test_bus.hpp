/// A small radar for the tests of what listens to one: sends whole, sound cycles; the test then breaks them.
#pragma once

#include <cstdint>
#include <vector>

#include "can/transmitter.hpp"

struct TestBus {
    struct Timed {
        std::uint64_t time_us;
        can::Frame frame;
    };

    can::Transmitter transmitter;
    std::uint8_t cycle = 0;
    std::uint64_t time_us = 0;

    /// Status, warning, list with `objects` objects, and the version every ten cycles; 0.1 s later than the
    /// last.
    std::vector<Timed> next_cycle(std::uint8_t objects, std::uint16_t faults = 0) {
        time_us += 100'000;
        ++cycle;
        std::vector<Timed> frames;
        const auto add = [&](const can::Frame& frame) { frames.push_back({time_us, frame}); };
        const bool valid = faults == 0;
        add(transmitter.frame(can::Status{.mode = valid ? can::Mode::operating : can::Mode::failed,
                                          .faults = faults,
                                          .cycle = cycle,
                                          .detections = objects}));
        add(transmitter.frame(can::CollisionWarning{.valid = valid,
                                                    .level = can::WarningLevel::warn,
                                                    .track_id = 3,
                                                    .time_to_collision_ms = 2310,
                                                    .required_deceleration_mmps2 = 4200,
                                                    .cycle = cycle}));
        add(transmitter.frame(can::ObjectListHeader{.count = objects, .cycle = cycle, .valid = valid}));
        for (std::uint8_t i = 0; i < objects; ++i) add(transmitter.kinematics(object(i)));
        for (std::uint8_t i = 0; i < objects; ++i) add(transmitter.quality(object(i)));
        if (cycle % 10 == 1) add(transmitter.frame(can::Version{.major = 1, .minor = 2, .patch = 3}));
        return frames;
    }

    can::Object object(std::uint8_t index) const {
        can::Object object;
        object.index = index;
        object.cycle = cycle;
        object.track_id = static_cast<std::uint8_t>(3 + index);
        object.range_mm = 45200 + 10000 * index;
        object.range_rate_mmps = -10050;
        object.motion = can::Motion::oncoming;
        object.coasting = index == 1;
        object.range_sigma_mm = 120;
        object.range_rate_sigma_mmps = 40;
        object.existence_percent = 99;
        object.snr_cdb = 3150;
        object.age_cycles = 45;
        return object;
    }
};
