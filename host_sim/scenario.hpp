/// What happens on the road, and through which front end the radar sees it. Read from JSON; the shipped
/// scenarios are the files in host_sim/scenarios/.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dsp/waveform.hpp"
#include "host_sim/json_fields.hpp"

namespace sim {

/// Motion along the road with piecewise constant acceleration.
struct Motion {
    double start_s = 0;
    double speed_mps = 0;  ///< over ground at start_s, positive in the ego car's direction
    std::vector<std::pair<double, double>>
        acceleration_mps2;  ///< (from time, value), times ascending; 0 before

    [[nodiscard]] double speed_at(double time_s) const;
    /// Along the road since start_s.
    [[nodiscard]] double distance_at(double time_s) const;
    [[nodiscard]] double acceleration_at(double time_s) const;
};

enum class Fluctuation {
    none,      ///< Swerling 0: constant radar cross section
    swerling1  ///< exponential, independent from frame to frame, constant within one
};

struct TargetPlan {
    std::string name;
    double range_m = 0;    ///< along the road at motion.start_s
    double lateral_m = 0;  ///< sideways from the radar's axis, constant
    Motion motion;
    double end_s = 0;
    double rcs_dbsm = 10;
    Fluctuation fluctuation = Fluctuation::none;
};

/// Posts beside the road, at equal distances; they stand still.
struct GuardRail {
    double spacing_m = 50;
    double lateral_m = 4;
    double rcs_dbsm = 0;
};

/// Diffuse reflection of the road surface, gamma model: sigma0 = gamma * sin(grazing angle), so that the
/// cross section of a range cell does not depend on range: gamma * height * cell length * beam width.
struct RoadSurface {
    double gamma_db = -30;
    double height_m = 0.5;       ///< of the radar over the road
    double beam_width_deg = 10;  ///< azimuth, two sides
    double nearest_m = 3;        ///< the beam meets the road
};

/// Another radar's chirp crosses the band of the receiver: a short burst on some of the chirps.
struct Interference {
    double start_s = 0;
    double end_s = 0;
    double amplitude_lsb = 0;
    double burst_us = 4;        ///< time inside the receiver's band
    double chirp_share = 0.25;  ///< part of the chirps that are hit
};

/// Reflections that have no object behind them, anew in every frame and anywhere in the map: the clutter of a
/// tracker experiment.
struct FalseEchoes {
    double per_frame = 0;  ///< mean; Poisson distributed
    double snr_db = 20;    ///< integrated
};

struct FrontEnd {
    int adc_bits = 12;
    double noise_lsb = 1;  ///< thermal noise at the converter, rms
    /// The radar equation's constant: integrated SNR (rectangular-window peak over the mean noise of a cell)
    /// of a 10 dBsm target at 100 m. It falls by 12 dB when the range doubles.
    double reference_snr_db = 30;
    double offset_lsb = 20;          ///< of the converter
    double leakage_lsb = 100;        ///< amplitude of the transmitter's own signal,
    double leakage_range_m = 0.3;    ///< at the beat frequency of this range
    double field_of_view_deg = 120;  ///< two sides; nothing is seen outside
};

struct Scenario {
    std::string name;
    std::string description;  ///< one line
    double duration_s = 0;
    dsp::Waveform waveform;
    FrontEnd front_end;
    Motion ego;
    std::vector<TargetPlan> targets;
    std::optional<GuardRail> guard_rail;
    std::optional<RoadSurface> road;
    std::vector<Interference> interference;
    FalseEchoes false_echoes;
};

/// The scenario of a file. Throws InputError, which names file, field and reason.
Scenario read_scenario(const std::filesystem::path& file);
/// The same of JSON at hand; `place` stands for the file name in errors.
Scenario parse_scenario(const nlohmann::json& json, const std::string& place);
/// A file name that ends in .json, or the name of a shipped scenario. Throws InputError, which lists those.
Scenario load_scenario(const std::string& name_or_file);

/// Only the waveform, for recordings: a file with one object of the same fields as a scenario's "waveform".
dsp::Waveform read_waveform(const std::filesystem::path& file);

/// Shipped scenarios by name, in alphabetical order.
std::vector<std::string> shipped_scenarios();
/// Where they lie: `<program>/../share/fmcw_radar/scenarios` when installed, else the source tree.
std::filesystem::path scenario_directory();

}  // namespace sim
