/// Kalman filter on x = [range m, range rate m/s] with the whole state measured: H = I, independent errors.
///
/// F = [1 T; 0 1]. Process noise is a white acceleration constant over a period (Bar-Shalom, Li and
/// Kirubarajan 2001, 6.3.2): Q = sigma^2 [T^4/4 T^3/2; T^3/2 T^2].
#pragma once

#include <bit>
#include <cstdint>

#include "dsp/fixed_math.hpp"
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
    return {x[0] + weighted(model.period_s, x[1]), x[1]};
}

/// Q, symmetric.
template <class S>
struct ProcessNoise {
    S range, cross, rate;
};
template <class S>
ProcessNoise<S> process_noise(const MotionModel<S>& model) {
    const S rate_step = model.acceleration_sigma_mps2 * model.period_s;  // sigma of the rate's change
    const S range_step = rate_step * model.period_s * constant<S>(1, 2);
    return {range_step * range_step, range_step * rate_step, rate_step * rate_step};
}

/// P <- F P F' + Q, symmetric by construction. `noise` is the model's, the same for all tracks.
template <class S>
Mat2<S> predict_covariance(const Mat2<S>& p, const MotionModel<S>& model, const ProcessNoise<S>& noise) {
    const S t = model.period_s;
    const S cross = p(0, 1) + weighted(t, p(1, 1));
    Mat2<S> out;
    out(0, 0) = p(0, 0) + weighted(t, S(p(0, 1) + cross)) + noise.range;
    out(0, 1) = out(1, 0) = cross + noise.cross;
    out(1, 1) = p(1, 1) + noise.rate;
    return out;
}
template <class S>
Mat2<S> predict_covariance(const Mat2<S>& p, const MotionModel<S>& model) {
    return predict_covariance(p, model, process_noise(model));
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

/// One measurement with independent errors of variances r against a prediction of covariance P: its
/// innovation covariance S = P + R and what the Kalman filter makes of it. Both P and R positive; if valid()
/// is false, nothing else may be asked.
template <class S>
class Innovation {
  public:
    Innovation(const Mat2<S>& p, const Vec2<S>& r)
        : p_(p),
          r_(r),
          s0_(p(0, 0) + r[0]),
          s1_(p(1, 1) + r[1]),
          determinant_(s0_ * s1_ - p(0, 1) * p(0, 1)) {}

    [[nodiscard]] bool valid() const { return s0_ > 0 && s1_ > 0 && determinant_ > 0; }
    /// nu' S^-1 nu of an innovation within 10 standard deviations in each coordinate.
    [[nodiscard]] S distance2(const Vec2<S>& nu) const { return nu.dot(solve(nu)); }
    /// ln N(nu; 0, S), given distance2(nu).
    [[nodiscard]] S log_density(S distance2) const {
        constexpr auto kLn2Pi = constant<S>(1'837'877'066'409, 1'000'000'000'000);
        return -kLn2Pi - (distance2 + ln(determinant_)) / 2;
    }
    /// K nu = P S^-1 nu: by how much the measurement moves the prediction; nu as for distance2.
    [[nodiscard]] Vec2<S> move(const Vec2<S>& nu) const { return p_ * solve(nu); }
    /// The covariance of the estimate, R - R S^-1 R = P - P S^-1 P.
    [[nodiscard]] Mat2<S> posterior() const {
        Mat2<S> out;
        out(0, 0) = r_[0] * (1 - r_[0] * s1_ / determinant_);
        out(0, 1) = out(1, 0) = r_[0] * r_[1] * p_(0, 1) / determinant_;
        out(1, 1) = r_[1] * (1 - r_[1] * s0_ / determinant_);
        return out;
    }

  private:
    [[nodiscard]] Vec2<S> solve(const Vec2<S>& v) const {
        return {(s1_ * v[0] - p_(0, 1) * v[1]) / determinant_, (s0_ * v[1] - p_(0, 1) * v[0]) / determinant_};
    }

    Mat2<S> p_;
    Vec2<S> r_;
    S s0_, s1_, determinant_;
};

namespace detail {

/// The inverse of a scaled innovation covariance S', whose entries fit 31 bits: S'^-1 = 2^(zeros - 62) times
/// the numbers here. The determinant is exact in 64 bits, and one division serves all.
struct ScaledInverse {
    /// `most_zeros`: leading zeros of the determinant, at most 28; with more there is no inverse.
    ScaledInverse(std::int32_t s00, std::int32_t s01, std::int32_t s11, std::int64_t s01_squared,
                  int most_zeros) {
        const std::int64_t determinant = dsp::product(s00, s11) - s01_squared;
        const auto high = static_cast<std::int32_t>(determinant >> 32);
        if (high < 1 << (31 - most_zeros)) return;
        zeros = std::countl_zero(static_cast<std::uint32_t>(high));
        mantissa = static_cast<std::uint32_t>(shifted(determinant, 32 - zeros));
        const auto inverse = static_cast<std::int32_t>(dsp::detail::inverse(mantissa));
        i00 = dsp::detail::high_product(s11, inverse);
        i01 = -dsp::detail::high_product(s01, inverse);
        i11 = dsp::detail::high_product(s00, inverse);
        valid = true;
    }

    struct Solved {
        std::int32_t v0, v1;
    };
    /// S'^-1 n, 2^(zeros - 30) times, for n within 5 standard deviations of S' in each coordinate, with
    /// 11 fraction bits. They fit for twice as much.
    [[nodiscard]] Solved solve(std::int32_t n0, std::int32_t n1) const {
        return {static_cast<std::int32_t>(dot(i00, n0, i01, n1) >> 32),
                static_cast<std::int32_t>(dot(i01, n0, i11, n1) >> 32)};
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

    std::int32_t i00 = 0, i01 = 0, i11 = 0;
    int zeros = 0;
    std::uint32_t mantissa = 0;  ///< of the determinant, 2^(32 - zeros) mantissa
    bool valid = false;
};

/// By how many bits the coordinate of a variance can be scaled up so that the variance has room in 31 bits;
/// anything in 0..15 for a negative one.
template <int F>
int scale_of(dsp::Fixed<F> variance) {
    const int zeros = std::countl_zero(static_cast<std::uint32_t>(variance.raw())) - 1;
    return static_cast<int>(static_cast<std::uint32_t>(zeros) >> 1 & 15U);
}

}  // namespace detail

/// In fixed point each coordinate is scaled by a power of two, x'_i = 2^k_i x_i, so that the variances S'_ii
/// have no more than two leading zeros besides the sign; all that follows has known places. Correlations up
/// to 1 - 2^-19 are valid. Errors: distance2 within 2^-18 (1 + distance2) / (1 - correlation^2); the
/// posterior, of a measurement with variances up to 10, within 2 LSB.
template <int F>
class Innovation<dsp::Fixed<F>> {
    using S = dsp::Fixed<F>;

  public:
    Innovation(const Mat2<S>& p, const Vec2<S>& r)
        : p0_(p(0, 0).raw()),
          p1_(p(1, 1).raw()),
          cross_(p(0, 1).raw()),
          s0_(p(0, 0) + r[0]),
          s1_(p(1, 1) + r[1]),
          k0_(detail::scale_of(s0_)),
          k1_(detail::scale_of(s1_)),
          scaled_cross_(cross_ << (k0_ + k1_)),
          inverse_(s0_.raw() << 2 * k0_, scaled_cross_, s1_.raw() << 2 * k1_,
                   dsp::product(scaled_cross_, scaled_cross_), kMostZeros) {}

    [[nodiscard]] bool valid() const {
        return inverse_.valid && (s0_.raw() | s1_.raw()) > 0 && scaled_cross_ >> (k0_ + k1_) == cross_;
    }
    [[nodiscard]] S distance2(const Vec2<S>& nu) const {
        const std::int32_t n0 = nu[0].raw() << (k0_ + 1);
        const std::int32_t n1 = nu[1].raw() << (k1_ + 1);
        const auto v = inverse_.solve(n0, n1);
        const std::int64_t sum = inverse_.dot(v.v0, n0, v.v1, n1);
        return static_cast<std::int32_t>(sum >> 32) >> (31 - inverse_.zeros) != 0
                   ? S::max()
                   : S::from_raw(inverse_.shifted(sum, 32 - inverse_.zeros));
    }
    [[nodiscard]] S log_density(S distance2) const {
        constexpr auto kLn2PiSquared = constant<S>(3'675'754'133, 1'000'000'000);
        constexpr auto kLn2 = constant<S>(693'147'180'560, 1'000'000'000'000);
        constexpr std::int32_t kUnscaled = kLn2PiSquared.raw() + (63 - 2 * F) * kLn2.raw();
        const int scale = inverse_.zeros + 2 * (k0_ + k1_);
        const auto log_mantissa = S::from_raw(dsp::detail::ln_of_mantissa(inverse_.mantissa) >> (30 - F));
        const S sum = distance2 + S::from_raw(kUnscaled - scale * kLn2.raw()) + log_mantissa;
        return S::from_raw(-(sum.raw() >> 1));
    }
    [[nodiscard]] Vec2<S> move(const Vec2<S>& nu) const {
        const auto v = inverse_.solve(nu[0].raw() << (k0_ + 1), nu[1].raw() << (k1_ + 1));
        const std::int64_t half = std::int64_t{1} << (30 - inverse_.zeros);
        const auto sum = [&](std::int32_t to0, std::int32_t to1) {
            return S::from_raw(inverse_.shifted(half + inverse_.dot(to0 << k0_, v.v0, to1 << k1_, v.v1),
                                                31 - inverse_.zeros));
        };
        return {sum(p0_, cross_), sum(cross_, p1_)};
    }
    [[nodiscard]] Mat2<S> posterior() const {
        // R S^-1 = 1 - K with 30 fraction bits, in the scale of row and column.
        constexpr std::int32_t kOne = 1 << 30;
        const int down = 32 - inverse_.zeros;
        const std::int32_t r0 = s0_.raw() - p0_;  // also where the sum saturates
        const std::int32_t r1 = s1_.raw() - p1_;
        const std::int32_t gain0 = kOne - inverse_.shifted(dsp::product(r0 << 2 * k0_, inverse_.i00), down);
        const std::int32_t gain1 = kOne - inverse_.shifted(dsp::product(r1 << 2 * k1_, inverse_.i11), down);
        const std::int32_t kept01 = inverse_.shifted(dsp::product(r0 << k0_, inverse_.i01), down);
        const auto positive = [](std::int32_t v) { return S::from_raw(v > 0 ? v : 1); };
        Mat2<S> out;
        out(0, 0) = positive(dsp::rounded<30>(dsp::product(r0, gain0)));
        out(1, 1) = positive(dsp::rounded<30>(dsp::product(r1, gain1)));
        out(0, 1) = out(1, 0) = S::from_raw(-dsp::rounded<30>(dsp::product(kept01, r1 << k1_)));
        return out;
    }

  private:
    static constexpr int kMostZeros = 20;  ///< of the determinant, which is at least 2^58 without correlation

    std::int32_t p0_, p1_, cross_;
    S s0_, s1_;
    int k0_, k1_;
    std::int32_t scaled_cross_;
    detail::ScaledInverse inverse_;
};

}  // namespace tracking
