#include "tests/bench/accuracy_association.hpp"

#include <algorithm>
#include <chrono>
#include <random>

#include "tests/tracking/joint_events.hpp"
#include "tracking/jpda.hpp"

namespace bench {

namespace {

using joint_events::EventList;
using joint_events::Real;
using Clock = std::chrono::steady_clock;

tracking::JpdaWorkspace<double> g_double;
tracking::JpdaWorkspace<Real> g_fixed;

double milliseconds(Clock::duration d) {
    return std::chrono::duration<double, std::milli>(d).count();
}

}  // namespace

std::vector<Row> accuracy_association() {
    std::mt19937 random(1);
    double exact = 0;
    double fixed_error = 0;
    double row_sum = 0;
    for (const auto& shape : joint_events::kShapes) {
        for (int i = 0; i < 100; ++i) {
            joint_events::Rows rows = joint_events::random_rows(random, shape);
            auto fixed = joint_events::to_fixed(rows);
            const EventList events(rows);
            tracking::jpda<double>(rows, g_double);
            tracking::jpda<Real>(fixed, g_fixed);
            exact = std::max(exact, joint_events::largest_error(rows, events));
            fixed_error = std::max(fixed_error, joint_events::largest_error(fixed, events));
            row_sum = std::max(row_sum, joint_events::worst_row_sum(fixed));
        }
    }
    joint_events::Rows rows = joint_events::random_rows(random, {8, 12, 1.0, 8.0, -2.3});
    double fast_ms = 1e9;
    for (int i = 0; i < 20; ++i) {
        const auto start = Clock::now();
        tracking::jpda<double>(rows, g_double);
        fast_ms = std::min(fast_ms, milliseconds(Clock::now() - start));
    }
    const auto start = Clock::now();
    const EventList events(rows);
    const double list_ms = milliseconds(Clock::now() - start);
    // Its sums of 77 million terms round too much to judge the last digits; they must still agree.
    if (joint_events::largest_error(rows, events) > 1e-8) exact = 1;
    return {{"JPDA marginals, double, against listing all events: largest error", exact, 1e-12, false, ""},
            {"JPDA marginals, fixed point: largest error", fixed_error, 2e-3, false, ""},
            {"JPDA marginals, fixed point: sum of a row, error", row_sum, 1e-3, false, ""},
            {"JPDA, 8 tracks x 12 measurements, double, one core", fast_ms, 1, false, "ms"},
            {"JPDA, 8 tracks x 12 measurements: times faster than listing events", list_ms / fast_ms, 100,
             true, "x"}};
}

}  // namespace bench
