// Expected values: the matrix of Lee and Kim 2000's decision logic worked by hand,
//   B = [.5 .3 .1; .6 .2 .1], alpha 4 -> [.8333 .1250 .0417; .4000 .5333 .0667],
// and small matrices worked by hand beside each test.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "tracking/order_statistics.hpp"
#include "tracking/pda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::constant;
using tracking::OrderStatisticsConfig;

namespace {
/// Rows of one beta for each measurement, in ten-thousandths; the rest to 1 is the missed column.
template <class S>
std::vector<AssociationRow<S>> rows_of(const std::vector<std::vector<int>>& betas) {
    std::vector<AssociationRow<S>> rows;
    for (const auto& values : betas) {
        AssociationRow<S> row;
        int rest = 10'000;
        for (std::size_t j = 0; j < values.size(); ++j) {
            rest -= values[j];
            const S beta = constant<S>(values[j], 10'000);
            row.item[j] = {static_cast<std::uint16_t>(j), tracking::ln(beta), beta, beta};
            ++row.count;
        }
        row.missed = row.missed_weight = constant<S>(rest, 10'000);
        row.log_missed = tracking::ln(row.missed);
        rows.push_back(row);
    }
    return rows;
}

template <class S>
double weight(const AssociationRow<S>& row, std::size_t j) {
    if constexpr (std::floating_point<S>) {
        return row.item[j].weight;
    } else {
        return std::ldexp(row.item[j].weight.raw(), -S::fraction_bits);
    }
}

template <class S>
void worked_by_hand() {
    auto rows = rows_of<S>({{5000, 3000, 1000}, {6000, 2000, 1000}});
    tracking::order_statistics<S>(rows, tracking::kLeeKim2000<S>);
    const double expected[2][3] = {{.8333, .1250, .0417}, {.4000, .5333, .0667}};
    for (std::size_t t = 0; t < 2; ++t) {
        for (std::size_t j = 0; j < 3; ++j) DOUBLES_EQUAL(expected[t][j], weight(rows[t], j), 5e-5);
        CHECK(rows[t].missed_weight == S(0));
        CHECK(rows[t].item[0].beta == rows[t].item[0].weight);  // as printed, the covariance sees the same
    }
}
}  // namespace

TEST_GROUP(OrderStatistics){};

TEST(OrderStatistics, MatrixOfThePaperWorkedByHand) {
    worked_by_hand<double>();
    worked_by_hand<Real>();
}

TEST(OrderStatistics, PrecedenceDecidesWhoGetsTheSharedMeasurement) {
    // Row 0 doubts (ratio to missed: 1.195, .24), row 1 is sure it is one of the two (50, 49). Largest beta
    // first gives measurement 0 to row 1 (.50 > .49); together 0 to row 0 and 1 to row 1 is likelier
    // (1.195 * 49 > 50 * 1).
    const std::vector<std::vector<int>> doubtful{{4900, 1000}, {5000, 4900}};
    // Ratios 17, 2 and 45, 4: giving measurement 0 to row 1 is likelier (45 * 2 > 17 * 4), by index row 0 has
    // it.
    const std::vector<std::vector<int>> greedy{{8500, 1000}, {9000, 800}};
    struct Case {
        const std::vector<std::vector<int>>& betas;
        tracking::Precedence precedence;
        std::size_t owner_of_0;
    };
    const Case cases[] = {
        {doubtful, tracking::Precedence::index, 0},   {doubtful, tracking::Precedence::strength, 1},
        {doubtful, tracking::Precedence::optimal, 0}, {greedy, tracking::Precedence::index, 0},
        {greedy, tracking::Precedence::strength, 1},  {greedy, tracking::Precedence::optimal, 1}};
    for (const Case& c : cases) {
        auto config = tracking::kLeeKim2000<double>;
        config.precedence = c.precedence;
        auto rows = rows_of<double>(c.betas);
        const auto before = rows;
        tracking::order_statistics<double>(rows, config);
        for (std::size_t t = 0; t < 2; ++t) {
            const bool prefers_0 =
                weight(rows[t], 0) / weight(rows[t], 1) > weight(before[t], 0) / weight(before[t], 1);
            CHECK_EQUAL(t == c.owner_of_0, prefers_0);
        }
    }
}

TEST(OrderStatistics, OptimalPrecedenceIsTheBestAssignmentOfAll) {
    std::mt19937 random(1);
    for (int trial = 0; trial < 2000; ++trial) {
        const std::size_t tracks = 1 + random() % 5;
        const std::size_t measurements = 1 + random() % 5;
        std::vector<AssociationRow<double>> rows(tracks);
        for (auto& row : rows) {
            row.log_missed = -static_cast<double>(random() % 1000) / 300;
            for (std::size_t j = 0; j < measurements; ++j) {
                if (random() % 3 == 0) continue;
                const double log_ratio = static_cast<double>(random() % 4000) / 300 - 5;
                row.item[static_cast<std::size_t>(row.count++)] = {static_cast<std::uint16_t>(j), log_ratio,
                                                                   0, 0};
            }
        }
        // Every one-to-one assignment, by counting in base (candidates + 1) with one digit a row.
        double best = -1e9;
        std::vector<int> choice(tracks, 0);
        for (bool more = true; more;) {
            double value = 0;
            unsigned used = 0;
            bool one_to_one = true;
            for (std::size_t t = 0; t < tracks; ++t) {
                if (choice[t] == 0) continue;
                const auto& c = rows[t].item[static_cast<std::size_t>(choice[t] - 1)];
                one_to_one = one_to_one && (used & 1U << c.measurement) == 0;
                used |= 1U << c.measurement;
                value += c.log_ratio - rows[t].log_missed;
            }
            if (one_to_one) best = std::max(best, value);
            more = false;
            for (std::size_t t = 0; t < tracks && !more; ++t) {
                more = ++choice[t] <= rows[t].count;
                if (!more) choice[t] = 0;
            }
        }
        tracking::Assignment<double> dominants;
        tracking::detail::choose_optimally<double>(rows, dominants);
        double value = 0;
        for (std::size_t t = 0; t < tracks; ++t) {
            if (dominants.candidate[t] == tracking::detail::kNobody) continue;
            const auto& c = rows[t].item[static_cast<std::size_t>(dominants.candidate[t])];
            LONGS_EQUAL(t, dominants.owner[c.measurement]);
            value += c.log_ratio - rows[t].log_missed;
        }
        DOUBLES_EQUAL(best, value, 1e-9);
    }
}

TEST(OrderStatistics, SoftFormWorkedByHand) {
    // Both want the only measurement, ratios 4 and 1.5: row 0 has it. Row 1: .6 (1 - .8) = .12 against .4
    // missed.
    OrderStatisticsConfig<Real> config;
    config.reduction = tracking::Reduction::soft;
    config.covariance = tracking::CovarianceBetas::reshaped;
    auto rows = rows_of<Real>({{8000}, {6000}});
    tracking::order_statistics<Real>(rows, config);
    DOUBLES_EQUAL(.8, weight(rows[0], 0), 1e-6);
    DOUBLES_EQUAL(.12 / .52, weight(rows[1], 0), 1e-6);
    CHECK(rows[1].item[0].beta == rows[1].item[0].weight);

    config.covariance = tracking::CovarianceBetas::original;
    rows = rows_of<Real>({{8000}, {6000}});
    tracking::order_statistics<Real>(rows, config);
    DOUBLES_EQUAL(.12 / .52, weight(rows[1], 0), 1e-6);
    CHECK(rows[1].item[0].beta == constant<Real>(6, 10));
}

TEST(OrderStatistics, ExclusiveFormDropsWhatOthersClaimIfATrackHasItsOwn) {
    // Ratios to missed 7, 2 and 3, 5: row 0 dominates measurement 0, row 1 measurement 1 (7 * 5 > 2 * 3).
    auto rows = rows_of<double>({{7000, 2000}, {3000 * 10 / 9, 5000 * 10 / 9}});
    tracking::order_statistics<double>(rows, OrderStatisticsConfig<double>{});
    DOUBLES_EQUAL(.7 / .8, weight(rows[0], 0), 1e-12);
    DOUBLES_EQUAL(0.0, weight(rows[0], 1), 0.0);
    DOUBLES_EQUAL(0.0, weight(rows[1], 0), 0.0);
    DOUBLES_EQUAL(weight(rows[1], 1), rows[1].item[1].beta, 0.0);  // decided: the covariance believes it
}

TEST(OrderStatistics, ExclusiveFormSharesSoftlyIfATrackHasNone) {
    // The only measurement is row 0's; row 1 as in the soft form, and its covariance keeps the doubt.
    auto rows = rows_of<double>({{8000}, {6000}});
    tracking::order_statistics<double>(rows, OrderStatisticsConfig<double>{});
    DOUBLES_EQUAL(.8, weight(rows[0], 0), 1e-12);
    DOUBLES_EQUAL(.12 / .52, weight(rows[1], 0), 1e-12);
    DOUBLES_EQUAL(.6, rows[1].item[0].beta, 1e-12);
}

TEST(OrderStatistics, EveryVariantLeavesProperRows) {
    using namespace tracking;
    for (const auto precedence : {Precedence::index, Precedence::strength, Precedence::optimal}) {
        for (const auto missed : {MissedColumn::drop, MissedColumn::keep}) {
            for (const auto reduced : {Reduced::all_but_dominant, Reduced::claimed_by_others}) {
                for (const auto reduction : {Reduction::divide, Reduction::soft, Reduction::exclusive}) {
                    const OrderStatisticsConfig<Real> config{Real(4), precedence, missed,
                                                             reduced, reduction,  CovarianceBetas::original};
                    // More tracks than measurements, a row without doubt, an empty row.
                    auto rows = rows_of<Real>({{5000, 3000}, {9999, 0}, {0, 10000}, {}, {2500, 2500}});
                    order_statistics<Real>(rows, config);
                    for (const auto& row : rows) {
                        Real sum = row.missed_weight;
                        for (const auto& c : row.candidates()) {
                            CHECK(c.weight >= Real(0));
                            sum += c.weight;
                        }
                        CHECK(absolute(Real(sum - Real(1))) <= constant<Real>(1, 100'000));
                    }
                    CHECK(rows[3].missed_weight == Real(1));
                }
            }
        }
    }
    order_statistics<Real>(std::span<AssociationRow<Real>>{}, OrderStatisticsConfig<Real>{});
}
