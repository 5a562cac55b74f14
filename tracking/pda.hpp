/// Probabilistic data association, each track for itself (Bar-Shalom and Tse 1975), and the update of a
/// filter with several weighted measurements.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/association.hpp"
#include "tracking/gating.hpp"
#include "tracking/kalman.hpp"
#include "tracking/scalar.hpp"
#include "tracking/scratch.hpp"

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

/// The Gaussian mixture of a prediction (0, P) that missed and of what the Kalman filter makes of it with each
/// of several measurements, matched in mean and covariance: every measurement has its own gain because it has
/// its own R. The mean is that of the weights; the covariance is that of the mixture of the betas about it.
template <class S>
class Mixture {
  public:
    /// `largest_noise`: no r of a measurement is larger in either coordinate.
    Mixture(const Mat2<S>& p, const Vec2<S>& /*largest_noise*/) : p_(p) {}

    /// nu as for Innovation.
    void add(const Vec2<S>& nu, const Vec2<S>& r, S weight, S beta) {
        const Innovation<S> innovation(p_, r);
        const Vec2<S> move = innovation.move(nu);
        mean_ += weight * move;
        first_ += beta * move;
        second_ += beta * (innovation.posterior() + move * move.transpose());
    }
    [[nodiscard]] Vec2<S> mean() const { return mean_; }
    /// `missed`: beta of the prediction. It and the betas added sum up to 1 at most.
    [[nodiscard]] Mat2<S> covariance(S missed) const {
        const Vec2<S> off = first_ - mean_;
        return missed * p_ + second_ - first_ * first_.transpose() + off * off.transpose();
    }

  private:
    Mat2<S> p_;
    Vec2<S> mean_ = Vec2<S>::Zero();
    Vec2<S> first_ = Vec2<S>::Zero();   // moment of the betas
    Mat2<S> second_ = Mat2<S>::Zero();  // of the betas, and their posteriors
};

/// In fixed point in the scale of Innovation, but one for all measurements, the one that P and the largest
/// noise leave room for. Nothing is rounded to the format before the end: mean and covariance are within 4
/// LSB and a relative 2^-18 / (1 - correlation^2) of R and of the square of the farthest move, as long as no
/// other noise is 100 times smaller than the largest.
template <int F>
class Mixture<dsp::Fixed<F>> {
    using S = dsp::Fixed<F>;

  public:
    Mixture(const Mat2<S>& p, const Vec2<S>& largest_noise)
        : k0_(room(p(0, 0) + largest_noise[0])),
          k1_(room(p(1, 1) + largest_noise[1])),
          p0_(p(0, 0).raw() << 2 * k0_),
          p1_(p(1, 1).raw() << 2 * k1_),
          cross_(p(0, 1).raw() << (k0_ + k1_)),
          cross2_(dsp::product(cross_, cross_)) {}

    void add(const Vec2<S>& nu, const Vec2<S>& r, S weight, S beta) {
        const std::int32_t s0 = dsp::saturated_sum(p0_, r[0].raw() << 2 * k0_);
        const std::int32_t s1 = dsp::saturated_sum(p1_, r[1].raw() << 2 * k1_);
        const std::int32_t r0 = s0 - p0_;
        const std::int32_t r1 = s1 - p1_;
        const std::int64_t determinant = dsp::product(s0, s1) - cross2_;
        const auto high = static_cast<std::int32_t>(determinant >> 32);
        if (high < 1 << (31 - kMostZeros)) {  // says nothing that P does not
            unused_ += beta;
            return;
        }
        const int zeros = std::countl_zero(static_cast<std::uint32_t>(high));
        // S'^-1 = 2^(zeros - 62) inverse
        const auto inverse = static_cast<std::int32_t>(
            dsp::detail::inverse(static_cast<std::uint32_t>(shifted(determinant, 32 - zeros))));
        const std::int32_t inverse00 = dsp::detail::high_product(s1, inverse);
        const std::int32_t inverse01 = -dsp::detail::high_product(cross_, inverse);
        const std::int32_t inverse11 = dsp::detail::high_product(s0, inverse);

        // The move is nu - R S^-1 nu.
        const std::int32_t n0 = nu[0].raw() << k0_;
        const std::int32_t n1 = nu[1].raw() << k1_;
        const std::int32_t v0 = upper(dot(inverse00, n0, inverse01, n1));
        const std::int32_t v1 = upper(dot(inverse01, n0, inverse11, n1));
        const std::int32_t move0 = n0 - shifted(dsp::product(r0, v0), 30 - zeros);
        const std::int32_t move1 = n1 - shifted(dsp::product(r1, v1), 30 - zeros);
        mean0_ = dsp::accumulated(mean0_, weight.raw(), move0);
        mean1_ = dsp::accumulated(mean1_, weight.raw(), move1);
        const auto part0 = static_cast<std::int32_t>(dsp::product(beta.raw(), move0) >> F);
        const auto part1 = static_cast<std::int32_t>(dsp::product(beta.raw(), move1) >> F);
        first0_ += part0;
        first1_ += part1;

        // The posterior is R - R S^-1 R.
        const std::int32_t kept00 = dsp::detail::high_product(r0, inverse00) << (zeros + 1);
        const std::int32_t kept11 = dsp::detail::high_product(r1, inverse11) << (zeros + 1);
        const std::int32_t kept01 = dsp::detail::high_product(r0, inverse01);
        const std::int32_t posterior00 = r0 - 2 * dsp::detail::high_product(r0, kept00);
        const std::int32_t posterior11 = r1 - 2 * dsp::detail::high_product(r1, kept11);
        const std::int32_t minus01 = dsp::detail::high_product(kept01, r1) << (zeros + 2);
        second00_ = dsp::accumulated(dsp::accumulated(second00_, beta.raw(), posterior00), part0, move0);
        second01_ = dsp::accumulated(dsp::accumulated(second01_, beta.raw(), -minus01), part0, move1);
        second11_ = dsp::accumulated(dsp::accumulated(second11_, beta.raw(), posterior11), part1, move1);
    }

