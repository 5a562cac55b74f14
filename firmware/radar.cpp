#include "firmware/radar.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "dsp/fixed_math.hpp"
#include "firmware/version.hpp"
#include "tracking/scratch.hpp"

namespace firmware {

namespace {

/// Frames read from the bus in one cycle at most: a babbling node must not eat the period. Two are expected.
constexpr int kMaxReceivedPerCycle = 64;
constexpr int kVersionEveryCycles = 10;

std::int32_t centi(Real v) {
    return v.in_units(100);
}
std::int32_t milli(Real v) {
    return v.in_units(1000);
}
/// The standard deviation in thousandths, within 1 + 2^-15 of it: all that is sent of it.
std::uint32_t sigma_milli(Real variance) {
    static_assert(Real::fraction_bits % 2 == 0);
    if (variance.raw() <= 0) return 0;
    const auto raw = static_cast<std::uint32_t>(variance.raw());
    const int up = std::countl_zero(raw) & ~1;
    const std::uint32_t root = dsp::detail::root_of_upper(raw << up);  // 16 bits
    const int down = (Real::fraction_bits + up) / 2;
    return (root * 1000 + (1U << down >> 1)) >> down;
}

}  // namespace

Radar::Radar(const RadarConfig& config, const hal::Board& board)
    : initial_{config.tracker.associator, config.dsp.cfar.offset_cdb, config.dsp.peaks.min_snr_cdb},
      config_(config),
      scale_(config.waveform.scale()),
      board_(board),
      tracker_(config.tracker),
      collision_(config.warning),
      health_(config.health),
      period_us_(static_cast<std::uint64_t>(config.waveform.period_ms) * 1000) {}

void Radar::start() {
    next_start_us_ = board_.clock.now_us();
    board_.watchdog.start();
}

void Radar::reset_state() {
    config_.tracker.associator = initial_.associator;
    config_.dsp.cfar.offset_cdb = initial_.cfar_offset_cdb;
    config_.dsp.peaks.min_snr_cdb = initial_.min_snr_cdb;
    tracker_.configure(config_.tracker);
    collision_.reset();
    health_ = Health(config_.health);
    // After a restart nothing may depend on what the bus said before: whoever sent the command starts anew
    // too.
    receiver_ = can::Receiver{};
    transmitter_ = {};
    warning_ = {};
    counters_ = {};
    ego_speed_mmps_ = 0;
    cycle_ = 0;
    sequence_known_ = false;
    restart_due_ = false;
}

bool Radar::run_cycle() {
    begin_cycle();
    acquire_and_detect();
    if (observation_.beat == hal::BeatResult::ended) return false;
    finish_cycle();
    return true;
}

void Radar::run_cycle(const dsp::DetectionList& detections) {
    begin_cycle();
    detections_ = detections;
    observation_.beat = hal::BeatResult::ok;
    finish_cycle();
}

void Radar::begin_cycle() {
    observation_ = {};
    const std::uint64_t now = board_.clock.now_us();
    // A beat source that waited in vain returns at the end of the period: a tenth late is not yet an overrun.
    if (now > next_start_us_ + period_us_ / 10) {
        ++counters_.overruns;
        observation_.overrun = true;
        next_start_us_ += (now - next_start_us_) / period_us_ * period_us_;  // stay on the time grid
    }
    board_.clock.wait_until(next_start_us_);
    next_start_us_ += period_us_;
    board_.can.begin_cycle();
    read_bus();
    if (restart_due_) reset_state();
}

void Radar::read_bus() {
    can::Frame frame;
    for (int i = 0; i < kMaxReceivedPerCycle && board_.can.receive(frame); ++i) {
        switch (frame.id) {
            case can::ego::kMessage.id: {
                can::EgoMotion ego;
                if (can::is_good(receiver_.receive(frame, ego)) && ego.valid) {
                    observation_.ego_received = true;
                    ego_speed_mmps_ = ego.speed_mmps;
                }
                break;
            }
            case can::command::kMessage.id: {
                can::Command command;
                if (can::is_good(receiver_.receive(frame, command))) {
                    answer(command);
                }
                break;
            }
            default:
                receiver_.ignore();
        }
    }
}

void Radar::answer(const can::Command& command) {
    if (echoes_ == echo_.size()) {
        // Nothing is done that could not be answered.
        ++counters_.commands_refused;
        return;
    }
    const can::CommandResult result = apply(command);
    if (result != can::CommandResult::applied) ++counters_.commands_refused;
    echo_[echoes_++] = {command.code, result, command.sequence, value_in_force(command.code)};
}

can::CommandResult Radar::apply(const can::Command& command) {
    using can::CommandCode;
    using can::CommandResult;
    switch (command.code) {
        case CommandCode::set_tracker: {
            if (command.value < 0 || command.value > 255) return CommandResult::value_out_of_range;
            tracking::TrackerConfig<Real> tracker = config_.tracker;
            tracker.associator = static_cast<tracking::Associator>(command.value);
            if (!tracker.valid()) return CommandResult::value_out_of_range;
            config_.tracker = tracker;
            tracker_.configure(tracker);
            collision_.reset();
            return CommandResult::applied;
        }
        case CommandCode::set_cfar_scale: {
            // Hundredths of a decibel on top of the configured threshold.
            if (command.value < -300 || command.value > 2000) return CommandResult::value_out_of_range;
            config_.dsp.cfar.offset_cdb = static_cast<std::int16_t>(command.value);
            return CommandResult::applied;
        }
        case CommandCode::set_min_snr: {
            if (command.value < 0 || command.value > 4000) return CommandResult::value_out_of_range;
            config_.dsp.peaks.min_snr_cdb = static_cast<std::int16_t>(command.value);
            return CommandResult::applied;
        }
        case CommandCode::reset_tracks:
            if (command.value != 0) return CommandResult::value_out_of_range;
            tracker_.reset();
            collision_.reset();
            return CommandResult::applied;
        case CommandCode::restart:
            if (command.value != 0) return CommandResult::value_out_of_range;
            restart_due_ = true;
            return CommandResult::applied;
        case CommandCode::none:
            break;
    }
    return CommandResult::unknown_command;
}

std::int32_t Radar::value_in_force(can::CommandCode code) const {
    switch (code) {
        case can::CommandCode::set_tracker:
            return static_cast<std::int32_t>(config_.tracker.associator);
        case can::CommandCode::set_cfar_scale:
            return config_.dsp.cfar.offset_cdb;
        case can::CommandCode::set_min_snr:
            return config_.dsp.peaks.min_snr_cdb;
        default:
            return 0;
    }
}

void Radar::acquire_and_detect() {
    detections_.count = 0;
    detections_.dropped = 0;
    std::uint32_t sequence = 0;
    observation_.beat = board_.beat.acquire(frame_, sequence);
    switch (observation_.beat) {
        case hal::BeatResult::ended:
            return;
        case hal::BeatResult::missing:
            ++counters_.frames_missing;
            return;
        case hal::BeatResult::invalid:
            ++counters_.frames_invalid;
            return;
        case hal::BeatResult::ok:
            break;
    }
    if (sequence_known_) observation_.frames_lost = sequence - sequence_ - 1;
    counters_.frames_lost += observation_.frames_lost;
    sequence_ = sequence;
    sequence_known_ = true;

    dsp::DcLevels levels;
    observation_.quality = dsp::inspect(frame_, config_.dsp.adc_full_scale, levels);
    if (health_.inspect(observation_.quality)) {
        dsp::detect(frame_, levels, config_.dsp, scale_, workspace_, detections_);
        observation_.detected = true;
        observation_.noise_log2_q10 = workspace_.noise_level;
    }
}

void Radar::finish_cycle() {
    track_and_warn();
    observation_.can_state = board_.can.state();
    observation_.can = board_.can.counters();
    observation_.ego_speed_mmps = ego_speed_mmps_;
    health_.update(observation_);
    ++counters_.cycles;
    publish();
    ++cycle_;
    board_.watchdog.kick();
}

void Radar::track_and_warn() {
    tracking::Scratch<tracking::Measurement<Real>, dsp::kMaxDetections> measurements;
    using Vec2 = tracking::Vec2<Real>;
    std::size_t count = 0;
    Real strongest(0);
    for (const dsp::Detection& d : detections_.view()) {
        measurements.make(count++, Vec2{d.range_m, d.range_rate_mps},
                          Vec2{d.range_variance_m2, d.rate_variance_m2ps2}, d.snr_db);
        strongest = std::max(strongest, d.snr_db);
    }
    observation_.strongest_snr_cdb = std::max<int>(observation_.strongest_snr_cdb, centi(strongest));
    const tracking::TrackerReport report = tracker_.step({&measurements[0], count});
    counters_.detections_dropped += static_cast<std::uint32_t>(detections_.dropped);
    counters_.tracks_dropped += static_cast<std::uint32_t>(report.dropped_for_capacity);
    observation_.over_capacity =
        detections_.dropped > 0 || report.dropped_for_capacity > 0 || report.not_paired > 0;
    observation_.internal_error = report.invalid_measurements > 0;

    const tracking::EgoState<Real> ego{Real::ratio(ego_speed_mmps_, 1000),
                                       observation_.ego_received || health_.ego_valid()};
    warning_ = collision_.step(tracker_.tracks(), ego);
}

void Radar::publish() {
    const bool valid = health_.output_valid();

    can::Status status;
    status.mode = health_.mode();
    status.faults = health_.faults();
    status.cycle = cycle_;
    status.detections = static_cast<std::uint8_t>(detections_.count);
    status.overruns = static_cast<std::uint8_t>(counters_.overruns);
    send(transmitter_.frame(status));

    can::CollisionWarning warning;
    warning.valid = valid;
    warning.level = static_cast<can::WarningLevel>(warning_.level);
    warning.track_id = warning_.track_id;
    if (warning_.time_to_collision_s) warning.time_to_collision_ms = milli(*warning_.time_to_collision_s);
    warning.required_deceleration_mmps2 = milli(warning_.required_deceleration_mps2);
    warning.cycle = cycle_;
    send(transmitter_.frame(warning));

    publish_objects(valid);

    for (std::size_t i = 0; i < echoes_; ++i) send(transmitter_.frame(echo_[i]));
    echoes_ = 0;
    if (counters_.cycles % kVersionEveryCycles == 1) {
        send(transmitter_.frame(can::Version{.major = kVersionMajor,
                                             .minor = kVersionMinor,
                                             .patch = kVersionPatch,
                                             .waveform_id = kWaveformId}));
    }
}

void Radar::publish_objects(bool valid) {
    std::array<can::Object, can::kMaxObjects> objects;
    std::uint8_t count = 0;
    bool overflow = false;
    const auto tracks = tracker_.tracks();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (!tracks[i].is_confirmed()) continue;
        if (count == can::kMaxObjects) {
            overflow = true;
            break;
        }
        objects[count] = object_of(tracks[i], warning_.motion[i]);
        objects[count].index = count;
        ++count;
    }

