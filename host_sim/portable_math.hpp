/// Elementary functions of additions, multiplications and divisions only, so that a synthesised frame has the
/// same bits with every compiler, optimisation level and C library. Accurate to a few 1e-16.
#pragma once

#include <cmath>
#include <numbers>

namespace sim {

struct Phasor {
    double re = 0;
    double im = 0;
};

constexpr Phasor operator*(Phasor a, Phasor b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

/// cos and sin of 2 pi * cycles; |cycles| < 2^40.
inline Phasor phasor(double cycles) {
    const double turn = cycles - std::floor(cycles);
    const double quadrant = std::floor(4 * turn + 0.5);
    const double x = (turn - quadrant / 4) * 2 * std::numbers::pi;  // within +-pi/4
    const double x2 = x * x;
    double cosine = 0;
    double sine = 0;
    for (int k = 16; k >= 2; k -= 2) {
        cosine = (1 - cosine) * x2 / (k * (k - 1));
        sine = (1 - sine) * x2 / (k * (k + 1));
    }
    cosine = 1 - cosine;
    sine = x * (1 - sine);
    switch (static_cast<int>(quadrant) & 3) {
        case 0:
            return {cosine, sine};
        case 1:
            return {-sine, cosine};
        case 2:
            return {-cosine, -sine};
        default:
            return {sine, -cosine};
    }
}

/// e^x, |x| < 700.
inline double exponential(double x) {
    const double k = std::floor(x / std::numbers::ln2 + 0.5);
    const double r = x - k * std::numbers::ln2;
    double sum = 1;
    for (int i = 14; i >= 1; --i) sum = 1 + sum * r / i;
    return std::ldexp(sum, static_cast<int>(k));
}

/// ln x, x > 0.
inline double logarithm(double x) {
    int exponent = 0;
    double m = std::frexp(x, &exponent);
    if (m < std::numbers::sqrt2 / 2) {
        m *= 2;
        --exponent;
    }
    const double s = (m - 1) / (m + 1);
    const double s2 = s * s;
    double sum = 0;
    for (int i = 23; i >= 1; i -= 2) sum = sum * s2 + 1.0 / i;
    return 2 * s * sum + exponent * std::numbers::ln2;
}

inline double power_from_db(double db) {
    return exponential(db * (std::numbers::ln10 / 10));
}
inline double db_from_power(double power) {
    return logarithm(power) * (10 / std::numbers::ln10);
}

}  // namespace sim
