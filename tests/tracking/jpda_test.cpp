// Expected marginals come from listing every one-to-one joint event (below), never from the recursion itself.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "tracking/jpda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::JpdaStatus;
using tracking::JpdaWorkspace;

namespace {

using Rows = std::vector<AssociationRow<double>>;

/// Sums the weights of all joint events by recursion over the tracks; fills beta and missed.
class EventList {
  public:
    explicit EventList(const Rows& rows)
        : rows_(rows), choice_(rows.size(), -1), mass_(rows.size() * (tracking::kMaxGated + 1), 0.0) {
        double top = 0.0;
        for (const auto& row : rows) {
            double best = row.log_missed;
            for (const auto& c : row.candidates()) best = std::max(best, c.log_ratio);
            top += best;
        }
        list(0, -top, 0);
    }
    [[nodiscard]] double missed(std::size_t t) const { return at(t, -1) / total_; }
    [[nodiscard]] double beta(std::size_t t, int c) const { return at(t, c) / total_; }
    [[nodiscard]] long events() const { return events_; }

  private:
    [[nodiscard]] double at(std::size_t t, int c) const {
        return mass_[t * (tracking::kMaxGated + 1) + static_cast<std::size_t>(c + 1)];
    }
    void list(std::size_t t, double log_weight, std::uint64_t used) {
        if (t == rows_.size()) {
            const double w = std::exp(log_weight);
            total_ += w;
            ++events_;
            for (std::size_t s = 0; s < rows_.size(); ++s)
                mass_[s * (tracking::kMaxGated + 1) + static_cast<std::size_t>(choice_[s] + 1)] += w;
            return;
        }
        choice_[t] = -1;
        list(t + 1, log_weight + rows_[t].log_missed, used);
        for (int c = 0; c < rows_[t].count; ++c) {
            const auto& item = rows_[t].item[static_cast<std::size_t>(c)];
            const std::uint64_t bit = std::uint64_t{1} << item.measurement;
            if ((used & bit) != 0) continue;
            choice_[t] = c;
            list(t + 1, log_weight + item.log_ratio, used | bit);
        }
    }
    const Rows& rows_;
    std::vector<int> choice_;
    std::vector<double> mass_;
    double total_ = 0.0;
    long events_ = 0;
};

void add(AssociationRow<double>& row, int measurement, double log_ratio) {
    auto& c = row.item[static_cast<std::size_t>(row.count++)];
    c.measurement = static_cast<std::uint16_t>(measurement);
    c.log_ratio = log_ratio;
}

struct Shape {
    int tracks;
    int measurements;
    double density;  ///< chance that a pair is gated
    double spread;   ///< of the log ratios
    double log_missed;
};

Rows random_rows(std::mt19937& random, const Shape& shape) {
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    Rows rows(static_cast<std::size_t>(shape.tracks));
    for (auto& row : rows) {
        row.log_missed = shape.log_missed;
        for (int j = 0; j < shape.measurements; ++j)
            if (uniform(random) < shape.density) add(row, j, shape.spread * (uniform(random) - 0.6));
    }
    return rows;
}

std::vector<AssociationRow<Real>> to_fixed(Rows& rows) {
    std::vector<AssociationRow<Real>> fixed(rows.size());
    const auto real = [](double& v) {
        const double clipped = std::clamp(v, -512.0, 511.0);
        const auto raw = static_cast<std::int32_t>(std::lround(clipped * 4194304.0));
        v = raw / 4194304.0;
        return Real::from_raw(raw);
    };
    for (std::size_t t = 0; t < rows.size(); ++t) {
        fixed[t].count = rows[t].count;
        fixed[t].log_missed = real(rows[t].log_missed);
        for (int c = 0; c < rows[t].count; ++c) {
            auto& from = rows[t].item[static_cast<std::size_t>(c)];
            auto& to = fixed[t].item[static_cast<std::size_t>(c)];
            to.measurement = from.measurement;
            to.log_ratio = real(from.log_ratio);
        }
    }
    return fixed;
}

double to_double(double v) {
    return v;
}
double to_double(Real v) {
    return v.raw() / 4194304.0;
}

template <class S>
double largest_error(const std::vector<AssociationRow<S>>& rows, const EventList& events) {
    double worst = 0.0;
    for (std::size_t t = 0; t < rows.size(); ++t) {
        worst = std::max(worst, std::abs(to_double(rows[t].missed) - events.missed(t)));
        for (int c = 0; c < rows[t].count; ++c)
            worst = std::max(worst, std::abs(to_double(rows[t].item[static_cast<std::size_t>(c)].beta) -
                                             events.beta(t, c)));
    }
    return worst;
}

template <class S>
double worst_row_sum(const std::vector<AssociationRow<S>>& rows) {
    double worst = 0.0;
    for (const auto& row : rows) {
        double sum = to_double(row.missed);
        for (const auto& c : row.candidates()) sum += to_double(c.beta);
        worst = std::max(worst, std::abs(sum - 1.0));
    }
    return worst;
}

JpdaWorkspace<double> g_work;
JpdaWorkspace<Real> g_fixed_work;

template <class S>
JpdaStatus associate(std::vector<AssociationRow<S>>& rows) {
    if constexpr (std::is_same_v<S, double>) {
        return tracking::jpda<S>(rows, g_work);
    } else {
        return tracking::jpda<S>(rows, g_fixed_work);
    }
}

constexpr std::array<Shape, 9> kShapes{{{2, 3, 1.0, 8.0, -2.3},
                                        {4, 7, 1.0, 8.0, -2.3},
                                        {4, 7, 0.4, 12.0, -2.3},
                                        {6, 8, 1.0, 6.0, -1.0},
                                        {6, 8, 0.5, 10.0, -3.0},
                                        {6, 8, 0.25, 10.0, -6.9},
                                        {6, 2, 1.0, 10.0, -2.3},
                                        {6, 4, 0.7, 25.0, -4.6},
                                        {5, 8, 0.6, 60.0, -20.0}}};

}  // namespace

