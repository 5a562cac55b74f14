/// Numbers of either scalar of the trackers as double and back.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>

#include "dsp/fixed_point.hpp"

namespace tracking_test {

inline double value(double v) {
    return v;
}
inline double value(dsp::Real v) {
    return std::ldexp(v.raw(), -22);
}
/// To nearest.
template <class S>
S scalar(double v) {
    if constexpr (std::floating_point<S>) {
        return v;
    } else {
        return dsp::Real::from_raw(static_cast<std::int32_t>(std::lround(std::ldexp(v, 22))));
    }
}

}  // namespace tracking_test
