/// Interacting multiple models: one target, several linear motions it may be in, Markov between them.
///
/// Source: Blom and Bar-Shalom 1988; the four steps of Kim, Park, Kim and Ji, who print the likelihood of one
/// measurement (pages 2 and 3 agree with Blom's but for the index of mu_{ij}, whose condition is on j).
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "tracking/kalman.hpp"
#include "tracking/scalar.hpp"
#include "tracking/weight.hpp"

namespace tracking {

template <class S, int N>
using VecN = Eigen::Matrix<S, N, 1>;
template <class S, int N>
using MatN = Eigen::Matrix<S, N, N>;

/// x <- F x + input, P <- F P F' + Q, in one frame.
template <class S, int N>
struct LinearMode {
    MatN<S, N> transition = MatN<S, N>::Identity();
    VecN<S, N> input = VecN<S, N>::Zero();
    MatN<S, N> noise = MatN<S, N>::Zero();  ///< symmetric, not negative
};

template <class S, int N, std::size_t M>
struct ImmModel {
    std::array<LinearMode<S, N>, M> mode;
    std::array<std::array<S, M>, M> change{};  ///< [from][to], rows sum to 1

    /// Every mode can be reached and rows sum to 1 within 2^-16.
    [[nodiscard]] constexpr bool valid() const {
        for (const auto& row : change) {
            S rest = S(1);
            for (const S p : row) {
                if (!(p > S(0)) || p > S(1)) return false;
                rest -= p;
            }
            if (absolute(rest) > constant<S>(1, 65536)) return false;
        }
        return true;
    }
};

/// A Gaussian for each mode and its probability. The measured components come first in x.
template <class S, int N, std::size_t M>
struct ImmState {
    std::array<VecN<S, N>, M> x;
    std::array<MatN<S, N>, M> covariance;
    std::array<S, M> probability{};

    /// All modes at (x, P), equally likely.
    void start(const VecN<S, N>& at, const MatN<S, N>& p) {
        x.fill(at);
        covariance.fill(p);
        probability.fill(constant<S>(1, static_cast<std::int64_t>(M)));
    }
};

template <class S, int N>
struct Estimate {
    VecN<S, N> x;
    MatN<S, N> covariance;
};

/// Least probability a mode is left with: none is ever zero, and one that was wrong for long can come back
/// within a few frames.
template <class S>
constexpr S least_mode_probability() {
    return constant<S>(1, std::int64_t{1} << 20);
}

namespace detail {

/// m += w v v', symmetric by construction.
template <class S, int N>
void add_outer_n(MatN<S, N>& m, S w, const VecN<S, N>& v) {
    for (int i = 0; i < N; ++i) {
        const S wv = w * v[i];
        for (int j = i; j < N; ++j) {
            m(i, j) += wv * v[j];
            m(j, i) = m(i, j);
        }
    }
}

template <class S, int N>
void mirror(MatN<S, N>& m) {
    for (int i = 1; i < N; ++i)
        for (int j = 0; j < i; ++j) m(i, j) = m(j, i);
}

/// Mean and covariance of a Gaussian mixture. Weights sum to 1.
template <class S, int N, std::size_t M>
Estimate<S, N> match_moments(const std::array<VecN<S, N>, M>& x, const std::array<MatN<S, N>, M>& p,
                             const std::array<S, M>& weight) {
    // About the first mean: a rounding error of the weights then scales a difference, not a range of 160 m.
    VecN<S, N> shift = VecN<S, N>::Zero();
    for (std::size_t i = 1; i < M; ++i)
        for (int k = 0; k < N; ++k) shift[k] += weight[i] * (x[i][k] - x[0][k]);
    Estimate<S, N> out{x[0] + shift, MatN<S, N>::Zero()};
    for (std::size_t i = 0; i < M; ++i) {
        out.covariance += p[i] * weight[i];
        add_outer_n<S, N>(out.covariance, weight[i], x[i] - out.x);
    }
    return out;
}

/// weight / sum, none below least_mode_probability().
template <class S, std::size_t M>
void normalise_modes(const std::array<Weight<S>, M>& weight, std::array<S, M>& probability) {
    Weight<S> sum{};
    for (const Weight<S>& w : weight) sum += w;
    const S least = least_mode_probability<S>();
    S rest = S(1);
    std::size_t largest = 0;
    for (std::size_t j = 0; j < M; ++j) {
        probability[j] =
            Weight<S>{} < sum ? share_of<S>(weight[j], sum) : constant<S>(1, static_cast<std::int64_t>(M));
        if (!(probability[j] > least)) probability[j] = least;
        if (probability[j] > probability[largest]) largest = j;
        rest -= probability[j];
    }
    probability[largest] += rest;  // exactly 1 in all
}

}  // namespace detail

/// Steps 1 and 2a: mixes the estimates by where each mode may have come from, predicts each mode and its
/// probability.
template <class S, int N, std::size_t M>
void predict(ImmState<S, N, M>& state, const ImmModel<S, N, M>& model) {
    const ImmState<S, N, M> before = state;
    for (std::size_t j = 0; j < M; ++j) {
        std::array<Weight<S>, M> came_from;
        Weight<S> sum{};
        for (std::size_t i = 0; i < M; ++i) {
            came_from[i] = weight_of(model.change[i][j]) * weight_of(before.probability[i]);
            sum += came_from[i];
        }
        state.probability[j] = share_of<S>(sum, weight_of(S(1)));
        std::array<S, M> share;
        for (std::size_t i = 0; i < M; ++i) share[i] = share_of<S>(came_from[i], sum);
        const Estimate<S, N> mixed = detail::match_moments(before.x, before.covariance, share);
        const LinearMode<S, N>& mode = model.mode[j];
        state.x[j] = mode.transition * mixed.x + mode.input;
        const MatN<S, N> half = mode.transition * mixed.covariance;
        state.covariance[j] = half * mode.transition.transpose() + mode.noise;
        detail::mirror<S, N>(state.covariance[j]);
    }
}

/// Step 3: mu_j <- c_j L_j / sum, from the logarithms of the likelihoods, relative to the largest so that no
/// outlier makes all of them zero.
template <class S, int N, std::size_t M>
void update_modes(ImmState<S, N, M>& state, const std::array<S, M>& log_likelihood) {
    S top = log_likelihood[0];
    for (const S l : log_likelihood)
        if (l > top) top = l;
    std::array<Weight<S>, M> weight;
    for (std::size_t j = 0; j < M; ++j)
        weight[j] = weight_of(state.probability[j]) * weight_exp(S(log_likelihood[j] - top));
    detail::normalise_modes<S, M>(weight, state.probability);
}

/// Step 4: the estimate of all modes together.
template <class S, int N, std::size_t M>
Estimate<S, N> combined(const ImmState<S, N, M>& state) {
    return detail::match_moments(state.x, state.covariance, state.probability);
}

/// The 2 x 2 covariance of the measured components.
template <class S, int N>
Mat2<S> measured_covariance(const MatN<S, N>& p) {
    return p.template topLeftCorner<2, 2>();
}

/// x += K nu, P <- (I - KH) P (I - KH)' + K R K' for a measurement of the first two components with variances
/// r. Joseph's form: rounding in K cannot make it indefinite.
template <class S, int N>
struct KalmanGain {
    Eigen::Matrix<S, N, 2> k;

