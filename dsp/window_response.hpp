/// What a point target looks like through a window: how to find its place between the cells, and how far its
/// sidelobes reach. Tables made at compile time.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/sine.hpp"
#include "dsp/window.hpp"

namespace dsp {

/// The main lobe of a window symmetric about its middle has one phase, but for a sign that alternates from
/// cell to cell. With both taken off, the cells around the peak of a target at offset d are A W(i - d) plus
/// noise whose covariance the window fixes, and estimating A and d is linear least squares around a guess d0:
///   A = sum a_i s_i,   d = d0 + sum g_i s_i / A   (best linear unbiased estimate, weights for d0 tabulated).
struct WindowResponse {
    static constexpr int kReach = 2;  ///< cells on each side of the peak: a Hann main lobe
    static constexpr int kTaps = 2 * kReach + 1;
    static constexpr int kGridPerCell = 16;
    static constexpr int kGrid = 11;  ///< guesses 0, 1/16 .. 10/16 cell; for negative ones mirror the cells
    static constexpr int kWeightBits = 12;

    /// Of one cell, Q12, with the lobe's alternating sign: for s_i with the peak's phase alone taken off.
    struct Weight {
        std::int16_t amplitude;  ///< a
        std::int16_t offset;     ///< g
    };
    struct Lobe {
        std::array<Weight, kTaps> weight;  ///< for cells -2..2 around the peak
        /// log2 of the variance of A (of d times A^2) for noise of power 2^-12 in each cell, Q6.10: of a' C a
        /// and g' C g.
        std::int16_t amplitude_variance;
        std::int16_t offset_variance;
    };
    alignas(4) std::array<Lobe, kGrid> lobe;  ///< by guess

    static constexpr int kRatioBits = 7;  ///< a step of one eighth of an octave
    static constexpr int kRatios = 40;
    /// Offset of a target towards a cell next to its peak cell, in grid steps, -8..8, by the power of the
    /// peak cell over that of this neighbour: [i] for a log2 from i to i + 1 steps, the last one for more.
    std::array<std::int8_t, kRatios> offset_by_ratio;
    /// log2 of the largest power m cells away from the peak cell of a target, over that of the peak cell,
    /// whatever its offset: Q6.10, never positive. The spectrum is cyclic: 63 is 1. With growing m it falls,
    /// but may rise once by one place: none from m on is more than the larger of those at m and m + 1.
    std::array<std::int16_t, kWindowLength> sidelobe;
};

namespace detail {

/// W(x), -W'(x) and the noise covariance of a window, Q24, relative to W(0) and to the noise power.
class WindowModel {
  public:
    static constexpr int kBits = 24;
    static constexpr std::int64_t kOne = std::int64_t{1} << kBits;
    static constexpr int kStep = WindowResponse::kGridPerCell;

    constexpr explicit WindowModel(const Window& window) : window_(window) {
        for (int i = 0; i < kTurn; ++i) cosine_[static_cast<std::size_t>(i)] = cosine_q30(i, kTurn);
        for (int n = 0; n < kWindowLength; ++n) sum_ += at(n);
    }
    /// x in sixteenths of a cell.
    [[nodiscard]] constexpr std::int64_t response(int x) const {
        std::int64_t sum = 0;  // Q45 at most 2^51
        for (int n = 0; n < kWindowLength; ++n) sum += at(n) * cosine(x * (n - kWindowLength / 2));
        return round_divide<std::int64_t>(sum >> (30 - kBits), sum_);
    }
    /// log2 of |W(x)|^2, Q6.10, at least -32: with the small imaginary part that the first sample, which has
    /// no partner on the other side of the middle, gives to windows that do not start at zero.
    [[nodiscard]] constexpr std::int32_t log2_power(int x) const {
        const std::int64_t re = response(x);
        const std::int64_t im = round_divide<std::int64_t>(
            at(0) * (cosine(x * (kWindowLength / 2) - kTurn / 4) >> (30 - kBits)), sum_);
        const auto power = static_cast<std::uint64_t>(re * re + im * im);  // Q48
        if (power >> 16 == 0) return -32 * kLogOne;
        const int down = static_cast<int>(std::bit_width(power)) - 32;
        const auto mantissa = static_cast<std::uint32_t>(down > 0 ? power >> down : power);
        return log2_q10(mantissa) + (down > 0 ? down - 2 * kBits : -2 * kBits) * kLogOne;
    }
    /// dW(i - d)/dd at i - d = x.
    [[nodiscard]] constexpr std::int64_t derivative(int x) const {
        std::int64_t sum = 0;
        for (int n = 0; n < kWindowLength; ++n) {
            const int m = n - kWindowLength / 2;
            sum += at(n) * m * cosine(x * m - kTurn / 4);
        }
        constexpr std::int64_t kPerSample = 1'647'099;  // 2 pi / 64, Q24
        return round_divide<std::int64_t>(round_shift(sum >> (30 - kBits), 15) * kPerSample,
                                          sum_ * (kOne >> 15));
    }
    /// Between cells `lag` apart.
    [[nodiscard]] constexpr std::int64_t covariance(int lag) const {
        std::int64_t sum = 0;
        std::int64_t power = 0;
        for (int n = 0; n < kWindowLength; ++n) {
            const std::int64_t square = at(n) * at(n) >> 6;
            sum += square * (cosine(kStep * lag * (n - kWindowLength / 2)) >> 6);
            power += square;
        }
        return round_divide<std::int64_t>(sum, power);
    }

