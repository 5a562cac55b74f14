/// Probabilistic data association, each track for itself (Bar-Shalom and Tse 1975), and the update of a
/// filter with several weighted measurements.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/association.hpp"
#include "tracking/gating.hpp"
#include "tracking/kalman.hpp"
#include "tracking/scalar.hpp"

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
            c.beta = c.log_ratio == largest ? S(1) : exp(c.log_ratio - largest);
            sum += c.beta;
        }
        row.log_evidence = largest + ln(sum);
        const auto scale = reciprocal(sum);
        for (Candidate<S>& c : row.candidates()) c.weight = c.beta = share(c.beta, scale);
        row.missed_weight = row.missed = share(row.missed, scale);
    }
}

/// The Gaussian mixture of a prediction (0, P) that missed and of what the Kalman filter makes of it with
/// each of several measurements, matched in mean and covariance: every measurement has its own gain because
/// it has its own R. The mean is that of the weights; the covariance is that of the mixture of the betas
/// about it.
template <class S>
class Mixture {
  public:
    /// `usual_noise`: about the variances of most measurements. Others are welcome, at some cost.
    Mixture(const Mat2<S>& p, const Vec2<S>& /*usual_noise*/) : p_(p) {}

    /// nu as for Innovation.
    void add(const Vec2<S>& nu, const Vec2<S>& r, S weight, S beta) {
        const Innovation<S> innovation(p_, r);
        const Vec2<S> move = innovation.move(nu);
        first_ += beta * move;
        off_ += (weight - beta) * move;
        second_ += beta * (innovation.posterior() + move * move.transpose());
    }
    [[nodiscard]] Vec2<S> mean() const { return first_ + off_; }
    /// `missed`: beta of the prediction. It and the betas added sum up to 1 at most.
    [[nodiscard]] Mat2<S> covariance(S missed) const {
        return missed * p_ + second_ - first_ * first_.transpose() + off_ * off_.transpose();
    }

  private:
    Mat2<S> p_;
    Vec2<S> first_ = Vec2<S>::Zero();   // moment of the betas
    Vec2<S> off_ = Vec2<S>::Zero();     // by how much that of the weights is another
    Mat2<S> second_ = Mat2<S>::Zero();  // moment of the betas, and their posteriors
};

/// In fixed point scaled as Innovation is, but alike for all measurements, so that nothing need be rounded to
/// the format before the end. Errors of mean and covariance: 4 LSB and, as long as no measurement is 100
/// times as inaccurate as another, a relative 2^-18 / (1 - correlation^2) of R, of the moves and of their
/// squares. The covariance is positive definite whatever R.
template <int F>
class Mixture<dsp::Fixed<F>> {
    using S = dsp::Fixed<F>;
    using Inverse = detail::ScaledInverse;

  public:
    Mixture(const Mat2<S>& p, const Vec2<S>& usual_noise) : p0_(p(0, 0)), p1_(p(1, 1)), cross_(p(0, 1)) {
        const auto with_headroom = [](S variance) { return variance + variance; };
        set_scale(detail::scale_of(with_headroom(p0_ + usual_noise[0])),
                  detail::scale_of(with_headroom(p1_ + usual_noise[1])));
    }

    [[gnu::always_inline]] void add(const Vec2<S>& nu, const Vec2<S>& r, S weight, S beta) {
        const S sum0 = p0_ + r[0];
        const S sum1 = p1_ + r[1];
        if (sum0 > most0_ || sum1 > most1_) [[unlikely]]
            make_room(sum0, sum1);
        const std::int32_t s0 = sum0.raw() << 2 * k0_;
        const std::int32_t s1 = sum1.raw() << 2 * k1_;
        const Inverse inverse(s0, scaled_cross_, s1, cross_squared_, kMostZeros);
        if (!inverse.valid) [[unlikely]] {  // says nothing that P does not
            unused_ += beta;
            return;
        }
        const std::int32_t r0 = s0 - scaled0_;
        const std::int32_t r1 = s1 - scaled1_;

        // The move is nu - R S^-1 nu.
        const std::int32_t n0 = nu[0].raw() << k0_;
        const std::int32_t n1 = nu[1].raw() << k1_;
        const auto v = inverse.solve(n0, n1);
        const std::int32_t move0 = n0 - Inverse::shifted(dsp::product(r0, v.v0), 30 - inverse.zeros);
        const std::int32_t move1 = n1 - Inverse::shifted(dsp::product(r1, v.v1), 30 - inverse.zeros);
        const std::int32_t part0 = part_of(beta, move0);
        const std::int32_t part1 = part_of(beta, move1);
        first0_ += part0;
        first1_ += part1;
        if (weight != beta) {
            off0_ += part_of(weight, move0) - part0;
            off1_ += part_of(weight, move1) - part1;
        }

        // The posterior is R - R S^-1 R.
        const std::int32_t kept01 = dsp::detail::high_product(r0, inverse.i01);
        const std::int32_t posterior00 = posterior(r0, inverse.i00, inverse.zeros);
        const std::int32_t posterior11 = posterior(r1, inverse.i11, inverse.zeros);
        const std::int32_t minus01 = dsp::detail::high_product(kept01, r1) << (inverse.zeros + 2);
        second00_ = dsp::accumulated(dsp::accumulated(second00_, beta.raw(), posterior00), part0, move0);
        second01_ = dsp::accumulated(dsp::accumulated(second01_, beta.raw(), -minus01), part0, move1);
        second11_ = dsp::accumulated(dsp::accumulated(second11_, beta.raw(), posterior11), part1, move1);
    }

