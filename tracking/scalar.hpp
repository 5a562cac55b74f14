/// What the trackers ask of a number: `double` on the PC, `dsp::Real` everywhere. One source serves both.
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>

#include "dsp/fixed_math.hpp"
#include "dsp/fixed_point.hpp"

namespace tracking {

/// The constant num/den.
template <class S>
constexpr S constant(std::int64_t num, std::int64_t den = 1) {
    if constexpr (std::floating_point<S>) {
        return static_cast<S>(num) / static_cast<S>(den);
    } else {
        return S::ratio(num, den);
    }
}

/// A fixed-point value as the scalar of a tracker. Exact.
template <class S, int F>
constexpr S scalar_from(dsp::Fixed<F> v) {
    if constexpr (std::floating_point<S>) {
        return static_cast<S>(v.raw()) / static_cast<S>(std::int64_t{1} << F);
    } else {
        return v.template to<S::fraction_bits>();
    }
}

/// e^x, natural logarithm and square root of either scalar. The fixed-point ones saturate, see
/// dsp/fixed_math.hpp.
template <class S>
constexpr S exp(S x) {
    if constexpr (std::floating_point<S>) {
        return std::exp(x);
    } else {
        return dsp::exp(x);
    }
}
template <class S>
constexpr S ln(S x) {
    if constexpr (std::floating_point<S>) {
        return std::log(x);
    } else {
        return dsp::ln(x);
    }
}
template <class S>
constexpr S sqrt(S x) {
    if constexpr (std::floating_point<S>) {
        return std::sqrt(x);
    } else {
        return dsp::sqrt(x);
    }
}

/// Something to multiply with instead of dividing by d: cheap when several numbers have the same divisor.
template <class S>
constexpr auto reciprocal(S d) {
    if constexpr (std::floating_point<S>) {
        return S(1) / d;
    } else {
        return dsp::Reciprocal(d);
    }
}

/// part * reciprocal(whole), bit for bit, for 0 <= part <= whole and whole > 0.
template <class S>
constexpr S share(S part, const decltype(reciprocal(S{}))& of_whole) {
    if constexpr (std::floating_point<S>) {
        return part * of_whole;
    } else {
        return of_whole.share(part);
    }
}

/// The largest integer not above x, which must be within int.
template <class S>
constexpr int floor_to_int(S x) {
    if constexpr (std::floating_point<S>) {
        return static_cast<int>(std::floor(x));
    } else {
        return x.raw() >> S::fraction_bits;
    }
}

/// Not below any number.
template <class S>
constexpr S largest() {
    if constexpr (std::floating_point<S>) {
        return std::numeric_limits<S>::infinity();
    } else {
        return S::max();
    }
}

template <class S>
constexpr S absolute(S x) {
    return x < S(0) ? -x : x;
}

/// a b > c d; exact in fixed point, where each product could be past the range of S.
template <class S>
constexpr bool product_exceeds(S a, S b, S c, S d) {
    if constexpr (std::floating_point<S>) {
        return a * b > c * d;
    } else {
        return dsp::product(a.raw(), b.raw()) > dsp::product(c.raw(), d.raw());
    }
}

/// weight * x, bit for bit, for a weight of -1..1.
template <class S>
constexpr S weighted(S weight, S x) {
    if constexpr (std::floating_point<S>) {
        return weight * x;
    } else {
        return S::from_raw(dsp::rounded<S::fraction_bits>(dsp::product(weight.raw(), x.raw())));
    }
}

/// The largest integer not above a b, held within 0..last.
template <class S>
constexpr int floor_of_product(S a, S b, int last) {
    if constexpr (std::floating_point<S>) {
        const S product = a * b;
        return product < S(last) ? (product > S(0) ? static_cast<int>(product) : 0) : last;
    } else {
        const auto floor = static_cast<std::int32_t>(dsp::product(a.raw(), b.raw()) >> 2 * S::fraction_bits);
        return floor < last ? (floor > 0 ? floor : 0) : last;
    }
}

/// A number not below sqrt(a b) for a >= 0, and above it by 7 % or 2^15 + 2 LSB at most: the mean of c and
/// a b / c for a power of two c of at least 2^16 LSB. 0 if b is negative.
template <class S>
constexpr S sqrt_above(S a, S b) {
    if constexpr (std::floating_point<S>) {
        return b > S(0) ? std::sqrt(a * b) * (1 + std::numeric_limits<S>::epsilon()) : S(0);
    } else {
        const std::int64_t square = dsp::product(a.raw(), b.raw());
        const auto high = static_cast<std::int32_t>(square >> 32);
        if (high < 0) return S(0);
        const int k = (64 - std::countl_zero(static_cast<std::uint32_t>(high))) / 2;
        const std::uint32_t other = static_cast<std::uint32_t>(square) >> k | static_cast<std::uint32_t>(high)
                                                                                  << (32 - k);
        const std::uint32_t mean = (1U << (k - 1)) + (other >> 1) + 2;
        constexpr std::uint32_t kMax = std::numeric_limits<std::int32_t>::max();
        return S::from_raw(static_cast<std::int32_t>(mean < kMax ? mean : kMax));
    }
}

/// Not a number or infinite; a fixed-point number never is.
template <class S>
constexpr bool is_finite(S x) {
    if constexpr (std::floating_point<S>) {
        return std::isfinite(x);
    } else {
        return true;
    }
}

template <class S>
using Vec2 = Eigen::Matrix<S, 2, 1>;
template <class S>
using Mat2 = Eigen::Matrix<S, 2, 2>;

}  // namespace tracking

namespace Eigen {
template <int F>
struct NumTraits<dsp::Fixed<F>> : GenericNumTraits<dsp::Fixed<F>> {
    using Real = dsp::Fixed<F>;
    using NonInteger = dsp::Fixed<F>;
    using Nested = dsp::Fixed<F>;
    using Literal = dsp::Fixed<F>;
    enum {
        IsComplex = 0,
        IsInteger = 0,
        IsSigned = 1,
        RequireInitialization = 1,
        ReadCost = 1,
        AddCost = 2,
        MulCost = 4
    };
    static constexpr Real epsilon() { return Real::from_raw(1); }
    static constexpr Real dummy_precision() { return Real::from_raw(16); }
    static constexpr int digits10() { return 6; }
};
}  // namespace Eigen
