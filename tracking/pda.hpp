/// Probabilistic data association, each track for itself (Bar-Shalom and Tse 1975), and the update of a
/// filter with several weighted measurements.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "tracking/association.hpp"
#include "tracking/gating.hpp"
#include "tracking/kalman.hpp"

namespace tracking {

/// beta_j = ratio_j / (1 - PD PG + sum of ratios), beta_0 the rest. In the logarithmic domain, relative to
/// the largest term: whatever the scale of the ratios, a row sums to 1 and never vanishes.
template <class S>
void pda(std::span<AssociationRow<S>> rows) {
    for (AssociationRow<S>& row : rows) {
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
        row.missed = row.missed * scale;
        for (Candidate<S>& c : row.candidates()) c.beta = c.beta * scale;
        use_betas_as_weights(row);
    }
}

/// Moves (x, P) by the weighted corrections of a row: the Gaussian mixture over "missed" and each candidate,
/// each with its own gain because each has its own R, matched in mean and covariance.
///
/// With one R for all it is the PDA update x + K sum w nu, beta_0 P + (1 - beta_0) P_c + spread. The mean
/// moves by the weights; the covariance is that of the mixture of the betas about that mean, so it also
/// covers what a decision logic chose to ignore. A sum of squares: it stays positive in fixed point.
template <class S>
void update_with_row(Vec2<S>& x, Mat2<S>& p, const AssociationRow<S>& row,
                     std::span<const Measurement<S>> measurements, const Gate<S>& gate) {
    const S negligible = constant<S>(1, 1 << 14);
    std::array<Vec2<S>, kMaxGated> moves;
    Vec2<S> mean(S(0), S(0));
    Mat2<S> spread = p * row.missed;
    for (std::size_t i = 0; i < static_cast<std::size_t>(row.count); ++i) {
        const Candidate<S>& c = row.item[i];
        moves[i] = Vec2<S>(S(0), S(0));
        if (c.beta < negligible && c.weight < negligible) continue;
        const Measurement<S>& m = measurements[c.measurement];
        const Vec2<S> r = gate.noise(m, row.obscured);
        const Ldl<S> s(innovation_covariance(p, r));
        const Mat2<S> k = gain(p, s);
        moves[i] = correction(k, gate.innovation(x, m.z));
        mean[0] += c.weight * moves[i][0];
        mean[1] += c.weight * moves[i][1];
        const Mat2<S> posterior = posterior_covariance(p, k, r);
        spread(0, 0) += c.beta * posterior(0, 0);
        spread(0, 1) += c.beta * posterior(0, 1);
        spread(1, 1) += c.beta * posterior(1, 1);
    }
    add_outer(spread, row.missed, mean);
    for (std::size_t i = 0; i < static_cast<std::size_t>(row.count); ++i) {
        const Candidate<S>& c = row.item[i];
        if (c.beta < negligible) continue;
        add_outer(spread, c.beta, Vec2<S>(moves[i][0] - mean[0], moves[i][1] - mean[1]));
    }
    spread(1, 0) = spread(0, 1);
    x[0] += mean[0];
    x[1] += mean[1];
    p = spread;
}

}  // namespace tracking