    [[nodiscard]] Vec2<S> mean() const {
        const auto nearest = [](std::int32_t v, int k) { return S::from_raw((v + (1 << k >> 1)) >> k); };
        return {nearest(first0_ + off0_, k0_), nearest(first1_ + off1_, k1_)};
    }
    [[nodiscard]] Mat2<S> covariance(S missed) const {
        const std::int32_t predicted = (missed + unused_).raw();
        const auto about_mean = [&](std::int64_t second, std::int32_t p, std::int32_t a, std::int32_t b,
                                    std::int32_t off_a, std::int32_t off_b) {
            return dsp::accumulated(dsp::accumulated(second - dsp::product(a, b), predicted, p), off_a,
                                    off_b);
        };
        const auto positive = [](std::int32_t v) { return v > 0 ? v : 1; };
        const std::int32_t v00 =
            positive(unscaled(about_mean(second00_, scaled0_, first0_, first0_, off0_, off0_), F + 2 * k0_));
        const std::int32_t v11 =
            positive(unscaled(about_mean(second11_, scaled1_, first1_, first1_, off1_, off1_), F + 2 * k1_));
        std::int32_t v01 =
            unscaled(about_mean(second01_, scaled_cross_, first0_, first1_, off0_, off1_), F + k0_ + k1_);
        // Where R leaves P next to no digits, rounding could make it anything.
        if (dsp::product(v01, v01) >= dsp::product(v00, v11)) [[unlikely]]
            v01 = 0;
        Mat2<S> out;
        out(0, 0) = S::from_raw(v00);
        out(1, 1) = S::from_raw(v11);
        out(0, 1) = out(1, 0) = S::from_raw(v01);
        return out;
    }

  private:
    static constexpr int kMostZeros = 28;  ///< of the determinant, which is at least 2^52 without correlation

    /// On the diagonal: r - r i r. The share r i is kept without a sign, as rounding may make it 1.
    static std::int32_t posterior(std::int32_t variance, std::int32_t inverse, int zeros) {
        const int up = zeros + 1;  // to 31 fraction bits
        const auto share = static_cast<std::uint32_t>(dsp::detail::high_product(variance, inverse) << up);
        const auto unsigned_variance = static_cast<std::uint32_t>(variance);
        return static_cast<std::int32_t>(unsigned_variance -
                                         2 * dsp::detail::high_product(unsigned_variance, share));
    }
    static std::int32_t part_of(S share, std::int32_t move) {
        return static_cast<std::int32_t>(dsp::product(share.raw(), move) >> F);
    }
    /// v / 2^bits, 0 < bits < 64, to nearest, saturated.
    static std::int32_t unscaled(std::int64_t v, int bits) {
        if (bits > 32) return ((static_cast<std::int32_t>(v >> 32) >> (bits - 33)) + 1) >> 1;
        v += 1U << (bits - 1);
        const auto high = static_cast<std::int32_t>(v >> 32);
        if (bits == 32) return high;
        if (high >> (bits - 1) != high >> 31) [[unlikely]]
            return high < 0 ? S::min().raw() : S::max().raw();
        return Inverse::shifted(v, bits);
    }

    void set_scale(int k0, int k1) {
        k0_ = k0;
        k1_ = k1;
        most0_ = S::from_raw(S::max().raw() >> 2 * k0);
        most1_ = S::from_raw(S::max().raw() >> 2 * k1);
        scaled0_ = p0_.raw() << 2 * k0;
        scaled1_ = p1_.raw() << 2 * k1;
        scaled_cross_ = cross_.raw() << (k0 + k1);
        cross_squared_ = dsp::product(scaled_cross_, scaled_cross_);
    }
    /// Everything in the coarser scale that these sums need.
    [[gnu::always_inline]] void make_room(S sum0, S sum1) {
        const int less0 = k0_ - std::min(k0_, detail::scale_of(sum0));
        const int less1 = k1_ - std::min(k1_, detail::scale_of(sum1));
        set_scale(k0_ - less0, k1_ - less1);
        first0_ >>= less0;
        first1_ >>= less1;
        off0_ >>= less0;
        off1_ >>= less1;
        second00_ >>= 2 * less0;
        second01_ >>= less0 + less1;
        second11_ >>= 2 * less1;
    }

    S p0_, p1_, cross_;
    int k0_, k1_;
    S most0_, most1_;  // that P + R can be in this scale
    std::int32_t scaled0_, scaled1_, scaled_cross_;
    std::int64_t cross_squared_;
    S unused_ = S(0);
    // Moves are in units of which 2^F make the unit of P': a product of two is like one of P' and a beta.
    std::int32_t first0_ = 0, first1_ = 0;
    std::int32_t off0_ = 0, off1_ = 0;
    std::int64_t second00_ = 0, second01_ = 0, second11_ = 0;
};

/// Moves (x, P) by the weighted corrections of a row.
///
/// With one R for all it is the PDA update x + K sum w nu, beta_0 P + (1 - beta_0) P_c + spread. The mean
/// moves by the weights; the covariance is that of the mixture of the betas about that mean, so it also
/// covers what a decision logic chose to ignore.
template <class S>
void update_with_row(Vec2<S>& x, Mat2<S>& p, const AssociationRow<S>& row,
                     std::span<const Measurement<S>> measurements, const Gate<S>& gate) {
    if (row.count == 0) return;
    const S negligible = constant<S>(1, 1 << 14);
    Mixture<S> mixture(p, gate.usual_noise(row.obscured));
    for (const Candidate<S>& c : row.candidates()) {
        if (c.beta < negligible && c.weight < negligible) continue;
        const Measurement<S>& m = measurements[c.measurement];
        mixture.add(gate.innovation(x, m.z), gate.noise(m, row.obscured), c.weight, c.beta);
    }
    x += mixture.mean();
    p = mixture.covariance(row.missed);
}

}  // namespace tracking
