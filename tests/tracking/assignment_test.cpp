// The best assignment is found by trying all; that the prices prove it is checked as linear programming says.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "tracking/assignment.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::Assignment;
using tracking::AssociationRow;

namespace {

/// Weights in 1/256, so that both scalars hold them exactly; beta is where this test keeps them.
template <class S>
std::vector<AssociationRow<S>> random_rows(std::mt19937& random, std::size_t tracks,
                                           std::size_t measurements) {
    std::vector<AssociationRow<S>> rows(tracks);
    for (auto& row : rows) {
        row.missed = tracking::constant<S>(static_cast<int>(random() % 1024) - 1024, 256);
        for (std::size_t j = 0; j < measurements; ++j) {
            if (random() % 4 == 0) continue;
            auto& c = row.item[static_cast<std::size_t>(row.count++)];
            c.measurement = static_cast<std::uint16_t>(j);
            c.beta = tracking::constant<S>(static_cast<int>(random() % 4096) - 2048, 256);
        }
    }
    return rows;
}

template <class S>
void solve(const std::vector<AssociationRow<S>>& rows, Assignment<S>& out) {
    tracking::assign_best(
        std::span<const AssociationRow<S>>(rows),
        [&](int t, int c) {
            return rows[static_cast<std::size_t>(t)].item[static_cast<std::size_t>(c)].beta;
        },
        [&](int t) { return rows[static_cast<std::size_t>(t)].missed; }, out);
}

template <class S>
S best_of_all(const std::vector<AssociationRow<S>>& rows, std::size_t t, std::uint64_t used) {
    if (t == rows.size()) return S(0);
    S best = rows[t].missed + best_of_all(rows, t + 1, used);
    for (const auto& c : rows[t].candidates()) {
        const std::uint64_t bit = std::uint64_t{1} << c.measurement;
        if ((used & bit) != 0) continue;
        best = std::max(best, S(c.beta + best_of_all(rows, t + 1, used | bit)));
    }
    return best;
}

template <class S>
void best_and_proven() {
    std::mt19937 random(1);
    Assignment<S> best;
    for (int trial = 0; trial < 1000; ++trial) {
        const auto rows = random_rows<S>(random, random() % 6, random() % 6);
        solve(rows, best);
        S total(0);
        std::uint64_t used = 0;
        for (std::size_t t = 0; t < rows.size(); ++t) {
            const int c = best.candidate[t];
            if (c == Assignment<S>::kNone) {
                total += rows[t].missed;
                CHECK(best.row_price[t] == rows[t].missed);
            } else {
                const auto& item = rows[t].item[static_cast<std::size_t>(c)];
                total += item.beta;
                CHECK((used >> item.measurement & 1) == 0);
                used |= std::uint64_t{1} << item.measurement;
                LONGS_EQUAL(t, best.owner[item.measurement]);
                CHECK(best.row_price[t] + best.measurement_price[item.measurement] == item.beta);
            }
            CHECK(rows[t].missed <= best.row_price[t]);
            for (const auto& item : rows[t].candidates())
                CHECK(item.beta <= best.row_price[t] + best.measurement_price[item.measurement]);
        }
        for (const auto& row : rows) {
            for (const auto& item : row.candidates()) {
                const std::size_t j = item.measurement;
                CHECK(best.measurement_price[j] >= S(0));
                if ((used >> j & 1) != 0) continue;
                CHECK(best.measurement_price[j] == S(0));
                LONGS_EQUAL(Assignment<S>::kNone, best.owner[j]);
            }
        }
        CHECK(total == best_of_all(rows, 0, 0));
    }
}

}  // namespace

TEST_GROUP(Assignment){};

TEST(Assignment, BestOfAllAndProvenByItsPrices) {
    best_and_proven<double>();
    best_and_proven<Real>();
}

TEST(Assignment, FullCapacityStaysOneToOne) {
    std::mt19937 random(2);
    auto rows = random_rows<Real>(random, tracking::kMaxTracks, tracking::kMaxGated);
    Assignment<Real> best;
    solve(rows, best);
    std::uint64_t used = 0;
    for (std::size_t t = 0; t < rows.size(); ++t) {
        if (best.candidate[t] < 0) continue;
        const auto j = rows[t].item[static_cast<std::size_t>(best.candidate[t])].measurement;
        CHECK((used >> j & 1) == 0);
        used |= std::uint64_t{1} << j;
    }
    CHECK(used != 0);
}
