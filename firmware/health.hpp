/// Whether the output can be trusted: turns what each stage noticed in a cycle into fault bits that last long
/// enough to be seen on the bus.
#pragma once

#include <array>
#include <cstdint>

#include "can/messages.hpp"
#include "dsp/frame_quality.hpp"
#include "hal/contract/beat_source.hpp"
#include "hal/contract/can_port.hpp"

namespace firmware {

struct HealthConfig {
    int saturated_samples = 41;   ///< of 4096 in a frame; 1 %: more clips the strongest echo into false ones
    int unusable_samples = 1024;  ///< of 4096; from here the frame counts as invalid. Below it tracking goes
                                  ///< on: a truck close ahead clips a little and must not blind the radar
    int stuck_frames = 2;         ///< equal frames in a row; thermal noise never repeats 4096 samples
    int hold_cycles = 5;  ///< a fault bit stays this long after its cause, so that a slow consumer sees it
    int ego_stale_cycles = 5;                 ///< without a valid EgoMotion
    int blocked_speed_mmps = 5000;            ///< above this a radar that sees must see something
    int blocked_cycles = 50;                  ///< this long
    int sight_worth_cycles = 10;              ///< one sight outweighs so many cycles without
    int blocked_snr_cdb = 1500;               ///< echoes below this may be noise: 1 frame in 100 has one
    int interference_octaves_q10 = 2 * 1024;  ///< noise power over its running level: 2 octaves, 6 dB
    int start_cycles = 3;  ///< mode `starting` until the two-point start could have confirmed a track

    [[nodiscard]] constexpr bool valid() const {
        return saturated_samples > 0 && unusable_samples >= saturated_samples && stuck_frames > 0 &&
               hold_cycles > 0 && hold_cycles < 256 && ego_stale_cycles > 0 && blocked_speed_mmps > 0 &&
               blocked_cycles > 0 && sight_worth_cycles > 0 && blocked_snr_cdb > 0 &&
               interference_octaves_q10 > 0 && start_cycles >= 0;
    }
};
static_assert(HealthConfig{}.valid());

/// What happened in one cycle, as far as health is concerned.
struct CycleObservation {
    hal::BeatResult beat = hal::BeatResult::missing;
    std::uint32_t frames_lost = 0;     ///< gap in the front end's sequence
    dsp::FrameQuality quality;         ///< meaningful when beat is ok
    std::uint16_t noise_log2_q10 = 0;  ///< noise level of the power map, meaningful when it was computed
    bool detected = false;             ///< the signal processing ran on this frame
    int strongest_snr_cdb = 0;         ///< of all detections, 0 for none
    bool over_capacity = false;
    bool ego_received = false;  ///< a valid EgoMotion came in this cycle
    int ego_speed_mmps = 0;     ///< last known
    bool overrun = false;
    bool internal_error = false;
    hal::CanState can_state = hal::CanState::active;
    hal::CanCounters can;
};

class Health {
  public:
    explicit Health(const HealthConfig& config = {}) : config_(config) {}

    /// Notes what is wrong with a frame. False: dead, stuck or clipped beyond use, it must not reach the
    /// signal processing.
    [[nodiscard]] bool inspect(const dsp::FrameQuality& quality);
    /// Ends the cycle; call once, after inspect() if there was a frame.
    void update(const CycleObservation& cycle);

    [[nodiscard]] std::uint16_t faults() const { return faults_; }
    [[nodiscard]] bool has(can::Fault fault) const {
        return (faults_ & static_cast<std::uint16_t>(fault)) != 0;
    }
    /// False while a fault makes an object list no statement about the road.
    [[nodiscard]] bool output_valid() const;
    [[nodiscard]] bool ego_valid() const { return ego_age_ <= config_.ego_stale_cycles; }
    [[nodiscard]] can::Mode mode() const;
    /// Every fault bit ever set since start.
    [[nodiscard]] std::uint16_t faults_seen() const { return seen_; }

  private:
    static constexpr int kFaults = 12;
    static constexpr int kNever = 1 << 20;

    HealthConfig config_;
    std::array<std::uint8_t, kFaults> hold_{};
    std::uint16_t frame_bits_ = 0;
    std::uint16_t faults_ = 0;
    std::uint16_t seen_ = 0;
    std::uint32_t last_hash_ = 0;
    int equal_frames_ = 0;
    int ego_age_ = kNever;
    int blind_cycles_ = 0;
    int cycles_ = 0;
    int noise_level_q10_ = -1;
    std::uint32_t can_losses_ = 0;
};

}  // namespace firmware
