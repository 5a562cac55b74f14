/// Optimal one-to-one assignment, for measuring trackers.
#pragma once

#include <cstddef>
#include <vector>

namespace sim {

/// A rows x columns table of costs.
struct CostMatrix {
    std::size_t rows;
    std::size_t columns;
    std::vector<double> cost;

    CostMatrix(std::size_t r, std::size_t c) : rows(r), columns(c), cost(r * c) {}
    double& operator()(std::size_t r, std::size_t c) { return cost[r * columns + c]; }
    double operator()(std::size_t r, std::size_t c) const { return cost[r * columns + c]; }
};

inline constexpr int kUnassigned = -1;

/// The column of each row at the least total cost; with more rows than columns some rows stay kUnassigned.
/// Costs must be finite. Shortest augmenting paths (Kuhn 1955; Jonker and Volgenant 1987): O(rows^2 columns).
std::vector<int> assign(const CostMatrix& cost);

}  // namespace sim
