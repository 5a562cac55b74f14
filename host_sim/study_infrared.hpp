/// LM-IHPDA of the 2013 paper on synthesised infrared image sequences, as a Monte-Carlo study: figures 4 and
/// 5, table 5, swaps and losses where the formations cross, and whether the claims hold.
#pragma once

#include "host_sim/study_output.hpp"

namespace sim {

/// Runs what is missing, writes infrared.txt, infrared.csv, infrared.json, infrared_cost.txt and the pictures
/// into the directory, and prints the tables. Throws InputError.
void run_infrared(const StudyOptions& options, const StudyRanks& ranks);

}  // namespace sim