  private:
    static constexpr int kTurn = kStep * kWindowLength;
    [[nodiscard]] constexpr std::int64_t at(int n) const { return window_[static_cast<std::size_t>(n)]; }
    [[nodiscard]] constexpr std::int64_t cosine(int i) const {
        return cosine_[static_cast<std::size_t>(i & (kTurn - 1))];
    }
    Window window_;
    std::array<std::int32_t, kTurn> cosine_{};
    std::int64_t sum_ = 0;
};

constexpr std::int64_t multiply_q24(std::int64_t a, std::int64_t b) {
    return round_shift(a * b, 24);
}
constexpr std::int64_t divide_q24(std::int64_t a, std::int64_t b) {
    return b < 0 ? round_divide<std::int64_t>(-a * (std::int64_t{1} << 24), -b)
                 : round_divide<std::int64_t>(a * (std::int64_t{1} << 24), b);
}

}  // namespace detail

constexpr WindowResponse make_response(const Window& window) {
    using detail::divide_q24;
    using detail::multiply_q24;
    constexpr std::size_t kTaps = WindowResponse::kTaps;
    constexpr int kReach = WindowResponse::kReach;
    using Vector = std::array<std::int64_t, kTaps>;
    const detail::WindowModel model(window);
    const auto dot = [](const Vector& x, const Vector& y) {
        std::int64_t sum = 0;
        for (std::size_t i = 0; i < kTaps; ++i) sum += multiply_q24(x[i], y[i]);
        return sum;
    };

    std::array<Vector, kTaps> covariance{};
    for (std::size_t i = 0; i < kTaps; ++i) {
        for (std::size_t j = 0; j < kTaps; ++j) {
            covariance[i][j] = model.covariance(static_cast<int>(i) - static_cast<int>(j));
        }
    }
    // Three per cent of white noise on top: the weights stay small when the model does not fit exactly
    // (several scatterers, changing amplitude). Costs a few per cent of variance.
    std::array<Vector, kTaps> stiff = covariance;
    for (std::size_t i = 0; i < kTaps; ++i) stiff[i][i] += detail::WindowModel::kOne * 3 / 100;
    const auto solve = [&stiff](Vector b) {  // Gauss; the matrix is positive definite, no pivoting needed
        std::array<Vector, kTaps> m = stiff;
        for (std::size_t p = 0; p < kTaps; ++p) {
            for (std::size_t i = p + 1; i < kTaps; ++i) {
                const std::int64_t factor = divide_q24(m[i][p], m[p][p]);
                for (std::size_t j = p; j < kTaps; ++j) m[i][j] -= multiply_q24(factor, m[p][j]);
                b[i] -= multiply_q24(factor, b[p]);
            }
        }
        for (std::size_t p = kTaps; p-- > 0;) {
            for (std::size_t j = p + 1; j < kTaps; ++j) b[p] -= multiply_q24(m[p][j], b[j]);
            b[p] = divide_q24(b[p], m[p][p]);
        }
        return b;
    };

    WindowResponse result{};
    for (std::size_t grid = 0; grid < WindowResponse::kGrid; ++grid) {
        Vector value{};
        Vector slope{};
        for (std::size_t i = 0; i < kTaps; ++i) {
            const int x =
                (static_cast<int>(i) - kReach) * WindowResponse::kGridPerCell - static_cast<int>(grid);
            value[i] = model.response(x);
            slope[i] = model.derivative(x);
        }
        const Vector u = solve(value);
        const Vector v = solve(slope);
        const std::int64_t f00 = dot(value, u);
        const std::int64_t f01 = dot(value, v);
        const std::int64_t f11 = dot(slope, v);
        const std::int64_t det = multiply_q24(f00, f11) - multiply_q24(f01, f01);
        Vector a{};
        Vector g{};
        constexpr int kDown = detail::WindowModel::kBits - WindowResponse::kWeightBits;
        for (std::size_t i = 0; i < kTaps; ++i) {
            a[i] = divide_q24(multiply_q24(f11, u[i]) - multiply_q24(f01, v[i]), det);
            g[i] = divide_q24(multiply_q24(f00, v[i]) - multiply_q24(f01, u[i]), det);
            const int sign = i % 2 == kReach % 2 ? 1 : -1;
            result.lobe[grid].weight[i] = {static_cast<std::int16_t>(sign * round_shift(a[i], kDown)),
                                           static_cast<std::int16_t>(sign * round_shift(g[i], kDown))};
        }
        Vector ca{};
        Vector cg{};
        for (std::size_t i = 0; i < kTaps; ++i) {
            ca[i] = dot(covariance[i], a);
            cg[i] = dot(covariance[i], g);
        }
        const auto log2 = [](std::int64_t variance) {
            return static_cast<std::int16_t>(
                log2_q10(static_cast<std::uint16_t>(round_shift(variance, kDown))));
        };
        result.lobe[grid].amplitude_variance = log2(dot(a, ca));
        result.lobe[grid].offset_variance = log2(dot(g, cg));
    }
    constexpr std::size_t kHalf = WindowResponse::kGridPerCell / 2;
    std::array<std::int32_t, 2 * kHalf + 1> ratio{};  // by offset + kHalf
    for (std::size_t i = 0; i < ratio.size(); ++i) {
        const int offset = static_cast<int>(i) - static_cast<int>(kHalf);
        ratio[i] = model.log2_power(offset) - model.log2_power(WindowResponse::kGridPerCell - offset);
    }
    std::size_t nearest = 2 * kHalf;
    for (std::size_t i = 0; i < WindowResponse::kRatios; ++i) {
        const auto twice = static_cast<std::int32_t>(2 * i + 1) << WindowResponse::kRatioBits;
        // The ratio rises as the offset falls, for a rectangular window down to 0.
        while (nearest > 0 && ratio[nearest - 1] > ratio[nearest] &&
               ratio[nearest - 1] + ratio[nearest] < twice) {
            --nearest;
        }
        result.offset_by_ratio[i] =
            static_cast<std::int8_t>(static_cast<int>(nearest) - static_cast<int>(kHalf));
    }
    for (int m = 2; m <= kWindowLength / 2; ++m) {
        std::int32_t largest = -32 * kLogOne;
        for (const int d : {-8, -6, -4, 4, 6, 8}) {
            const std::int32_t level =
                model.log2_power(WindowResponse::kGridPerCell * m - d) - model.log2_power(d);
            largest = level > largest ? level : largest;
        }
        const auto distance = static_cast<std::size_t>(m);
        result.sidelobe[distance] = static_cast<std::int16_t>(largest);
        result.sidelobe[kWindowLength - distance] = static_cast<std::int16_t>(largest);
    }
    return result;
}

/// By WindowKind.
extern const std::array<WindowResponse, 4> kWindowResponses;

inline const WindowResponse& window_response(WindowKind kind) {
    return kWindowResponses[static_cast<std::size_t>(kind)];
}

}  // namespace dsp
