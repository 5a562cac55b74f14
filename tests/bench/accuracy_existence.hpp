/// The existence-based solvers against listing, drawn scenes and the times of the 2020 paper.
#pragma once

#include <vector>

#include "tests/bench/row.hpp"

namespace bench {

/// In a few seconds. Prints what has no bar beside it: the known bias of IHPDA, and which level iterative
/// JIPDA fell back to.
std::vector<Row> accuracy_existence();

}  // namespace bench
