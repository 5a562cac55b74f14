/// Exact JPDA measured against listing all joint events.
#pragma once

#include <vector>

#include "tests/bench/row.hpp"

namespace bench {

/// Largest errors over random clusters to 6 tracks x 8 measurements; 8 x 12 timed on this machine, beside
/// listing its 77 million events. In a few seconds.
std::vector<Row> accuracy_association();

}  // namespace bench
