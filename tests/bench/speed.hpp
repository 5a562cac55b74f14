/// Time on the PC, ours beside others who do the same.
#pragma once

#include <string>
#include <vector>

namespace bench {

struct Timing {
    std::string task;  ///< what is done
    std::string by;    ///< who does it, "ours" first
    double nanoseconds = 0;
    double of_ours = 1;  ///< times the time that ours takes
};

/// All timings, by task. Times are the median of several repetitions, which alternate at random between the
/// competitors, so that a change of the processor's clock meets all of them. `quick`: seconds instead of
/// half a minute, and a few per cent less certain. `only`: the name of a task starts so; empty for all.
/// Throws std::runtime_error when a competitor does not compute the same.
std::vector<Timing> compare_speed(bool quick, const std::string& only);

/// Table of the timings, and frames a second of the firmware's loop beside the bar. Returns whether the bar
/// is met or was not measured.
bool print(const std::vector<Timing>& timings);

inline constexpr double kLeastFramesPerSecond = 20'000;  ///< of the firmware's loop, on one core

}  // namespace bench
