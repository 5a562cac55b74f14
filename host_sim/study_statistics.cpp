#include "host_sim/study_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_sim/random.hpp"

namespace sim {

Estimate mean_of(std::span<const double> runs) {
    if (runs.empty()) return {};
    const auto n = static_cast<double>(runs.size());
    double sum = 0;
    for (const double v : runs) sum += v;
    const double mean = sum / n;
    double squares = 0;
    for (const double v : runs) squares += (v - mean) * (v - mean);
    const double half = runs.size() < 2 ? 0 : 1.96 * std::sqrt(squares / (n - 1) / n);
    return {mean, mean - half, mean + half};
}

double median_of(std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const std::size_t middle = values.size() / 2;
    std::sort(values.begin(), values.end());
    return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

Estimate improvement_of(std::span<const ErrorPair> pairs, std::size_t runs) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    if (pairs.empty() || runs == 0) return {kNone, kNone, kNone};
    std::vector<double> first(runs);
    std::vector<double> second(runs);
    for (const ErrorPair& p : pairs) {
        first[p.run] += p.first;
        second[p.run] += p.second;
    }
    const auto improvement = [](double a, double b) { return a > 0 ? 1 - std::sqrt(b / a) : 0; };
    double a = 0;
    double b = 0;
    for (std::size_t r = 0; r < runs; ++r) {
        a += first[r];
        b += second[r];
    }
    constexpr std::size_t kResamples = 1000;
    Random random(20000);
    std::vector<double> drawn(kResamples);
    for (double& value : drawn) {
        double sum_a = 0;
        double sum_b = 0;
        for (std::size_t i = 0; i < runs; ++i) {
            const std::size_t r = random.bits() % runs;
            sum_a += first[r];
            sum_b += second[r];
        }
        value = improvement(sum_a, sum_b);
    }
    std::sort(drawn.begin(), drawn.end());
    return {improvement(a, b), drawn[kResamples / 40], drawn[kResamples - 1 - kResamples / 40]};
}

}  // namespace sim
