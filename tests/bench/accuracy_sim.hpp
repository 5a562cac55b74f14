/// The whole radar measured against the truth: beat signals in, tracks out.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/row.hpp"

namespace bench {

/// `four-targets` over some seeds: confirmation, losses, identity switches, errors; the worst seed counts.
std::vector<Row> four_targets(int seeds = 20);
/// False confirmed tracks on the empty road.
std::vector<Row> empty_road(double hours = 1);
/// Real 77 GHz beat signals of a walking person, `data`/openradar_77ghz. Says SKIPPED and gives no row where
/// they are absent. The recording's frames overlap: the tracker runs at their own pace, 0.736 ms.
std::vector<Row> walking_person(const std::filesystem::path& data);
/// Real highway motion, `data`/comma2k19_highway, to beat signals. Prints what the bar does not cover. Says
/// SKIPPED and gives no row where it is absent.
std::vector<Row> recorded_traffic(const std::filesystem::path& data);
/// Every tracker in fixed point beside the same source in double, on the same detections of all scenarios.
std::vector<Row> fixed_against_double();
/// Simulated over elapsed time of `four-targets` on this machine, synthesis included.
std::vector<Row> speed();

/// All of the above, in about half a minute.
std::vector<Row> accuracy_sim(const std::filesystem::path& data);

}  // namespace bench
