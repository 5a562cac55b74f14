/// The application: one object, one call a period. Everything it needs of the world comes through hal::Board.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "can/messages.hpp"
#include "can/receiver.hpp"
#include "can/transmitter.hpp"
#include "dsp/detect.hpp"
#include "firmware/health.hpp"
#include "hal/contract/board.hpp"
#include "tracking/collision_warning.hpp"
#include "tracking/tracker.hpp"

namespace firmware {

using Real = dsp::Real;

/// Everything that can be chosen before start. Commands over CAN change the tracker's association and the
/// detection threshold of a copy; `restart` goes back to this.
struct RadarConfig {
    dsp::Waveform waveform{};
    dsp::DspConfig dsp{};
    tracking::TrackerConfig<Real> tracker{};
    tracking::CollisionWarningConfig<Real> warning{};
    HealthConfig health{};

    [[nodiscard]] constexpr bool valid() const {
        return waveform.valid() && dsp.valid() && tracker.valid() && warning.valid() && health.valid();
    }
};

/// What follows from the waveform and the converter, everything else at its default: the one configuration of
/// a waveform, on boards and on a PC alike.
constexpr RadarConfig radar_config(const dsp::Waveform& waveform, int adc_bits = 12) {
    RadarConfig config;
    config.waveform = waveform;
    config.dsp.adc_full_scale = static_cast<std::int16_t>((1 << (adc_bits - 1)) - 1);
    const dsp::CellScale cell = waveform.scale();
    config.tracker.motion.period_s = Real::ratio(waveform.period_ms, 1000);
    config.tracker.modes.period_s = config.tracker.motion.period_s;
    config.tracker.gate.rate_span_mps = cell.rate_cell_mps * dsp::kDopplerCells;
    config.tracker.gate.alias_range_m = cell.coupling_s * config.tracker.gate.rate_span_mps;
    config.tracker.resolution_range_m = cell.range_cell_m * 2;
    config.tracker.resolution_rate_mps = cell.rate_cell_mps * 2;
    config.tracker.max_range_m = cell.range_offset_m + cell.range_cell_m * (dsp::kRangeCells + 2);
    return config;
}
static_assert(radar_config(dsp::kDefaultWaveform).valid());

/// Counts since start; they only grow (modulo 2^32).
struct RadarCounters {
    std::uint32_t cycles = 0;
    std::uint32_t overruns = 0;
    std::uint32_t frames_lost = 0;  ///< gaps in the front end's sequence
    std::uint32_t frames_missing = 0;
    std::uint32_t frames_invalid = 0;
    std::uint32_t detections_dropped = 0;
    std::uint32_t tracks_dropped = 0;  ///< not started, not confirmed or given up for a stronger one
    std::uint32_t commands_refused = 0;
};

/// Commands answered in one cycle; more are refused and counted.
inline constexpr std::size_t kMaxCommandsPerCycle = 4;

class Radar {
  public:
    /// `config` must be valid().
    Radar(const RadarConfig& config, const hal::Board& board);

    /// Starts the period and the watchdog. Call once.
    void start();

    /// One period: wait for its start, read the bus, acquire, process, track, warn, publish, supervise.
    /// False when the beat source has ended; nothing was published then.
    bool run_cycle();
    /// The same with detections from elsewhere in place of acquire and process.
    void run_cycle(const dsp::DetectionList& detections);

    // What the last cycle found, for observers on the same processor (console, simulator).
    [[nodiscard]] const dsp::DetectionList& detections() const { return detections_; }
    [[nodiscard]] const dsp::PowerMap& power_map() const { return workspace_.map; }
    [[nodiscard]] std::span<const tracking::Track<Real>> tracks() const { return tracker_.tracks(); }
    [[nodiscard]] const tracking::CollisionWarningResult<Real>& warning() const { return warning_; }
    [[nodiscard]] const Health& health() const { return health_; }
    [[nodiscard]] const RadarCounters& counters() const { return counters_; }
    [[nodiscard]] const RadarConfig& config() const { return config_; }
    [[nodiscard]] std::uint8_t cycle() const { return cycle_; }

  private:
    void begin_cycle();
    void read_bus();
    void answer(const can::Command& command);
    [[nodiscard]] can::CommandResult apply(const can::Command& command);
    [[nodiscard]] std::int32_t value_in_force(can::CommandCode code) const;
    void acquire_and_detect();
    void finish_cycle();
    void track_and_warn();
    void publish();
    void publish_objects(bool valid);
    [[nodiscard]] can::Object object_of(const tracking::Track<Real>& track, tracking::Motion motion) const;
    /// A frame that could not be sent is counted by the port and shows as can_error in the next status.
    void send(const can::Frame& frame) { (void)board_.can.send(frame); }
    void reset_state();

    /// What commands may change, as it was at the start.
    struct Commanded {
        tracking::Associator associator;
        std::int16_t cfar_offset_cdb;
        std::int16_t min_snr_cdb;
    };
    const Commanded initial_;
    RadarConfig config_;
    dsp::CellScale scale_;
    hal::Board board_;

    dsp::BeatFrame frame_{};
    dsp::Workspace workspace_{};
    dsp::DetectionList detections_{};
    tracking::Tracker<Real> tracker_;
    tracking::CollisionWarning<Real> collision_;
    Health health_;
    CycleObservation observation_{};
    can::Receiver receiver_{};
    can::Transmitter transmitter_{};
    tracking::CollisionWarningResult<Real> warning_{};
    std::array<can::CommandEcho, kMaxCommandsPerCycle> echo_{};
    std::size_t echoes_ = 0;
    bool restart_due_ = false;
    int ego_speed_mmps_ = 0;
    std::uint8_t cycle_ = 0;
    std::uint32_t sequence_ = 0;
    bool sequence_known_ = false;
    std::uint64_t period_us_ = 0;
    std::uint64_t next_start_us_ = 0;
    RadarCounters counters_{};
};

}  // namespace firmware
