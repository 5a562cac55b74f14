/// One measured figure beside its bar.
#pragma once

#include <cstdio>
#include <string>
#include <vector>

namespace bench {

struct Row {
    std::string what;
    double measured = 0;
    double bar = 0;
    bool at_least = false;  ///< the bar is a lower bound; otherwise an upper one
    std::string unit;

    [[nodiscard]] bool met() const { return at_least ? measured >= bar : measured <= bar; }
};

/// Prints the rows as a table and returns how many missed their bar. NaN misses.
inline int print(const std::vector<Row>& rows) {
    int missed = 0;
    for (const Row& row : rows) {
        missed += row.met() ? 0 : 1;
        std::printf("%-72s %12.4g  %s %-9.4g %-8s %s\n", row.what.c_str(), row.measured,
                    row.at_least ? ">=" : "<=", row.bar, row.unit.c_str(), row.met() ? "met" : "MISSED");
    }
    return missed;
}

}  // namespace bench
