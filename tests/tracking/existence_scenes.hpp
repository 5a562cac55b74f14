/// Rows for the tests of the existence-based solvers, and the plain solutions they are compared with.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "tracking/association.hpp"
#include "tracking/track.hpp"

namespace existence_scenes {

using tracking::AssociationRow;

/// Rows in double and the predicted existence that goes with them.
struct Scene {
    std::vector<AssociationRow<double>> rows;
    std::vector<double> existence;
};

/// From densities p (tracks x measurements, 0: not gated), rho = 1, q the same for all.
inline Scene scene_of(double q, const std::vector<double>& psi, const std::vector<std::vector<double>>& p) {
    Scene s;
    for (std::size_t t = 0; t < psi.size(); ++t) {
        AssociationRow<double> row;
        row.log_missed = std::log(1 - q);
        for (std::size_t j = 0; j < p[t].size(); ++j) {
            if (p[t][j] <= 0) continue;
            auto& c = row.item[static_cast<std::size_t>(row.count++)];
            c.measurement = static_cast<std::uint16_t>(j);
            c.log_ratio = std::log(q * p[t][j]);
        }
        s.rows.push_back(row);
        s.existence.push_back(psi[t]);
    }
    return s;
}

/// Random rows: each pair gated with probability `density`, log ratios uniform in +-spread.
inline Scene random_scene(std::mt19937& random, int tracks, int measurements, double density, double spread) {
    std::uniform_real_distribution<double> uniform(0, 1);
    Scene s;
    for (int t = 0; t < tracks; ++t) {
        AssociationRow<double> row;
        row.log_missed = std::log(0.02 + 0.9 * uniform(random));
        for (int j = 0; j < measurements && row.count < tracking::kMaxGated; ++j) {
            if (uniform(random) >= density) continue;
            auto& c = row.item[static_cast<std::size_t>(row.count++)];
            c.measurement = static_cast<std::uint16_t>(j);
            c.log_ratio = spread * (2 * uniform(random) - 1);
        }
        s.rows.push_back(row);
        s.existence.push_back(0.01 + 0.98 * uniform(random));
    }
    return s;
}

/// The posterior of one track, by listing: absent, present and missed, present and candidate c.
struct Posterior {
    double absent = 0;
    double missed = 0;
    std::array<double, tracking::kMaxGated> candidate{};
};

/// Lists every joint event: each track absent, present and missed, or present with one of its candidates that
/// no track before it has.
inline std::vector<Posterior> by_listing(const Scene& s) {
    std::vector<Posterior> sum(s.rows.size());
    std::vector<int> choice(s.rows.size(), -2);  // -2 absent, -1 missed, else candidate
    double total = 0;
    const auto visit = [&](auto&& self, std::size_t t, std::uint64_t used, double weight) -> void {
        if (t == s.rows.size()) {
            total += weight;
            for (std::size_t i = 0; i < choice.size(); ++i) {
                if (choice[i] == -2)
                    sum[i].absent += weight;
                else if (choice[i] == -1)
                    sum[i].missed += weight;
                else
                    sum[i].candidate[static_cast<std::size_t>(choice[i])] += weight;
            }
            return;
        }
        choice[t] = -2;
        self(self, t + 1, used, weight * (1 - s.existence[t]));
        choice[t] = -1;
        self(self, t + 1, used, weight * s.existence[t] * std::exp(s.rows[t].log_missed));
        for (int c = 0; c < s.rows[t].count; ++c) {
            const auto& item = s.rows[t].item[static_cast<std::size_t>(c)];
            const std::uint64_t bit = std::uint64_t{1} << item.measurement;
            if ((used & bit) != 0) continue;
            choice[t] = c;
            self(self, t + 1, used | bit, weight * s.existence[t] * std::exp(item.log_ratio));
        }
    };
    visit(visit, 0, 0, 1.0);
    for (Posterior& p : sum) {
        p.absent /= total;
        p.missed /= total;
        for (double& c : p.candidate) c /= total;
    }
    return sum;
}

/// Largest difference of the three kinds of probability between a solver's result and a listing.
template <class S>
double largest_error(std::span<const AssociationRow<S>> rows, std::span<const S> existence,
                     const std::vector<Posterior>& expected) {
    const auto number = [](S x) {
        if constexpr (std::floating_point<S>) {
            return x;
        } else {
            return x.raw() / static_cast<double>(std::int64_t{1} << S::fraction_bits);
        }
    };
    double worst = 0;
    const auto compare = [&](double a, double b) {
        if (!(std::abs(a - b) <= worst)) worst = std::abs(a - b);  // a NaN is an error too
    };
    for (std::size_t t = 0; t < rows.size(); ++t) {
        const double psi = number(existence[t]);
        compare(1 - psi, expected[t].absent);
        compare(psi * number(rows[t].missed), expected[t].missed);
        for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c)
            compare(psi * number(rows[t].item[c].beta), expected[t].candidate[c]);
    }
    return worst;
}

/// The scene in fixed point, rounded.
inline std::pair<std::vector<AssociationRow<dsp::Real>>, std::vector<dsp::Real>> fixed_of(const Scene& s) {
    const auto fixed = [](double x) {
        return dsp::Real::from_raw(static_cast<std::int32_t>(std::lround(x * 4194304)));
    };
    std::vector<AssociationRow<dsp::Real>> rows;
    std::vector<dsp::Real> psi;
    for (std::size_t t = 0; t < s.rows.size(); ++t) {
        AssociationRow<dsp::Real> row;
        row.count = s.rows[t].count;
        row.log_missed = fixed(s.rows[t].log_missed);
        for (std::size_t c = 0; c < static_cast<std::size_t>(row.count); ++c) {
            row.item[c].measurement = s.rows[t].item[c].measurement;
            row.item[c].log_ratio = fixed(s.rows[t].item[c].log_ratio);
        }
        rows.push_back(row);
        psi.push_back(fixed(s.existence[t]));
    }
    return {rows, psi};
}

}  // namespace existence_scenes
