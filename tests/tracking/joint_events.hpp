/// Random association rows, and their marginals by listing every one-to-one joint event.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "dsp/fixed_point.hpp"
#include "tracking/association.hpp"

namespace joint_events {

using dsp::Real;
using tracking::AssociationRow;
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

inline void add(AssociationRow<double>& row, int measurement, double log_ratio) {
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

inline Rows random_rows(std::mt19937& random, const Shape& shape) {
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    Rows rows(static_cast<std::size_t>(shape.tracks));
    for (auto& row : rows) {
        row.log_missed = shape.log_missed;
        for (int j = 0; j < shape.measurements; ++j)
            if (uniform(random) < shape.density) add(row, j, shape.spread * (uniform(random) - 0.6));
    }
    return rows;
}

inline std::vector<AssociationRow<Real>> to_fixed(Rows& rows) {
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

inline double to_double(double v) {
    return v;
}
inline double to_double(Real v) {
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

/// Sparse and dense, more tracks than measurements and fewer, likelihoods close together and far apart.
inline constexpr std::array<Shape, 9> kShapes{{{2, 3, 1.0, 8.0, -2.3},
                                               {4, 7, 1.0, 8.0, -2.3},
                                               {4, 7, 0.4, 12.0, -2.3},
                                               {6, 8, 1.0, 6.0, -1.0},
                                               {6, 8, 0.5, 10.0, -3.0},
                                               {6, 8, 0.25, 10.0, -6.9},
                                               {6, 2, 1.0, 10.0, -2.3},
                                               {6, 4, 0.7, 25.0, -4.6},
                                               {5, 8, 0.6, 60.0, -20.0}}};

}  // namespace joint_events