TEST_GROUP(Jpda){};

TEST(Jpda, DoubleEqualsListingAllEvents) {
    std::mt19937 random(1);
    double worst = 0.0;
    for (const Shape& shape : kShapes) {
        for (int i = 0; i < 30; ++i) {
            Rows rows = random_rows(random, shape);
            const EventList events(rows);
            const JpdaStatus status = associate(rows);
            LONGS_EQUAL(0, status.approximated);
            worst = std::max(worst, largest_error(rows, events));
        }
    }
    CHECK(worst <= 1e-12);
}

TEST(Jpda, FixedPointEqualsListingAllEvents) {
    std::mt19937 random(2);
    double worst = 0.0;
    double worst_sum = 0.0;
    for (const Shape& shape : kShapes) {
        for (int i = 0; i < 30; ++i) {
            Rows rows = random_rows(random, shape);
            auto fixed = to_fixed(rows);
            const EventList events(rows);
            const JpdaStatus status = associate(fixed);
            LONGS_EQUAL(0, status.approximated);
            worst = std::max(worst, largest_error(fixed, events));
            worst_sum = std::max(worst_sum, worst_row_sum(fixed));
        }
    }
    CHECK(worst <= 2e-3);
    CHECK(worst_sum <= 1e-3);
}

TEST(Jpda, NoTracksNoMeasurementsAndOneOfEach) {
    Rows none;
    LONGS_EQUAL(0, associate(none).clusters);

    Rows rows(2);
    rows[0].log_missed = -2.0;
    rows[1].log_missed = -2.0;
    LONGS_EQUAL(0, associate(rows).clusters);
    DOUBLES_EQUAL(1.0, rows[0].missed, 1e-15);

    add(rows[0], 5, 1.0);
    LONGS_EQUAL(0, associate(rows).clusters);
    DOUBLES_EQUAL(1.0 / (1.0 + std::exp(-3.0)), rows[0].item[0].beta, 1e-15);
    DOUBLES_EQUAL(1.0, rows[1].missed, 1e-15);
}

