/// The signal processing measured against double precision, sorting, design values and the Cramer-Rao bound.
#pragma once

#include <vector>

#include "tests/bench/row.hpp"

namespace bench {

/// SQNR of the 64-point transform at full scale and at -40 dBFS, and its constant error in each bin.
std::vector<Row> fft_accuracy();
/// What the fixed-point map adds to a 12-bit converter's noise beside a tone at -14 dBFS.
std::vector<Row> noise_floor();
/// Cells decided differently from sorting: random maps, ties, constant maps, edges, several shapes, every
/// `rank_step`-th rank.
std::vector<Row> os_cfar_exactness(int rank_step = 1);
/// Measured over designed false-alarm rate on exponential cells.
std::vector<Row> false_alarm_rate();
/// RMSE of one target over the Cramer-Rao bound, and its bias. The worst of 100 places; fewer trials at each
/// make the worst look worse.
std::vector<Row> single_target(int trials = 400);

/// All of the above, in about 20 s.
std::vector<Row> accuracy_dsp();

}  // namespace bench
