#include "host_sim/assignment.hpp"

#include <limits>

namespace sim {

std::vector<int> assign(const CostMatrix& cost) {
    if (cost.rows > cost.columns) {
        CostMatrix turned(cost.columns, cost.rows);
        for (std::size_t r = 0; r < cost.rows; ++r)
            for (std::size_t c = 0; c < cost.columns; ++c) turned(c, r) = cost(r, c);
        std::vector<int> result(cost.rows, kUnassigned);
        const auto row_of = assign(turned);
        for (std::size_t c = 0; c < cost.columns; ++c)
            result[static_cast<std::size_t>(row_of[c])] = static_cast<int>(c);
        return result;
    }
    // Rows and columns count from 1 here: column 0 stands for the row that is being placed.
    const std::size_t n = cost.columns;
    std::vector<double> row_price(cost.rows + 1, 0);
    std::vector<double> column_price(n + 1, 0);
    std::vector<std::size_t> row_of(n + 1, 0);
    for (std::size_t row = 1; row <= cost.rows; ++row) {
        std::vector<double> shortest(n + 1, std::numeric_limits<double>::infinity());
        std::vector<std::size_t> came_from(n + 1, 0);
        std::vector<bool> done(n + 1, false);
        row_of[0] = row;
        std::size_t column = 0;
        do {
            done[column] = true;
            const std::size_t at = row_of[column];
            double step = std::numeric_limits<double>::infinity();
            std::size_t nearest = 0;
            for (std::size_t c = 1; c <= n; ++c) {
                if (done[c]) continue;
                const double reduced = cost(at - 1, c - 1) - row_price[at] - column_price[c];
                if (reduced < shortest[c]) {
                    shortest[c] = reduced;
                    came_from[c] = column;
                }
                if (shortest[c] < step) {
                    step = shortest[c];
                    nearest = c;
                }
            }
            for (std::size_t c = 0; c <= n; ++c) {
                if (done[c]) {
                    row_price[row_of[c]] += step;
                    column_price[c] -= step;
                } else {
                    shortest[c] -= step;
                }
            }
            column = nearest;
        } while (row_of[column] != 0);
        while (column != 0) {
            row_of[column] = row_of[came_from[column]];
            column = came_from[column];
        }
    }
    std::vector<int> result(cost.rows, kUnassigned);
    for (std::size_t c = 1; c <= n; ++c)
        if (row_of[c] != 0) result[row_of[c] - 1] = static_cast<int>(c - 1);
    return result;
}

}  // namespace sim