TEST(Jpda, IdenticalTracksShareIdenticalMeasurementsEvenly) {
    Rows rows(3);
    for (auto& row : rows) {
        row.log_missed = std::log(0.1);
        for (int j = 0; j < 4; ++j) add(row, 10 + j, 2.0);
    }
    auto fixed = to_fixed(rows);
    const EventList events(rows);
    associate(rows);
    associate(fixed);
    CHECK(largest_error(rows, events) <= 1e-14);
    CHECK(largest_error(fixed, events) <= 2e-6);
    for (const auto& row : rows)
        for (const auto& c : row.candidates()) DOUBLES_EQUAL(rows[0].item[0].beta, c.beta, 1e-14);
}

TEST(Jpda, CertainDetectionSharesTheOnlyMeasurement) {
    // PD PG = 1: ln(1 - PD PG) is -inf. One of the two must still go without.
    Rows rows(2);
    for (auto& row : rows) {
        row.log_missed = -std::numeric_limits<double>::infinity();
        add(row, 0, 3.0);
    }
    auto fixed = to_fixed(rows);
    associate(rows);
    associate(fixed);
    for (std::size_t t = 0; t < 2; ++t) {
        DOUBLES_EQUAL(0.5, rows[t].missed, 1e-12);
        DOUBLES_EQUAL(0.5, rows[t].item[0].beta, 1e-12);
        DOUBLES_EQUAL(0.5, to_double(fixed[t].missed), 1e-6);
        DOUBLES_EQUAL(0.5, to_double(fixed[t].item[0].beta), 1e-6);
    }
}

TEST(Jpda, NoClutterTakesThePairsForCertain) {
    Rows rows(2);
    for (std::size_t t = 0; t < 2; ++t) {
        rows[t].log_missed = std::log(0.1);
        add(rows[t], 0, t == 0 ? std::numeric_limits<double>::infinity() : 3.0);
        add(rows[t], 1, t == 1 ? std::numeric_limits<double>::infinity() : 3.0);
    }
    auto fixed = to_fixed(rows);
    associate(rows);
    associate(fixed);
    for (std::size_t t = 0; t < 2; ++t) {
        DOUBLES_EQUAL(1.0, rows[t].item[t].beta, 1e-12);
        DOUBLES_EQUAL(1.0, to_double(fixed[t].item[t].beta), 1e-6);
        DOUBLES_EQUAL(0.0, to_double(fixed[t].missed), 1e-6);
    }
}

TEST(Jpda, ProductsOfManySmallLikelihoodsDoNotUnderflow) {
    // Eight tracks want the same measurement; each joint event weighs about e^-140.
    Rows rows(8);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        rows[t].log_missed = -20.0;
        add(rows[t], 0, -0.1 * static_cast<double>(t));
        if (t > 0) add(rows[t], static_cast<int>(t), -20.0);
        if (t + 1 < rows.size()) add(rows[t], static_cast<int>(t) + 1, -19.0);
    }
    auto fixed = to_fixed(rows);
    const EventList events(rows);
    associate(rows);
    associate(fixed);
    CHECK(largest_error(rows, events) <= 1e-12);
    CHECK(largest_error(fixed, events) <= 2e-3);
    CHECK(worst_row_sum(fixed) <= 1e-3);
}

TEST(Jpda, IndependentClustersDoNotDisturbEachOther) {
    std::mt19937 random(3);
    Rows left = random_rows(random, {4, 6, 0.8, 8.0, -2.0});
    Rows right = random_rows(random, {4, 6, 0.8, 8.0, -2.0});
    Rows both = left;
    for (AssociationRow<double> row : right) {
        for (auto& c : row.candidates()) c.measurement = static_cast<std::uint16_t>(c.measurement + 50);
        both.push_back(row);
    }
    associate(left);
    associate(right);
    const JpdaStatus status = associate(both);
    LONGS_EQUAL(2, status.clusters);
    LONGS_EQUAL(4, status.largest);
    for (std::size_t t = 0; t < 4; ++t) {
        for (std::size_t c = 0; c < static_cast<std::size_t>(left[t].count); ++c)
            DOUBLES_EQUAL(left[t].item[c].beta, both[t].item[c].beta, 1e-13);
        DOUBLES_EQUAL(right[t].missed, both[t + 4].missed, 1e-13);
    }
}

