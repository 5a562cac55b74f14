#include "firmware/health.hpp"

#include <algorithm>

namespace firmware {

namespace {

constexpr std::uint16_t bit(can::Fault fault) {
    return static_cast<std::uint16_t>(fault);
}

/// With one of these set the radar may be blind, so its object list says nothing about the road.
constexpr std::uint16_t kBlinding = bit(can::Fault::adc_dead) | bit(can::Fault::adc_stuck) |
                                    bit(can::Fault::frame_missing) | bit(can::Fault::frame_invalid) |
                                    bit(can::Fault::blocked) | bit(can::Fault::internal);

}  // namespace

bool Health::inspect(const dsp::FrameQuality& quality) {
    frame_bits_ = 0;
    const auto set_if = [this](bool condition, can::Fault fault) {
        if (condition) frame_bits_ = static_cast<std::uint16_t>(frame_bits_ | bit(fault));
    };
    equal_frames_ = cycles_ > 0 && quality.hash == last_hash_ ? std::min(equal_frames_ + 1, kNever) : 1;
    last_hash_ = quality.hash;
    const bool stuck = quality.stuck() || equal_frames_ >= config_.stuck_frames;
    const bool unusable = quality.saturated >= config_.unusable_samples;
    set_if(quality.dead(), can::Fault::adc_dead);
    set_if(!quality.dead() && stuck, can::Fault::adc_stuck);
    set_if(quality.saturated >= config_.saturated_samples, can::Fault::adc_saturated);
    set_if(unusable, can::Fault::frame_invalid);
    return !quality.dead() && !stuck && !unusable;
}

void Health::update(const CycleObservation& cycle) {
    std::uint16_t now = frame_bits_;
    frame_bits_ = 0;
    const auto set_if = [&now](bool condition, can::Fault fault) {
        if (condition) now = static_cast<std::uint16_t>(now | bit(fault));
    };

    set_if(cycle.beat == hal::BeatResult::missing || cycle.frames_lost != 0, can::Fault::frame_missing);
    set_if(cycle.beat == hal::BeatResult::invalid, can::Fault::frame_invalid);
    set_if(cycle.over_capacity, can::Fault::over_capacity);
    set_if(cycle.overrun, can::Fault::overrun);
    set_if(cycle.internal_error, can::Fault::internal);

    const std::uint32_t losses = cycle.can.dropped + cycle.can.receive_overflow + cycle.can.bus_off;
    if (cycles_ == 0) can_losses_ = losses;  // the port counts since power-on, health since start or restart
    set_if(losses != can_losses_ || cycle.can_state != hal::CanState::active, can::Fault::can_error);
    can_losses_ = losses;

    ego_age_ = cycle.ego_received ? 0 : std::min(ego_age_ + 1, kNever);
    set_if(!ego_valid(), can::Fault::ego_stale);

    // Noise alone is taken for an echo now and then, so one sight does not clear what many blind cycles added
    // up.
    const bool moving = ego_valid() && cycle.ego_speed_mmps >= config_.blocked_speed_mmps;
    if (!moving) {
        blind_cycles_ = 0;
    } else if (cycle.strongest_snr_cdb >= config_.blocked_snr_cdb) {
        blind_cycles_ = std::max(blind_cycles_ - config_.sight_worth_cycles, 0);
    } else if (cycle.detected) {
        blind_cycles_ = std::min(blind_cycles_ + 1, 2 * config_.blocked_cycles);
    }
    set_if(blind_cycles_ >= config_.blocked_cycles, can::Fault::blocked);

    if (cycle.detected) {
        const int noise = cycle.noise_log2_q10;
        if (noise_level_q10_ < 0) noise_level_q10_ = noise;
        set_if(noise - noise_level_q10_ >= config_.interference_octaves_q10, can::Fault::interference);
        // The running level follows within about 3 s, but one burst moves it by no more than 1/32 octave.
        noise_level_q10_ += std::clamp((noise - noise_level_q10_) / 32, -32, 32);
    }

    for (int i = 0; i < kFaults; ++i) {
        auto& hold = hold_[static_cast<std::size_t>(i)];
        if ((now >> i & 1) != 0) {
            hold = static_cast<std::uint8_t>(config_.hold_cycles);
        } else if (hold > 0) {
            --hold;
        }
        const auto mask = static_cast<std::uint16_t>(1U << i);
        faults_ = static_cast<std::uint16_t>(hold > 0 ? faults_ | mask : faults_ & ~mask);
    }
    seen_ = static_cast<std::uint16_t>(seen_ | faults_);
    cycles_ = std::min(cycles_ + 1, kNever);
}

bool Health::output_valid() const {
    return cycles_ > 0 && (faults_ & kBlinding) == 0;
}

can::Mode Health::mode() const {
    if (cycles_ > 0 && !output_valid()) return can::Mode::failed;
    if (cycles_ <= config_.start_cycles) return can::Mode::starting;
    return faults_ == 0 ? can::Mode::operating : can::Mode::degraded;
}

}  // namespace firmware
