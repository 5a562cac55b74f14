/// The comparison of Lee and Kim 2000 as a Monte-Carlo study: tables 1 to 3, figures 4 to 13 and 15, and
/// whether the paper's claims hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host_sim/study_filters.hpp"
#include "host_sim/study_runner.hpp"
#include "host_sim/study_scenario.hpp"

namespace sim {

struct Lee2000Options {
    std::size_t runs = 200;  ///< of each condition
    std::uint64_t seed = 1;
    bool pictures = true;
    std::filesystem::path scenarios;  ///< where lee2000.json and what it names lie; empty: the shipped ones
    StudyRunOptions run;
};

/// Runs what is missing, writes lee2000.txt, lee2000.csv, lee2000.json and the pictures into the directory,
/// and prints the tables. Throws InputError.
void run_lee2000(const Lee2000Options& options, const StudyRanks& ranks);

}  // namespace sim
