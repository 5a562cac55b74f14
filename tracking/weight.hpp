/// Positive numbers of any size: likelihood ratios and products of them, which a fixed-point S cannot hold.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <utility>
#include <type_traits>

#include "dsp/fixed_math.hpp"
#include "tracking/scalar.hpp"

namespace tracking {

/// mantissa * 2^exponent, mantissa normalised to [2^31, 2^32) or zero. Integers only.
///
/// Sums and products are truncated, relative error at most 2^-31; a quotient is within 2^-27. The exponent
/// has 32 bits and nothing here comes near its ends, so nothing over- or underflows. A quotient by zero is a
/// value past anything else (2^1000).
class ScaledWeight {
  public:
    constexpr ScaledWeight() = default;

    /// mantissa * 2^exponent of any unsigned mantissa.
    static constexpr ScaledWeight normalised(std::uint64_t mantissa, int exponent) {
        ScaledWeight w;
        if (mantissa == 0) return w;
        const int shift = 32 - std::countl_zero(mantissa);  // bits past 32, may be negative
        w.mantissa_ = static_cast<std::uint32_t>(shift >= 0 ? mantissa >> shift : mantissa << -shift);
        w.exponent_ = exponent + shift;
        return w;
    }
    /// A number; a negative one is zero. Exact.
    template <int F>
    static constexpr ScaledWeight of(dsp::Fixed<F> x) {
        return x.raw() <= 0 ? ScaledWeight{} : normalised(static_cast<std::uint32_t>(x.raw()), -F);
    }
    /// e^x within a relative 2^-25 plus the error of x itself.
    template <int F>
    static constexpr ScaledWeight exp(dsp::Fixed<F> x) {
        static_assert(F <= 30);
        constexpr std::int64_t kLog2E = 1'549'082'005;  // 30 fraction bits
        constexpr std::int64_t kLn2 = 2'977'044'472;    // 32 fraction bits
        // x = n ln 2 + r with r in [0, ln 2) but for the rounding of kLog2E.
        const auto n = static_cast<int>(x.raw() * kLog2E >> (F + 30));
        const std::int64_t r = (static_cast<std::int64_t>(x.raw()) << (32 - F)) - n * kLn2;
        const auto mantissa = dsp::exp(dsp::Fixed<29>::from_raw(static_cast<std::int32_t>(r >> 3)));
        return normalised(static_cast<std::uint32_t>(mantissa.raw()), n - 29);
    }
    /// The value as a fixed-point number, rounded half to even, saturated.
    template <int F>
    [[nodiscard]] constexpr dsp::Fixed<F> to() const {
        const int shift = exponent_ + F;  // raw = mantissa * 2^shift
        if (mantissa_ == 0 || shift < -33) return {};
        if (shift >= 0) return dsp::Fixed<F>::max();
        return dsp::Fixed<F>::from_raw(
            dsp::saturate32(dsp::round_shift(static_cast<std::int64_t>(mantissa_), -shift)));
    }

    friend constexpr ScaledWeight operator+(ScaledWeight a, ScaledWeight b) {
        if (a.mantissa_ == 0) return b;
        if (b.mantissa_ == 0) return a;
        if (a.exponent_ < b.exponent_) std::swap(a, b);
        const int shift = a.exponent_ - b.exponent_;
        if (shift > 31) return a;
        return normalised(static_cast<std::uint64_t>(a.mantissa_) + (b.mantissa_ >> shift), a.exponent_);
    }
    friend constexpr ScaledWeight operator*(ScaledWeight a, ScaledWeight b) {
        return normalised(static_cast<std::uint64_t>(a.mantissa_) * b.mantissa_, a.exponent_ + b.exponent_);
    }
    friend constexpr ScaledWeight operator/(ScaledWeight a, ScaledWeight b) {
        if (a.mantissa_ == 0) return a;
        if (b.mantissa_ == 0) return normalised(1, 1000);
        // Both mantissas as numbers in [1/2, 1) with 29 fraction bits; the quotient lies in (1/2, 2).
        const auto num = dsp::Fixed<29>::from_raw(static_cast<std::int32_t>(a.mantissa_ >> 3));
        const auto den = dsp::Fixed<29>::from_raw(static_cast<std::int32_t>(b.mantissa_ >> 3));
        return normalised(static_cast<std::uint32_t>(dsp::divide(num, den).raw()),
                          a.exponent_ - b.exponent_ - 29);
    }
    constexpr ScaledWeight& operator+=(ScaledWeight o) { return *this = *this + o; }
    constexpr ScaledWeight& operator*=(ScaledWeight o) { return *this = *this * o; }
    friend constexpr bool operator<(ScaledWeight a, ScaledWeight b) {
        if (a.mantissa_ == 0 || b.mantissa_ == 0) return a.mantissa_ < b.mantissa_;
        return a.exponent_ != b.exponent_ ? a.exponent_ < b.exponent_ : a.mantissa_ < b.mantissa_;
    }

  private:
    std::uint32_t mantissa_ = 0;
    std::int32_t exponent_ = 0;
};

/// The weight that goes with a scalar: double serves itself.
template <class S>
using Weight = std::conditional_t<std::floating_point<S>, S, ScaledWeight>;

/// A non-negative S as a weight.
template <class S>
constexpr Weight<S> weight_of(S x) {
    if constexpr (std::floating_point<S>) {
        return x;
    } else {
        return ScaledWeight::of(x);
    }
}

/// e^log_weight. In double the logarithm is held within +-kMaxLogWeight, so that a sum of kMaxTracks products
/// of two stays finite and a missed column of exactly zero stays a number that can be divided by.
inline constexpr int kMaxLogWeight = 300;
template <class S>
Weight<S> weight_exp(S log_weight) {
    if constexpr (std::floating_point<S>) {
        constexpr S kEnd = kMaxLogWeight;
        return std::exp(log_weight > kEnd ? kEnd : (log_weight < -kEnd ? -kEnd : log_weight));
    } else {
        return ScaledWeight::exp(log_weight);
    }
}

/// part / whole as an S; meant for probabilities, 0 <= part <= whole, whole > 0.
template <class S>
S share_of(Weight<S> part, Weight<S> whole) {
    if constexpr (std::floating_point<S>) {
        return part / whole;
    } else {
        return (part / whole).template to<S::fraction_bits>();
    }
}

}  // namespace tracking