TEST(Jpda, LargestExactClusterAndTheFirstPastIt) {
    std::mt19937 random(4);
    Rows exact = random_rows(random, {8, 12, 1.0, 8.0, -2.0});
    const JpdaStatus at_capacity = associate(exact);
    LONGS_EQUAL(1, at_capacity.clusters);
    LONGS_EQUAL(8, at_capacity.largest);
    LONGS_EQUAL(0, at_capacity.approximated);

    Rows wide = random_rows(random, {8, 13, 1.0, 8.0, -2.0});
    LONGS_EQUAL(1, associate(wide).approximated);

    // Many tracks on few measurements: subsets of the measurements.
    Rows few = random_rows(random, {12, 8, 1.0, 8.0, -2.0});
    LONGS_EQUAL(0, associate(few).approximated);
}

TEST(Jpda, FixedPointHoldsAtFullCapacity) {
    // 8 tracks, 12 shared measurements, the most joint events there can be; listing 3e8 of them takes
    // minutes, so the reference is the recursion in double, which is checked against events above.
    std::mt19937 random(7);
    double worst = 0.0;
    for (const double spread : {0.0, 1.0, 4.0, 12.0, 30.0}) {
        for (int i = 0; i < 5; ++i) {
            Rows rows = random_rows(random, {8, 12, 1.0, spread, -2.3});
            auto fixed = to_fixed(rows);
            LONGS_EQUAL(0, associate(rows).approximated);
            LONGS_EQUAL(0, associate(fixed).approximated);
            for (std::size_t t = 0; t < rows.size(); ++t) {
                worst = std::max(worst, std::abs(rows[t].missed - to_double(fixed[t].missed)));
                for (std::size_t c = 0; c < 12; ++c)
                    worst =
                        std::max(worst, std::abs(rows[t].item[c].beta - to_double(fixed[t].item[c].beta)));
            }
            CHECK(worst_row_sum(fixed) <= 1e-3);
        }
    }
    CHECK(worst <= 2e-3);
}

TEST(Jpda, ApproximationOfLargeClustersIsCloserToTheEventsThanPda) {
    // A convoy: ten tracks, each in reach of three measurements, two of them shared with the neighbours.
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-3.0, 5.0);
    double error = 0.0;
    double fixed_error = 0.0;
    double pda_error = 0.0;
    constexpr int kRuns = 20;
    for (int i = 0; i < kRuns; ++i) {
        Rows rows(10);
        for (int t = 0; t < 10; ++t) {
            auto& row = rows[static_cast<std::size_t>(t)];
            row.log_missed = std::log(0.1);
            for (int j = t; j < t + 3; ++j) add(row, j, uniform(random));
        }
        auto fixed = to_fixed(rows);
        const EventList events(rows);
        Rows alone;
        for (const auto& row : rows) {
            Rows one{row};
            associate(one);
            alone.push_back(one[0]);
        }
        LONGS_EQUAL(1, associate(rows).approximated);
        LONGS_EQUAL(1, associate(fixed).approximated);
        error += largest_error(rows, events) / kRuns;
        fixed_error += largest_error(fixed, events) / kRuns;
        pda_error += largest_error(alone, events) / kRuns;
        CHECK(worst_row_sum(fixed) <= 1e-3);
    }

    CHECK(error <= 0.15);
    CHECK(fixed_error <= 0.15);
    CHECK(pda_error >= 3.0 * error);
}

TEST(Jpda, FullCapacityOfTracksAndMeasurements) {
    std::mt19937 random(6);
    Rows rows = random_rows(random, {tracking::kMaxTracks, tracking::kMaxGated, 1.0, 8.0, -2.0});
    auto fixed = to_fixed(rows);
    LONGS_EQUAL(1, associate(rows).approximated);
    LONGS_EQUAL(1, associate(fixed).approximated);
    LONGS_EQUAL(tracking::kMaxTracks, associate(fixed).largest);
    CHECK(worst_row_sum(rows) <= 1e-9);
    CHECK(worst_row_sum(fixed) <= 1e-3);
}
