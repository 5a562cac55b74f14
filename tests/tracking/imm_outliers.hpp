/// Two modes that hear nothing but outliers.
#pragma once

#include <cmath>
#include <cstddef>
#include <random>

#include "tracking/imm_pdaf.hpp"

namespace tracking_test {

/// Steps after which a mode probability is 0, 1 or no number, their sum is not 1, or an estimate or a
/// variance is unsound.
template <class S>
int unsound_imm_steps(int steps) {
    using tracking::constant;
    const auto model = tracking::RadarModes<S>{}.model();
    std::mt19937 random(41);  // NOLINT
    tracking::ImmState<S, 2, 2> s;
    s.start({S(80), S(-5)}, tracking::Mat2<S>::Identity());
    int unsound = 0;
    for (int i = 0; i < steps; ++i) {
        predict(s, model);
        const tracking::Vec2<S> z(constant<S>(static_cast<int>(random() % 16000), 100),
                                  constant<S>(static_cast<int>(random() % 6000) - 3000, 100));
        update(s, z, tracking::Vec2<S>(constant<S>(1, 10000), constant<S>(1, 10000)));
        const S off = s.probability[0] + s.probability[1] - S(1);
        const S tolerance = constant<S>(1, 1 << 20);
        bool sound = off < tolerance && -off < tolerance;
        for (std::size_t j = 0; j < 2; ++j) {
            sound = sound && s.probability[j] > S(0) && s.probability[j] < S(1) &&
                    tracking::is_finite(s.x[j][0]) && tracking::is_finite(s.x[j][1]) &&
                    s.covariance[j](0, 0) > S(0) && s.covariance[j](1, 1) > S(0);
        }
        if (!sound) ++unsound;
    }
    return unsound;
}

}  // namespace tracking_test
