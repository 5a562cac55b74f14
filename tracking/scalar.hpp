/// What the trackers ask of a number: `double` on the PC, `dsp::Real` everywhere. One source serves both.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstdint>

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
