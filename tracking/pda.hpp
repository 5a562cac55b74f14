/// Probabilistic data association, each track for itself (Bar-Shalom and Tse 1975), and the update of a
/// filter with several weighted measurements.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "tracking/association.hpp"
#include "tracking/gating.hpp"
#include "tracking/kalman.hpp"
#include "tracking/scratch.hpp"
#include "tracking/wide_sum.hpp"

namespace tracking {

/// beta_j = ratio_j / (1 - PD PG + sum of ratios), beta_0 the rest. In the logarithmic domain, relative to
/// the largest term: whatever the scale of the ratios, a row sums to 1 and never vanishes.
template <class S>
void pda(std::span<AssociationRow<S>> rows) {
    for (AssociationRow<S>& row : rows) {
        if (row.count == 0) {
            row.missed = row.missed_weight = S(1);
            row.log_evidence = row.log_missed;
            continue;
        }
        S largest = row.log_missed;
        for (const Candidate<S>& c : row.candidates()) {
            if (c.log_ratio > largest) largest = c.log_ratio;
        }
        row.missed = exp(row.log_missed - largest);
        S sum = row.missed;
        for (Candidate<S>& c : row.candidates()) {
            c.beta = exp(c.log_ratio - largest);
            sum += c.beta;
        }
        row.log_evidence = largest + ln(sum);
        const auto scale = reciprocal(sum);
        for (Candidate<S>& c : row.candidates()) c.weight = c.beta = share(c.beta, scale);
        row.missed_weight = row.missed = share(row.missed, scale);
    }
}

/// A weighted sum of symmetric matrices, rounded once, at the end.
template <class S>
class SymmetricSum {
  public:
    void add(S weight, const Mat2<S>& m) {
        sum00_.add_product(weight, m(0, 0));
        sum01_.add_product(weight, m(0, 1));
        sum11_.add_product(weight, m(1, 1));
    }
    /// weight v v', 0 <= weight <= 1.
    void add_outer(S weight, const Vec2<S>& v) {
        const S wv0 = weighted(weight, v[0]);
        const S wv1 = weighted(weight, v[1]);
        sum00_.add_product(wv0, v[0]);
        sum01_.add_product(wv0, v[1]);
        sum11_.add_product(wv1, v[1]);
    }
    [[nodiscard]] Mat2<S> value() const {
        Mat2<S> m;
        m(0, 0) = sum00_.value();
        m(0, 1) = m(1, 0) = sum01_.value();
        m(1, 1) = sum11_.value();
        return m;
    }

  private:
    WideSum<S> sum00_, sum01_, sum11_;
};

/// Moves (x, P) by the weighted corrections of a row: the Gaussian mixture over "missed" and each candidate,
/// each with its own gain because each has its own R, matched in mean and covariance.
///
/// With one R for all it is the PDA update x + K sum w nu, beta_0 P + (1 - beta_0) P_c + spread. The mean
/// moves by the weights; the covariance is that of the mixture of the betas about that mean, so it also
/// covers what a decision logic chose to ignore. A sum of squares: it stays positive in fixed point.
template <class S>
void update_with_row(Vec2<S>& x, Mat2<S>& p, const AssociationRow<S>& row,
                     std::span<const Measurement<S>> measurements, const Gate<S>& gate) {
    if (row.count == 0) return;
    const S negligible = constant<S>(1, 1 << 14);
    struct Move {
        S range, rate;
    };
    Scratch<Move, kMaxGated> moves;
    WideSum<S> mean_range, mean_rate;
    SymmetricSum<S> spread;
    spread.add(row.missed, p);
    for (std::size_t i = 0; i < static_cast<std::size_t>(row.count); ++i) {
        const Candidate<S>& c = row.item[i];
        if (c.beta < negligible && c.weight < negligible) continue;
        const Measurement<S>& m = measurements[c.measurement];
        const Innovation<S> innovation(p, gate.noise(m, row.obscured));
        const Vec2<S> move = innovation.move(gate.innovation(x, m.z));
        moves[i] = {move[0], move[1]};
        mean_range.add_product(c.weight, move[0]);
        mean_rate.add_product(c.weight, move[1]);
        if (!(c.beta < negligible)) spread.add(c.beta, innovation.posterior());
    }
    const Vec2<S> mean(mean_range.value(), mean_rate.value());
    spread.add_outer(row.missed, mean);
    for (std::size_t i = 0; i < static_cast<std::size_t>(row.count); ++i) {
        const S beta = row.item[i].beta;
        if (beta < negligible) continue;
        spread.add_outer(beta, Vec2<S>(moves[i].range - mean[0], moves[i].rate - mean[1]));
    }
    x[0] += mean[0];
    x[1] += mean[1];
    p = spread.value();
}

}  // namespace tracking
