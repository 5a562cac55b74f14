/// The firmware in the middle of its world: each cycle the world moves on, the car reports its speed on the
/// bus, the firmware runs one period, and what it says is compared with the truth.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dsp/detection.hpp"
#include "dsp/waveform.hpp"
#include "firmware/radar.hpp"
#include "host_sim/metrics.hpp"
#include "host_sim/scenario.hpp"
#include "host_sim/world.hpp"
#include "tracking/associator.hpp"

namespace sim {

inline constexpr const char* kLoopback = "loopback";

struct SimulationOptions {
    /// What the radar sees: exactly one of scenario, replay, traffic and detections.
    std::optional<Scenario> scenario;
    std::filesystem::path replay;      ///< recorded beat frames
    std::filesystem::path traffic;     ///< CSV of recorded motion, to synthesise from
    std::filesystem::path detections;  ///< CSV of detections that bypass the signal processing
    std::filesystem::path
        ego;  ///< CSV of the own speed, for all but scenarios; without, the car says nothing
    std::optional<dsp::Waveform> waveform;  ///< of the recording

    std::uint64_t seed = 1;
    std::optional<std::uint64_t> frames;  ///< stop after so many; >= 1
    tracking::Associator tracker = tracking::Associator::ospda;
    std::optional<int> tracker_level;  ///< of iterative JIPDA; the radar's own if not given
    bool nonparametric = false;        ///< clutter density from each gate's measurements, not from the map
    std::string bus = kLoopback;       ///< or a SocketCAN interface
    std::filesystem::path log;         ///< candump -L of all that the radar sends and hears
    std::filesystem::path record;      ///< beat frames as the radar took them
    /// Seconds simulated in one second; 0: as fast as possible, on a virtual clock.
    double speed = 0;
    bool quiet = false;  ///< no console lines of the firmware
};

/// What there is to see after a cycle. Valid until the next.
struct CycleView {
    std::uint64_t frame = 0;
    double time_s = 0;       ///< middle of the frame
    std::optional<Ego> ego;  ///< as told on the bus
    std::span<const TruthObject> truth;
    const firmware::Radar& radar;
    const dsp::PowerMap* map = nullptr;  ///< none when the signal processing was bypassed
};

struct SimulationResult {
    std::string scenario;
    std::string tracker;
    std::string bus;
    std::uint64_t frames = 0;
    std::uint64_t can_frames = 0;      ///< sent by the radar
    std::uint64_t dropped_frames = 0;  ///< CAN frames it could not send
    std::uint64_t overruns = 0;
    std::uint16_t faults = 0;  ///< every bit that was ever set
    bool has_truth = false;    ///< else only confirmed_tracks of the metrics means something
    MetricsSummary metrics;
    std::vector<TargetReport> targets;
};

/// The firmware's configuration for a waveform: cell sizes, period, ambiguity and the converter's full scale
/// follow from it; all else is the default.
firmware::RadarConfig radar_config(const dsp::Waveform& waveform, int adc_bits, tracking::Associator tracker);

/// Columns frame, range_m, range_rate_mps, snr_db, by frame; frames without rows had no detection. Variances
/// follow from the SNR: the Cramer-Rao bound of a Hann window, and 0.02 cell of interpolation error. Throws
/// InputError.
std::vector<dsp::DetectionList> read_detections(const std::filesystem::path& file,
                                                const dsp::Waveform& waveform);

/// The names of the fault bits that are set, as can/radar.dbc has them.
std::vector<std::string> fault_names(std::uint16_t faults);

class Simulation {
  public:
    /// Throws InputError for options that contradict each other and for everything that cannot be opened or
    /// read.
    explicit Simulation(const SimulationOptions& options);
    ~Simulation();
    Simulation(const Simulation&) = delete;
    Simulation& operator=(const Simulation&) = delete;

    /// One cycle. False when there are no more frames; nothing happened then. Throws InputError when the
    /// recording cannot be written any more.
    bool step();
    [[nodiscard]] CycleView view() const;
    /// Number of frames there will be.
    [[nodiscard]] std::uint64_t frames() const;
    [[nodiscard]] const dsp::Waveform& waveform() const;
    /// Of the frames so far. Throws InputError when the log could not be written to its end.
    [[nodiscard]] SimulationResult result();

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace sim
