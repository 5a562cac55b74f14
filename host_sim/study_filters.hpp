/// The filters a study compares, and what one of them makes of one run.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "host_sim/study_scenario.hpp"
#include "tracking/associator.hpp"
#include "tracking/kalman.hpp"

namespace sim {

struct StudyFilter {
    std::string name;  ///< as in tables
    tracking::Associator associator = tracking::Associator::pda;
    tracking::OrderStatisticsConfig<double> order{};
};

/// A track of a target is good while within this of it: three sigma in range, and what a gate reaches in
/// rate.
inline constexpr double kKept_m = 1.5;
inline constexpr double kKept_mps = 1;
inline constexpr int kLastFrames = 10;  ///< decide whether a target is still tracked when the run ends

/// Sizes of errors of one track over a run, from its tenth frame on.
struct StudyTrackResult {
    double found = 0;           ///< 1: at the end the target has a track, no matter which; 0: it is lost
    double own = 0;             ///< 1: and it is the one that started on it
    double range_estimate = 0;  ///< mean square errors
    double rate_estimate = 0;
    double range_prediction = 0;
    double rate_prediction = 0;
    double correct = 0;  ///< mean weight of the right measurement, or of none when there is none
};

struct StudyResult {
    std::vector<StudyTrackResult> track;
    double coalescence =
        0;  ///< share of frames in which the tracks of a pair are less than half its distance apart
    double switches = 0;  ///< changes of the track that follows a target
    double gospa = 0;     ///< mean over frames, m; c = 10 m, p = 2, alpha = 2, 1 m/s counts as 2 m
    double ospa = 0;
    std::vector<std::vector<double>> correct_at;                ///< [target][frame]
    std::vector<std::vector<tracking::Vec2<double>>> estimate;  ///< [frame][track], first is the start
};

/// Tracks start on the truth, as in Lee and Kim 2000, with the covariance of a measurement; none is ever
/// started or deleted. Scalar: double or dsp::Real.
template <class S>
StudyResult run_study_filter(const StudyFilter& filter, const StudyGeometry& geometry,
                             const StudyCondition& condition, const StudyRun& run);

/// The filters of Lee and Kim 2000 as printed, with alpha in brackets; then the steps from there to the form
/// the radar uses, which has the plain names ospda and osjpda.
std::vector<StudyFilter> lee2000_filters();

}  // namespace sim