    KalmanGain(const MatN<S, N>& p, const Ldl<S>& innovation) {
        for (int i = 0; i < N; ++i) {
            const Vec2<S> row = innovation.solve({p(i, 0), p(i, 1)});
            k(i, 0) = row[0];
            k(i, 1) = row[1];
        }
    }
    [[nodiscard]] VecN<S, N> correction(const Vec2<S>& nu) const {
        VecN<S, N> out;
        for (int i = 0; i < N; ++i) out[i] = k(i, 0) * nu[0] + k(i, 1) * nu[1];
        return out;
    }
    [[nodiscard]] MatN<S, N> posterior(const MatN<S, N>& p, const Vec2<S>& r) const {
        MatN<S, N> keep = MatN<S, N>::Identity();
        for (int i = 0; i < N; ++i) {
            keep(i, 0) -= k(i, 0);
            keep(i, 1) -= k(i, 1);
        }
        const MatN<S, N> half = keep * p;
        MatN<S, N> out = half * keep.transpose();
        for (int i = 0; i < N; ++i)
            for (int j = i; j < N; ++j) out(i, j) += k(i, 0) * r[0] * k(j, 0) + k(i, 1) * r[1] * k(j, 1);
        detail::mirror<S, N>(out);
        return out;
    }
};

/// Steps 2b and 3 with one measurement z of the first two components, variances r > 0, known to be the
/// target's.
template <class S, int N, std::size_t M>
void update(ImmState<S, N, M>& state, const Vec2<S>& z, const Vec2<S>& r) {
    std::array<S, M> log_likelihood;
    for (std::size_t j = 0; j < M; ++j) {
        const Vec2<S> nu(z[0] - state.x[j][0], z[1] - state.x[j][1]);
        const Ldl<S> innovation(innovation_covariance(measured_covariance<S, N>(state.covariance[j]), r));
        log_likelihood[j] = innovation.log_density(innovation.distance2(nu));
        const KalmanGain<S, N> gain(state.covariance[j], innovation);
        state.x[j] += gain.correction(nu);
        state.covariance[j] = gain.posterior(state.covariance[j], r);
    }
    update_modes(state, log_likelihood);
}

/// Motion in a plane or along a line with white acceleration constant over a period: states [position,
/// velocity] of D axes, positions first. sigma is the acceleration's.
template <class S, int D>
LinearMode<S, 2 * D> constant_velocity(S period_s, S sigma_mps2) {
    LinearMode<S, 2 * D> mode;
    const S rate_step = sigma_mps2 * period_s;
    const S step = rate_step * period_s * constant<S>(1, 2);
    for (int a = 0; a < D; ++a) {
        mode.transition(a, a + D) = period_s;
        mode.noise(a, a) = step * step;
        mode.noise(a, a + D) = mode.noise(a + D, a) = step * rate_step;
        mode.noise(a + D, a + D) = rate_step * rate_step;
    }
    return mode;
}

}  // namespace tracking
