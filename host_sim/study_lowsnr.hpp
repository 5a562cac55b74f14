/// The experiment of the 2020 paper (iterative JIPDA with amplitude information at low signal-to-noise ratio)
/// as a Monte-Carlo study: figures 2 to 5, table 1, and whether its claims hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host_sim/plane_tracker.hpp"
#include "host_sim/study_output.hpp"

namespace sim {

/// One frame of the scene: five fighters that pass within 300 m of each other, in clutter.
struct LowSnrFrame {
    std::vector<tracking::VecN<double, 4>> truth;
    std::vector<PlaneMeasurement> measurements;
};

inline constexpr int kLowSnrFrames = 30;

/// Run `index`, the same whoever computes it.
std::vector<LowSnrFrame> simulate_low_snr(double snr_db, std::uint64_t seed, std::uint64_t purpose,
                                          std::uint64_t index);

/// The tracker of a condition with the paper's parameters; level below 0 is LM-IPDA-AI, kMaxLevel full
/// JIPDA-AI.
PlaneTrackerConfig low_snr_tracker(double snr_db, TrackStart start, int level);

/// options.runs of each condition, and options.calibration more to find the thresholds.
/// Runs what is missing, writes lowsnr.txt, lowsnr.csv, lowsnr.json, lowsnr_cost.txt and the pictures into
/// the directory, and prints the tables. Throws InputError.
void run_lowsnr(const StudyOptions& options, const StudyRanks& ranks);

}  // namespace sim