    [[nodiscard]] Vec2<S> mean() const {
        const auto unscaled = [](std::int64_t sum, int k) {
            return S::from_raw((dsp::rounded<F>(sum) + (1 << k >> 1)) >> k);
        };
        return {unscaled(mean0_, k0_), unscaled(mean1_, k1_)};
    }
    [[nodiscard]] Mat2<S> covariance(S missed) const {
        const std::int32_t off0 = first0_ - static_cast<std::int32_t>(mean0_ >> F);
        const std::int32_t off1 = first1_ - static_cast<std::int32_t>(mean1_ >> F);
        const std::int32_t prior = (missed + unused_).raw();
        const auto about_mean = [&](std::int64_t second, std::int32_t p, std::int32_t a, std::int32_t b,
                                    std::int32_t off_a, std::int32_t off_b) {
            return dsp::accumulated(dsp::accumulated(second - dsp::product(a, b), prior, p), off_a, off_b);
        };
        const auto positive = [](std::int32_t v) { return S::from_raw(v > 0 ? v : 1); };
        Mat2<S> out;
        out(0, 0) = positive(
            nearest(about_mean(second00_, p0_, first0_, first0_, off0, off0), F + 2 * k0_));
        out(1, 1) = positive(
            nearest(about_mean(second11_, p1_, first1_, first1_, off1, off1), F + 2 * k1_));
        out(0, 1) = out(1, 0) = S::from_raw(
            nearest(about_mean(second01_, cross_, first0_, first1_, off0, off1), F + k0_ + k1_));
        return out;
    }

  private:
    static constexpr int kMostZeros = 28;  ///< of a determinant

    /// By how many bits a coordinate can be scaled up.
    static int room(S variance) {
        return (std::countl_zero(static_cast<std::uint32_t>(variance.raw()) | 1U) - 1) >> 1;
    }
    static std::int32_t upper(std::int64_t v) { return static_cast<std::int32_t>(v >> 32); }
    /// v / 2^bits, bits > 0, to nearest, saturated.
    static std::int32_t nearest(std::int64_t v, int bits) {
        if (bits > 32) return ((upper(v) >> (bits - 33)) + 1) >> 1;
        return dsp::saturate32(((v >> (bits - 1)) + 1) >> 1);
    }
    static std::int64_t dot(std::int32_t a0, std::int32_t b0, std::int32_t a1, std::int32_t b1) {
        return dsp::accumulated(dsp::product(a0, b0), a1, b1);
    }
    /// v / 2^bits rounded down, 1 <= bits <= 31, where that has 32 bits.
    static std::int32_t shifted(std::int64_t v, int bits) {
        const auto wide = static_cast<std::uint64_t>(v);
        return static_cast<std::int32_t>(static_cast<std::uint32_t>(wide) >> bits |
                                         static_cast<std::uint32_t>(wide >> 32) << (32 - bits));
    }

    int k0_, k1_;
    std::int32_t p0_, p1_, cross_;  // P'
    std::int64_t cross2_;
    S unused_ = S(0);
    // Of weights or betas with F fraction bits:
    std::int64_t mean0_ = 0, mean1_ = 0;
    // Moves are in units of which 2^F make the unit of P': their products come out with F fraction bits, too.
    std::int32_t first0_ = 0, first1_ = 0;
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
    const S negligible = constant<S>(1, 1 << 14);
    struct Used {
        S range, rate;  // of the innovation
        S range_noise, rate_noise;
        S weight, beta;
    };
    Scratch<Used, kMaxGated> used;
    std::size_t count = 0;
    Vec2<S> largest(S(0), S(0));
    for (const Candidate<S>& c : row.candidates()) {
        if (c.beta < negligible && c.weight < negligible) continue;
        const Measurement<S>& m = measurements[c.measurement];
        const Vec2<S> nu = gate.innovation(x, m.z);
        const Vec2<S> r = gate.noise(m, row.obscured);
        if (r[0] > largest[0]) largest[0] = r[0];
        if (r[1] > largest[1]) largest[1] = r[1];
        used[count++] = {nu[0], nu[1], r[0], r[1], c.weight, c.beta};
    }
    if (count == 0) return;
    Mixture<S> mixture(p, largest);
    for (std::size_t i = 0; i < count; ++i) {
        const Used& u = used[i];
        mixture.add({u.range, u.rate}, {u.range_noise, u.rate_noise}, u.weight, u.beta);
    }
    x += mixture.mean();
    p = mixture.covariance(row.missed);
}

}  // namespace tracking
