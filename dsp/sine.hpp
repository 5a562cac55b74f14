/// Sines and cosines by integer arithmetic, for tables made at compile time.
#pragma once

#include <cstdint>

#include "dsp/fixed_point.hpp"

namespace dsp {

namespace detail {

/// x in Q30, 0 <= x <= pi/4. Taylor series to x^13; the truncation is below 2^-40.
constexpr std::int64_t sine_series_q30(std::int64_t x) {
    const std::int64_t square = round_shift(x * x, 30);
    std::int64_t term = x;
    std::int64_t sum = x;
    for (int n = 2; n <= 12; n += 2) {
        term = round_divide<std::int64_t>(-round_shift(term * square, 30), n * (n + 1));
        sum += term;
    }
    return sum;
}

constexpr std::int64_t cosine_series_q30(std::int64_t x) {
    const std::int64_t square = round_shift(x * x, 30);
    std::int64_t term = std::int64_t{1} << 30;
    std::int64_t sum = term;
    for (int n = 1; n <= 13; n += 2) {
        term = round_divide<std::int64_t>(-round_shift(term * square, 30), n * (n + 1));
        sum += term;
    }
    return sum;
}

}  // namespace detail

/// cos(2 pi i / n) in Q30, n a multiple of 8. Error a few units of the last place; the symmetries of the
/// cosine hold exactly.
constexpr std::int32_t cosine_q30(int i, int n) {
    i %= n;
    if (i < 0) i += n;
    if (i > n / 2) i = n - i;                          // cos(-x) = cos(x)
    if (i > n / 4) return -cosine_q30(n / 2 - i, n);   // cos(pi - x) = -cos(x)
    constexpr std::int64_t kTwoPiQ30 = 6'746'518'852;  // 2 pi 2^30
    const auto angle = [n](int k) { return round_divide<std::int64_t>(kTwoPiQ30 * k, n); };
    if (i > n / 8) return static_cast<std::int32_t>(detail::sine_series_q30(angle(n / 4 - i)));
    return static_cast<std::int32_t>(detail::cosine_series_q30(angle(i)));
}

/// sin(2 pi i / n) in Q30, n a multiple of 8.
constexpr std::int32_t sine_q30(int i, int n) {
    return cosine_q30(i - n / 4, n);
}

}  // namespace dsp
