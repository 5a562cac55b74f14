/// IMM-PDAF of Kim, Park, Kim and Ji as a Monte-Carlo study: vehicles that turn, stop and go, in clutter,
/// seen by one sensor or three; against PDA filters of one model.
#pragma once

#include "host_sim/study_output.hpp"

namespace sim {

/// Runs what is missing, writes multimodel.txt, multimodel.csv, multimodel.json, multimodel_cost.txt and the
/// pictures into the directory, and prints the tables. Throws InputError.
void run_multimodel(const StudyOptions& options, const StudyRanks& ranks);

}  // namespace sim
