/// What the parts of the lee2000 study share: its conditions, and the scores of the filters in them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_sim/study_filters.hpp"
#include "host_sim/study_output.hpp"
#include "host_sim/study_scenario.hpp"
#include "host_sim/study_statistics.hpp"

namespace sim::lee2000 {

inline constexpr const char* kName = "lee2000";

struct Condition {
    std::string label;
    std::size_t geometry = 0;
    StudyCondition seen;
    bool base = false;  ///< tables 1 and 2 are of these
};

struct Plan {
    std::string configuration;
    std::vector<StudyGeometry> geometries;
    std::vector<Condition> conditions;
    std::size_t pictured = 0;  ///< condition of the figures
};

/// The filters whose probability of correct association is drawn over time.
inline constexpr std::array<const char*, 6> kDrawn{"nn", "pda", "ospda(4)", "jpda", "osjpda(6)", "ospda"};

inline bool is_drawn(const std::string& name) {
    return std::find(kDrawn.begin(), kDrawn.end(), name) != kDrawn.end();
}

struct RunScore {
    std::vector<StudyTrackResult> track;
    double coalescence = 0;
    double switches = 0;
    double gospa = 0;
    double ospa = 0;
};

/// [condition][filter][run], and the sums over the runs of P(correct) of the pictured condition:
/// [filter][target][frame].
struct Scores {
    std::vector<std::vector<std::vector<RunScore>>> of;
    std::map<std::string, std::vector<std::vector<double>>> correct_at;
};

using Runs = std::vector<RunScore>;

/// Percent of the targets of a run that end without a track, or without the track that started on them.
double lost(const RunScore& run);
double own_lost(const RunScore& run);

template <class Value>
Estimate over_runs(const Runs& runs, Value value) {
    std::vector<double> values;
    for (const RunScore& r : runs) values.push_back(value(r));
    return mean_of(values);
}

struct Tables {
    std::string text;
    std::string csv;
    nlohmann::json json;
};
/// Tables 1 and 2, a table of each condition, and the claims.
Tables make_tables(const Plan& plan, const std::vector<StudyFilter>& filters, const Scores& scores);
/// Table 3, measured now: no two are alike.
std::string cost_table(const std::vector<StudyFilter>& filters);

/// Figures 4 to 13, losses over clutter density, and in fig15/ the whole radar on the scenario four-targets.
/// Throws InputError.
void draw_pictures(const std::filesystem::path& directory, const Plan& plan,
                   const std::vector<StudyFilter>& filters, const Scores& scores, std::uint64_t seed);

}  // namespace sim::lee2000
