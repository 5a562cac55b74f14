// Expected values: printed vector of the formulas, 10^6 drawn scenes, listing of all assignments.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <vector>

#include "tests/tracking/existence_calibration.hpp"
#include "tracking/ihpda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::IhpdaConfig;
using tracking::RankInput;
using tracking::Sharing;

namespace {
/// The vector: m = 3, snr 4, q .8, lambda .1, V 20, psi .5, p = [.15 .3 .02] by rank.
AssociationRow<double> vector_row() {
    AssociationRow<double> row;
    row.log_missed = std::log(.2);
    for (const double p : {.15, .3, .02}) {
        auto& c = row.item[static_cast<std::size_t>(row.count)];
        c.measurement = static_cast<std::uint16_t>(row.count++);
        c.log_ratio = std::log(.8 * p / .1);
    }
    return row;
}
const RankInput<double> kVectorInput{.log_gate_clutter = std::log(.1 * 20), .log_spread = std::log(5.0)};
constexpr std::array<double, 3> kVectorStrength{9, 5, 2};

template <class S>
void associate(std::vector<AssociationRow<S>>& rows, std::vector<S>& psi, std::vector<S> strength,
               RankInput<S> input, IhpdaConfig config) {
    const auto work = std::make_unique<tracking::IhpdaWorkspace<S>>();
    const std::vector<RankInput<S>> inputs(rows.size(), input);
    tracking::ihpda<S>(rows, psi, strength, inputs, config, *work);
}
}  // namespace

TEST_GROUP(Ihpda){};

TEST(Ihpda, PrintedVector) {
    constexpr std::array<double, 3> rank{.757576, .151515, .090909};
    constexpr std::array<double, 3> beta{.847458, .472441, .032698};
    constexpr std::array<double, 3> psi{.762931, .697802, .571651};
    std::array<double, 3> p{};
    tracking::rank_probabilities<double>(std::log(5.0), p);
    for (std::size_t l = 0; l < 3; ++l) DOUBLES_EQUAL(rank[l], p[l], 6e-7);
    for (std::size_t l = 0; l < 3; ++l) {
        // The rank whose beta is wanted is made the choice by weighing it alone.
        tracking::detail::RankHypotheses<double> h;
        const auto row = vector_row();
        std::array<double, 3> weight{};
        for (std::size_t c = 0; c < 3; ++c) weight[c] = std::exp(row.item[c].log_ratio);
        constexpr std::array<double, 3> plain{1, 1, 1};
        tracking::detail::rank_hypotheses<double>(row, 0b111, kVectorStrength, kVectorInput, weight, plain,
                                                  h);
        const double likelihood = h.is_target[l] + h.is_not[l];
        DOUBLES_EQUAL(beta[l], h.is_target[l] / likelihood, 6e-7);
        DOUBLES_EQUAL(psi[l], .5 * likelihood / (.5 + .5 * likelihood), 6e-7);
    }
    std::vector<AssociationRow<double>> rows{vector_row()};
    std::vector<double> existence{.5};
    associate<double>(rows, existence, {9, 5, 2}, kVectorInput, {.sharing = Sharing::ignored});
    DOUBLES_EQUAL(beta[0], rows[0].item[0].beta, 6e-7);
    DOUBLES_EQUAL(1 - beta[0], rows[0].missed, 6e-7);
    DOUBLES_EQUAL(0, rows[0].item[1].beta, 0);
    DOUBLES_EQUAL(psi[0], existence[0], 6e-7);

    // The same in fixed point, the order of the measurements turned round.
    AssociationRow<Real> fixed;
    fixed.log_missed = Real::from_raw(static_cast<std::int32_t>(std::lround(std::log(.2) * 4194304)));
    for (const double d : {.02, .3, .15}) {
        auto& c = fixed.item[static_cast<std::size_t>(fixed.count)];
        c.measurement = static_cast<std::uint16_t>(fixed.count++);
        c.log_ratio = Real::from_raw(static_cast<std::int32_t>(std::lround(std::log(8 * d) * 4194304)));
    }
    std::vector<AssociationRow<Real>> fixed_rows{fixed};
    std::vector<Real> fixed_psi{Real::ratio(1, 2)};
    associate<Real>(fixed_rows, fixed_psi, {Real(2), Real(5), Real(9)},
                    {.log_gate_clutter = tracking::ln(Real(2)), .log_spread = tracking::ln(Real(5))},
                    {.sharing = Sharing::ignored});
    DOUBLES_EQUAL(beta[0], fixed_rows[0].item[2].beta.raw() / 4194304.0, 2e-6);
    DOUBLES_EQUAL(psi[0], fixed_psi[0].raw() / 4194304.0, 2e-6);
}

TEST(Ihpda, RankProbabilitiesAgainstAMillionScenes) {
    CHECK(existence_scenes::worst_rank_sigma(1'000'000) <= 3);
}