    can::ObjectListHeader header;
    header.count = count;
    header.cycle = cycle_;
    header.valid = valid;
    header.overflow = overflow || health_.has(can::Fault::over_capacity);
    send(transmitter_.frame(header));
    for (std::uint8_t i = 0; i < count; ++i) send(transmitter_.kinematics(objects[i]));
    for (std::uint8_t i = 0; i < count; ++i) send(transmitter_.quality(objects[i]));
}

can::Object Radar::object_of(const tracking::Track<Real>& track, tracking::Motion motion) const {
    can::Object object;
    object.cycle = cycle_;
    object.track_id = track.id;
    object.range_mm = milli(track.x[0]);
    object.range_rate_mmps = milli(track.x[1]);
    object.motion = static_cast<can::Motion>(motion);
    object.coasting = !track.measured;
    object.range_sigma_mm = sigma_milli(track.covariance(0, 0));
    object.range_rate_sigma_mmps = sigma_milli(track.covariance(1, 1));
    object.existence_percent = static_cast<std::uint8_t>(track.existence.in_units(100));
    object.snr_cdb = centi(track.snr_db);
    object.age_cycles = track.age;
    return object;
}

static_assert(static_cast<int>(tracking::Motion::stopped) == static_cast<int>(can::Motion::stopped));
static_assert(static_cast<int>(tracking::WarningLevel::brake) == static_cast<int>(can::WarningLevel::brake));
static_assert(can::kMaxObjects == tracking::kMaxConfirmed);

}  // namespace firmware
