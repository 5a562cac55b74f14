/// The comparison of Lee and Kim 2000 as a Monte-Carlo study: tables 1 to 3, figures 4 to 13 and 15, and
/// whether the paper's claims hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host_sim/study_filters.hpp"
#include "host_sim/study_output.hpp"
#include "host_sim/study_scenario.hpp"

namespace sim {

/// Runs what is missing, writes lee2000.txt, lee2000.csv, lee2000.json and the pictures into the directory,
/// and prints the tables. Throws InputError.
void run_lee2000(const StudyOptions& options, const StudyRanks& ranks);

}  // namespace sim