TEST(Ihpda, RankProbabilitiesKeepTheirDigits) {
    // m = 16, 40 dB, fixed point: still sums to 1, and is the double's.
    std::array<tracking::ScaledWeight, 16> fixed{};
    std::array<double, 16> p{};
    tracking::rank_probabilities<Real>(Real::ratio(9210, 1000), fixed);
    tracking::rank_probabilities<double>(9.21, p);
    double sum = 0;
    for (std::size_t l = 0; l < 16; ++l) {
        const double x = fixed[l].to<22>().raw() / 4194304.0;
        DOUBLES_EQUAL(p[l], x, 1e-6);
        sum += x;
    }
    DOUBLES_EQUAL(1, sum, 4e-6);
}

TEST(Ihpda, EmptyGateIsAMiss) {
    std::vector<AssociationRow<double>> rows(1);
    rows[0].log_missed = std::log(.2);
    std::vector<double> psi{.5};
    associate<double>(rows, psi, {}, kVectorInput, {});
    DOUBLES_EQUAL(1, rows[0].missed, 0);
    DOUBLES_EQUAL(.2 * .5 / (1 - .8 * .5), psi[0], 1e-15);
}

namespace {
/// Rows made so that T / (T + F) is a given table of betas. Two measurements, huge expected clutter, so F = 1
/// - q and ranks equally likely (equal spread): beta = T / (T + F).
std::vector<AssociationRow<double>> rows_of(const std::vector<std::vector<double>>& beta) {
    std::vector<AssociationRow<double>> rows;
    for (const auto& b : beta) {
        AssociationRow<double> row;
        row.log_missed = std::log(.5);
        for (std::size_t j = 0; j < b.size(); ++j) {
            auto& c = row.item[static_cast<std::size_t>(row.count++)];
            c.measurement = static_cast<std::uint16_t>(j);
            c.log_ratio = std::log(.5 * b[j] / (1 - b[j]));  // m * P_l = 1
        }
        rows.push_back(row);
    }
    return rows;
}
const RankInput<double> kRanksSayNothing{.log_gate_clutter = 200, .log_spread = 0};
}  // namespace

TEST(Ihpda, OptimalAndGreedyOnTheHandWorkedTable) {
    // [.9 .8; .85 .1]: optimal takes .8 + .85 = 1.65, greedy .9 + .1 = 1.0.
    for (const bool greedy : {false, true}) {
        auto rows = rows_of({{.9, .8}, {.85, .1}});
        std::vector<double> psi{.5, .5};
        associate<double>(rows, psi, {1, 1}, kRanksSayNothing,
                          {.sharing = greedy ? Sharing::greedy : Sharing::optimal});
        CHECK((rows[0].item[0].beta > 0) == greedy);
        CHECK((rows[0].item[1].beta > 0) != greedy);
        CHECK((rows[1].item[1].beta > 0) == greedy);
        CHECK((rows[1].item[0].beta > 0) != greedy);
    }
}

TEST(Ihpda, ExistenceDecidesBetweenDuplicates) {
    // A doubtful track a little nearer to the only measurement does not rob a sure one.
    for (const bool by_existence : {true, false}) {
        auto rows = rows_of({{.9}, {.95}});
        std::vector<double> psi{.99, .1};
        associate<double>(rows, psi, {1}, kRanksSayNothing,
                          {.sharing = Sharing::optimal, .by_existence = by_existence});
        CHECK((rows[0].item[0].beta > 0) == by_existence);
        CHECK((rows[1].missed == 1) == by_existence);
    }
}

TEST(Ihpda, OptimalAssignmentHasTheBestSumOfAllByListing) {
    std::mt19937 random(32);  // NOLINT
    std::uniform_real_distribution<double> uniform(0.01, 0.99);
    for (int i = 0; i < 60; ++i) {
        const std::size_t n = 2 + static_cast<std::size_t>(i) % 7;
        std::vector<std::vector<double>> beta(n, std::vector<double>(n));
        for (auto& row : beta)
            for (double& b : row) b = uniform(random);
        auto rows = rows_of(beta);
        std::vector<double> psi(n, .5);
        associate<double>(rows, psi, std::vector<double>(n, 1), kRanksSayNothing,
                          {.sharing = Sharing::optimal, .by_existence = false});
        double found = 0;
        for (std::size_t t = 0; t < n; ++t)
            for (std::size_t j = 0; j < n; ++j)
                if (rows[t].item[j].beta > 0) found += beta[t][j];
        double best = 0;
        std::vector<std::size_t> order(n);
        for (std::size_t k = 0; k < n; ++k) order[k] = k;
        do {
            double sum = 0;
            for (std::size_t t = 0; t < n; ++t) sum += beta[t][order[t]];
            best = std::max(best, sum);
        } while (std::next_permutation(order.begin(), order.end()));
        DOUBLES_EQUAL(best, found, 1e-12);
    }
}

TEST(Ihpda, LinearFormSeparatesTwoTracksOnTwoMeasurements) {
    // Each track likes its own measurement more; seen as clutter, the rival makes the wrong one dearer still.
    auto rows = rows_of({{.95, .90}, {.90, .95}});
    std::vector<double> psi{.9, .9};
    associate<double>(rows, psi, {1, 1}, kRanksSayNothing, {.sharing = Sharing::greedy, .modulated = true});
    CHECK(rows[0].item[0].beta > .85 && rows[1].item[1].beta > .85);
    CHECK(psi[0] > .9 && psi[1] > .9);
}
