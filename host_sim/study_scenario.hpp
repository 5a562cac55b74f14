/// Measurement-level scenarios of the association studies: targets, what the radar makes of them, and
/// clutter. No beat signals; a frame is a list of range and range rate measurements.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "host_sim/scenario.hpp"
#include "tracking/track.hpp"

namespace sim {

/// Where the targets are, relative to the radar: range, range rate and its changes. Read from JSON.
struct StudyGeometry {
    struct Target {
        double range_m = 0;
        Motion motion;  ///< speed is the range rate
    };
    std::string name;
    std::string description;
    double duration_s = 0;
    std::vector<Target> targets;
    std::vector<std::pair<std::size_t, std::size_t>> pairs;  ///< of targets that come close, from 0
};

/// How the radar sees them. One value of each is a condition of the study.
struct StudyCondition {
    double clutter_density = 0.02;  ///< false measurements a frame per m (m/s), Poisson, known to the filters
    double detection_probability = 0.9;
    double spacing = 1;  ///< factor on the distance and relative speed of the targets of a pair
    double gate = 16;    ///< g^2 of the filters
    /// Two targets closer than a cell of the radar in range and in range rate give one measurement between
    /// them.
    bool merging = false;
    double range_sigma_m = 0.5;     ///< a tenth of a cell,
    double rate_sigma_mps = 0.095;  ///< as interpolation gives at about 14 dB
    double period_s = 0.1;
};

struct StudyMeasurement {
    tracking::Measurement<double> value;
    std::uint32_t targets = 0;  ///< bit t: it is target t's; 0: clutter
};

/// Truth and measurements of one run.
struct StudyRun {
    std::vector<std::vector<tracking::Vec2<double>>> truth;  ///< [frame][target]
    std::vector<std::vector<StudyMeasurement>> frames;  ///< without that of frame 0, where the tracks start
};

/// Throws InputError with file, field and reason.
StudyGeometry read_study_geometry(const std::filesystem::path& file);
/// Target's range and range rate, spacing applied about the mean of its pair.
tracking::Vec2<double> study_truth(const StudyGeometry& geometry, const StudyCondition& condition,
                                   std::size_t target, double time_s);
/// Run `index` of a condition: the same whoever computes it, in whatever order.
StudyRun simulate_study_run(const StudyGeometry& geometry, const StudyCondition& condition,
                            std::uint64_t seed, std::uint64_t condition_index, std::uint64_t index);

/// Where the shipped studies lie: `<program>/../share/fmcw_radar/studies` when installed, else the source
/// tree.
std::filesystem::path study_directory();

}  // namespace sim
