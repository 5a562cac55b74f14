// Against the least cost over all permutations.
#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "host_sim/assignment.hpp"
#include "host_sim/random.hpp"

#include <CppUTest/TestHarness.h>

namespace {

double least_cost(const sim::CostMatrix& cost) {
    const bool tall = cost.rows > cost.columns;
    const std::size_t few = std::min(cost.rows, cost.columns);
    std::vector<std::size_t> order(std::max(cost.rows, cost.columns));
    std::iota(order.begin(), order.end(), 0);
    double best = std::numeric_limits<double>::infinity();
    do {
        double sum = 0;
        for (std::size_t i = 0; i < few; ++i) sum += tall ? cost(order[i], i) : cost(i, order[i]);
        best = std::min(best, sum);
    } while (std::next_permutation(order.begin(), order.end()));
    return best;
}

}  // namespace

TEST_GROUP(Assignment){};

TEST(Assignment, IsOptimalForEveryShapeUpToSixBySix) {
    sim::Random random(1);
    for (std::size_t rows = 1; rows <= 6; ++rows) {
        for (std::size_t columns = 1; columns <= 6; ++columns) {
            for (int trial = 0; trial < 10; ++trial) {
                sim::CostMatrix cost(rows, columns);
                // Few distinct values, so that ties are common.
                for (auto& c : cost.cost) c = static_cast<double>(random.bits() % 12) - 3;
                const auto column_of = sim::assign(cost);
                std::vector<bool> used(columns, false);
                double sum = 0;
                std::size_t assigned = 0;
                for (std::size_t r = 0; r < rows; ++r) {
                    if (column_of[r] == sim::kUnassigned) continue;
                    const auto c = static_cast<std::size_t>(column_of[r]);
                    CHECK(!used[c]);
                    used[c] = true;
                    sum += cost(r, c);
                    ++assigned;
                }
                UNSIGNED_LONGS_EQUAL(std::min(rows, columns), assigned);
                DOUBLES_EQUAL(least_cost(cost), sum, 1e-9);
            }
        }
    }
}

TEST(Assignment, ChoosesTheSumAndNotTheBestPairFirst) {
    // Kim, Choi, Kim, Yang and Song 2013: betas [.9 .8; .85 .1], optimal 1.65, greedy 1.0.
    sim::CostMatrix cost(2, 2);
    cost.cost = {-0.9, -0.8, -0.85, -0.1};
    const auto column_of = sim::assign(cost);
    LONGS_EQUAL(1, column_of[0]);
    LONGS_EQUAL(0, column_of[1]);
}

TEST(Assignment, NothingToAssign) {
    UNSIGNED_LONGS_EQUAL(0, sim::assign(sim::CostMatrix(0, 3)).size());
}
