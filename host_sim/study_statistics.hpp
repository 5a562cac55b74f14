/// Means, medians and confidence intervals of Monte-Carlo runs.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sim {

/// A number with its 95 % confidence interval.
struct Estimate {
    double value = 0;
    double low = 0;
    double high = 0;
};

/// Mean of independent runs, normal interval. Of no runs: zeros.
Estimate mean_of(std::span<const double> runs);
double median_of(std::vector<double> values);

/// Mean square errors of two filters on the same track of the same run.
struct ErrorPair {
    std::size_t run = 0;
    double first = 0;
    double second = 0;
};
/// 1 - RMS(second) / RMS(first): by how much the second is better. Percentile bootstrap over the runs, whose
/// tracks stay together; its random numbers are fixed, so the same pairs give the same interval. Without
/// pairs: NaN.
Estimate improvement_of(std::span<const ErrorPair> pairs, std::size_t runs);

}  // namespace sim
