/// Kalman filter on x = [range m, range rate m/s] with the whole state measured: H = I, independent errors.
///
/// F = [1 T; 0 1]. Process noise is a white acceleration constant over a period (Bar-Shalom, Li and
/// Kirubarajan 2001, 6.3.2): Q = sigma^2 [T^4/4 T^3/2; T^3/2 T^2].
#pragma once

#include "tracking/scalar.hpp"

namespace tracking {

template <class S>
struct MotionModel {
    S period_s = constant<S>(1, 10);
    /// Between half and the whole of the hardest braking, by the usual rule: 8 m/s^2 then stays inside a
    /// 4-sigma gate even when two detections are missed meanwhile. Larger lets neighbours into the gate
    /// sooner.
    S acceleration_sigma_mps2 = S(5);

    [[nodiscard]] constexpr bool valid() const {
        return period_s >= constant<S>(1, 100) && period_s <= S(1) &&
               acceleration_sigma_mps2 >= constant<S>(1, 10) && acceleration_sigma_mps2 <= S(20);
    }
};

/// x <- F x.
template <class S>
Vec2<S> predict_state(const Vec2<S>& x, const MotionModel<S>& model) {
    return {x[0] + x[1] * model.period_s, x[1]};
}

/// P <- F P F' + Q, symmetric by construction.
template <class S>
Mat2<S> predict_covariance(const Mat2<S>& p, const MotionModel<S>& model) {
    const S t = model.period_s;
    const S rate_step = model.acceleration_sigma_mps2 * t;  // sigma of the rate's change over a period
    const S range_step = rate_step * t * constant<S>(1, 2);
    const S cross = p(0, 1) + t * p(1, 1);
    Mat2<S> out;
    out(0, 0) = p(0, 0) + t * (p(0, 1) + cross) + range_step * range_step;
    out(0, 1) = out(1, 0) = cross + range_step * rate_step;
    out(1, 1) = p(1, 1) + rate_step * rate_step;
    return out;
}

/// A symmetric positive 2 x 2 matrix as L D L', L = [1 0; l 1], D = diag(d1, d2). No determinant is formed:
/// in fixed point the product of two small variances would lose all its digits, d1 and d2 keep theirs.
template <class S>
class Ldl {
  public:
    explicit Ldl(const Mat2<S>& m)
        : d1_(m(0, 0)),
          d1_inverse_(reciprocal(d1_)),
          l_(d1_ > S(0) ? S(m(0, 1) * d1_inverse_) : S(0)),
          d2_(m(1, 1) - l_ * m(0, 1)),
          d2_inverse_(reciprocal(d2_)) {}

    /// Positive definite. If not, nothing else may be asked.
    [[nodiscard]] bool valid() const { return d1_ > S(0) && d2_ > S(0); }

    /// v' M^-1 v >= 0; saturates where the format ends.
    [[nodiscard]] S distance2(const Vec2<S>& v) const {
        const S rest = v[1] - l_ * v[0];
        // (v / d) v, not v v / d: the square of a large v would saturate before the division.
        return v[0] * d1_inverse_ * v[0] + rest * d2_inverse_ * rest;
    }
    /// ln N(v; 0, M), given distance2(v).
    [[nodiscard]] S log_density(S distance2) const {
        constexpr auto kLn2Pi = constant<S>(1'837'877'066'409, 1'000'000'000'000);
        return -kLn2Pi - (distance2 + ln(d1_) + ln(d2_)) * constant<S>(1, 2);
    }
    /// M^-1 v.
    [[nodiscard]] Vec2<S> solve(const Vec2<S>& v) const {
        const S second = (v[1] - l_ * v[0]) * d2_inverse_;
        return {v[0] * d1_inverse_ - l_ * second, second};
    }

  private:
    S d1_;
    decltype(reciprocal(S{})) d1_inverse_;
    S l_;
    S d2_;
    decltype(reciprocal(S{})) d2_inverse_;
};

/// S = P + R.
template <class S>
Mat2<S> innovation_covariance(const Mat2<S>& p, const Vec2<S>& r) {
    Mat2<S> s = p;
    s(0, 0) += r[0];
    s(1, 1) += r[1];
    return s;
}

/// K = P S^-1. Both are symmetric: row i of K is S^-1 times row i of P.
template <class S>
Mat2<S> gain(const Mat2<S>& p, const Ldl<S>& s) {
    const Vec2<S> first = s.solve({p(0, 0), p(0, 1)});
    const Vec2<S> second = s.solve({p(0, 1), p(1, 1)});
    Mat2<S> k;
    k(0, 0) = first[0];
    k(0, 1) = first[1];
    k(1, 0) = second[0];
    k(1, 1) = second[1];
    return k;
}

/// K nu.
template <class S>
Vec2<S> correction(const Mat2<S>& k, const Vec2<S>& nu) {
    return {k(0, 0) * nu[0] + k(0, 1) * nu[1], k(1, 0) * nu[0] + k(1, 1) * nu[1]};
}

/// (I - K) P (I - K)' + K R K', Joseph's form: a sum of squares, so rounding in K cannot make it indefinite.
template <class S>
Mat2<S> posterior_covariance(const Mat2<S>& p, const Mat2<S>& k, const Vec2<S>& r) {
    const S a00 = S(1) - k(0, 0);
    const S a01 = -k(0, 1);
    const S a10 = -k(1, 0);
    const S a11 = S(1) - k(1, 1);
    const S b00 = a00 * p(0, 0) + a01 * p(0, 1);
    const S b01 = a00 * p(0, 1) + a01 * p(1, 1);
    const S b10 = a10 * p(0, 0) + a11 * p(0, 1);
    const S b11 = a10 * p(0, 1) + a11 * p(1, 1);
    const S kr00 = k(0, 0) * r[0];
    const S kr01 = k(0, 1) * r[1];
    Mat2<S> out;
    out(0, 0) = b00 * a00 + b01 * a01 + kr00 * k(0, 0) + kr01 * k(0, 1);
    out(0, 1) = out(1, 0) = b00 * a10 + b01 * a11 + kr00 * k(1, 0) + kr01 * k(1, 1);
    out(1, 1) = b10 * a10 + b11 * a11 + k(1, 0) * r[0] * k(1, 0) + k(1, 1) * r[1] * k(1, 1);
    return out;
}

/// m += w v v'.
template <class S>
void add_outer(Mat2<S>& m, S w, const Vec2<S>& v) {
    const Vec2<S> wv(w * v[0], w * v[1]);
    m(0, 0) += wv[0] * v[0];
    m(0, 1) += wv[0] * v[1];
    m(1, 0) = m(0, 1);
    m(1, 1) += wv[1] * v[1];
}

}  // namespace tracking
