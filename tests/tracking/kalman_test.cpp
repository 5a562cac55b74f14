// Expected values: Eigen's dense algebra in double precision, and the Riccati equation iterated in double.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include <Eigen/Dense>

#include "tests/tracking/scalars.hpp"
#include "tracking/kalman.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::constant;
using tracking::Innovation;
using tracking::Ldl;
using tracking::Mat2;
using tracking::MotionModel;
using tracking::Vec2;
using tracking_test::scalar;
using tracking_test::value;

namespace {
template <class S>
Mat2<S> scalars(const Eigen::Matrix2d& m) {
    Mat2<S> out;
    out << scalar<S>(m(0, 0)), scalar<S>(m(0, 1)), scalar<S>(m(1, 0)), scalar<S>(m(1, 1));
    return out;
}
template <class S>
double largest_difference(const Eigen::Matrix2d& expected, const Mat2<S>& m) {
    double d = 0;
    for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) d = std::max(d, std::abs(expected(i, j) - value(m(i, j))));
    }
    return d;
}

/// A covariance with standard deviations in the ranges a track has and any correlation up to 0.98.
Eigen::Matrix2d random_covariance(std::mt19937& random) {
    std::uniform_real_distribution<double> u(-1, 1);
    const double a = 0.3 * std::pow(10, u(random));
    const double b = 0.2 * std::pow(6, u(random));
    const double c = 0.98 * u(random) * a * b;
    Eigen::Matrix2d p;
    p << a * a, c, c, b * b;
    return p;
}

template <class S>
void agrees_with_dense_algebra(double tolerance) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> u(-1, 1);
    for (int trial = 0; trial < 5000; ++trial) {
        const Eigen::Matrix2d p = random_covariance(random);
        const Eigen::Vector2d r(0.15 * std::pow(6, u(random)), 0.015 * std::pow(6, u(random)));
        const Eigen::Vector2d nu(3 * u(random) * std::sqrt(p(0, 0) + r[0]),
                                 3 * u(random) * std::sqrt(p(1, 1) + r[1]));
        const Eigen::Matrix2d s = p + Eigen::Matrix2d(r.asDiagonal());
        const Eigen::Matrix2d k = p * s.inverse();
        const Eigen::Matrix2d joseph =
            (Eigen::Matrix2d::Identity() - k) * p * (Eigen::Matrix2d::Identity() - k).transpose() +
            k * Eigen::Matrix2d(r.asDiagonal()) * k.transpose();
        const double d2 = nu.dot(s.inverse() * nu);

        const Mat2<S> ps = scalars<S>(p);
        const Vec2<S> rs(scalar<S>(r[0]), scalar<S>(r[1]));
        const Vec2<S> nus(scalar<S>(nu[0]), scalar<S>(nu[1]));
        const Innovation<S> innovation(ps, rs);
        CHECK(innovation.valid());
        const S distance2 = innovation.distance2(nus);
        DOUBLES_EQUAL(d2, value(distance2), 200 * tolerance * (1 + d2));
        const double log_density = -0.5 * d2 - std::log(2 * M_PI) - 0.5 * std::log(s.determinant());
        DOUBLES_EQUAL(log_density, value(innovation.log_density(distance2)), 200 * tolerance * (1 + d2));
        const Eigen::Vector2d move = k * nu;
        const Vec2<S> moved = innovation.move(nus);
        for (int i = 0; i < 2; ++i)
            DOUBLES_EQUAL(move[i], value(moved[i]), 20 * tolerance * (1 + nu.cwiseAbs().maxCoeff()));
        CHECK(largest_difference(joseph, innovation.posterior()) < 20 * tolerance);

        const Ldl<S> ldl(tracking::innovation_covariance(ps, rs));
        CHECK(ldl.valid());
        DOUBLES_EQUAL(d2, value(ldl.distance2(nus)), 200 * tolerance * (1 + d2));
        DOUBLES_EQUAL(log_density, value(ldl.log_density(distance2)), 200 * tolerance * (1 + d2));
    }
}
}  // namespace

TEST_GROUP(Kalman){};

TEST(Kalman, AgreesWithDenseAlgebra) {
    agrees_with_dense_algebra<double>(1e-12);
    agrees_with_dense_algebra<Real>(1e-6);
}

TEST(Kalman, FixedPointInnovationKeepsItsErrorBounds) {
    // Expected: long double on the very same numbers, so that nothing but the arithmetic differs.
    using Matrix = Eigen::Matrix<long double, 2, 2>;
    using Vector = Eigen::Matrix<long double, 2, 1>;
    const auto exact = [](const Real& x) { return static_cast<long double>(value(x)); };
    std::mt19937 random(4);
    std::uniform_real_distribution<double> u(-1, 1);
    long double worst_distance = 0;   // in parts of the bound
    long double worst_posterior = 0;  // in LSB
    for (int trial = 0; trial < 20'000; ++trial) {
        const double a = std::pow(10, u(random));
        const double b = std::pow(10, u(random));
        const double c = 0.999 * u(random) * a * b;
        Eigen::Matrix2d pd;
        pd << a * a, c, c, b * b;
        const Mat2<Real> p = scalars<Real>(0.09 * pd);
        const Vec2<Real> r(scalar<Real>(std::pow(10, u(random)) * (trial % 2 == 0 ? 1 : 0.01)),
                           scalar<Real>(std::pow(10, u(random)) * (trial % 3 == 0 ? 1 : 0.01)));
        Matrix s;
        s << exact(p(0, 0)) + exact(r[0]), exact(p(0, 1)), exact(p(0, 1)), exact(p(1, 1)) + exact(r[1]);
        const Vec2<Real> nu(scalar<Real>(5 * u(random) * std::sqrt(static_cast<double>(s(0, 0)))),
                            scalar<Real>(5 * u(random) * std::sqrt(static_cast<double>(s(1, 1)))));
        const Innovation<Real> innovation(p, r);
        CHECK(innovation.valid());
        const Matrix inverse = s.inverse();
        const Vector n(exact(nu[0]), exact(nu[1]));
        const long double d2 = n.dot(inverse * n);
        const long double independent = 1 - s(0, 1) * s(0, 1) / (s(0, 0) * s(1, 1));
        const long double bound = std::ldexp(1.0L, -18) * (1 + d2) / independent;
        if (d2 < 500)
            worst_distance = std::max(worst_distance, std::abs(exact(innovation.distance2(nu)) - d2) / bound);
        const Vector noise(exact(r[0]), exact(r[1]));
        const Matrix diagonal = noise.asDiagonal();
        const Matrix posterior = diagonal - diagonal * inverse * diagonal;
        const Mat2<Real> out = innovation.posterior();
        for (int i = 0; i < 2; ++i) {
            for (int j = 0; j < 2; ++j)
                worst_posterior =
                    std::max(worst_posterior, std::ldexp(std::abs(exact(out(i, j)) - posterior(i, j)), 22));
        }
    }
    std::printf("distance2 at %.3Lf of its bound, posterior within %.3Lf LSB (bar 2)\n", worst_distance,
                worst_posterior);
    CHECK(worst_distance <= 1);
    CHECK(worst_posterior <= 2);
}

TEST(Kalman, PredictionIsFPFPlusQ) {
    const MotionModel<double> model;
    const double t = 0.1;
    Eigen::Matrix2d f;
    f << 1, t, 0, 1;
    const Eigen::Vector2d g(t * t / 2, t);
    std::mt19937 random(2);
    for (int trial = 0; trial < 100; ++trial) {
        const Eigen::Matrix2d p = random_covariance(random);
        const Eigen::Matrix2d expected = f * p * f.transpose() + 25 * g * g.transpose();
        CHECK(largest_difference(expected, tracking::predict_covariance(p, model)) < 1e-12);
        CHECK(largest_difference(expected,
                                 tracking::predict_covariance(scalars<Real>(p), MotionModel<Real>{})) < 2e-6);
    }
    const Vec2<Real> x = tracking::predict_state<Real>({Real(80), Real(-20)}, MotionModel<Real>{});
    DOUBLES_EQUAL(78, value(x[0]), 1e-5);
    DOUBLES_EQUAL(-20, value(x[1]), 0);
}

TEST(Kalman, FixedPointCovarianceStaysPositiveAndOnTheRiccatiPath) {
    // 100,000 frames with changing accuracy and missed frames. Compared with the plain equations in double.
    std::mt19937 random(3);
    std::uniform_real_distribution<double> u(0, 1);
    const MotionModel<Real> model;
    Eigen::Matrix2d f;
    f << 1, 0.1, 0, 1;
    const Eigen::Vector2d g(0.005, 0.1);
    Eigen::Matrix2d reference = Eigen::Vector2d(0.25, 0.04).asDiagonal();
    Mat2<Real> p = scalars<Real>(reference);
    double worst = 0;
    for (int frame = 0; frame < 100'000; ++frame) {
        reference = (f * reference * f.transpose() + 25 * g * g.transpose()).eval();
        p = tracking::predict_covariance(p, model);
        if (u(random) < 0.9) {
            const Real r0 = scalar<Real>(0.0225 * std::pow(40, u(random)));
            const Real r1 = scalar<Real>(0.0025 * std::pow(40, u(random)));
            const Eigen::Matrix2d r = Eigen::Vector2d(value(r0), value(r1)).asDiagonal();
            const Eigen::Matrix2d k = reference * (reference + r).inverse();
            reference = ((Eigen::Matrix2d::Identity() - k) * reference).eval();
            const Innovation<Real> innovation(p, {r0, r1});
            CHECK(innovation.valid());
            p = innovation.posterior();
        }
        CHECK(p(0, 1) == p(1, 0));
        CHECK(Ldl<Real>(p).valid());
        for (int i = 0; i < 2; ++i) worst = std::max(worst, std::abs(value(p(i, i)) / reference(i, i) - 1));
    }
    CHECK(worst < 0.005);
}

TEST(Kalman, SingularMatrixIsSaidToBeSingular) {
    Mat2<Real> m = Mat2<Real>::Zero();
    CHECK_FALSE(Ldl<Real>(m).valid());
    m << Real(1), Real(2), Real(2), Real(4);
    CHECK_FALSE(Ldl<Real>(m).valid());
    m << Real(-1), Real(0), Real(0), Real(1);
    CHECK_FALSE(Ldl<Real>(m).valid());
    CHECK_FALSE(Ldl<double>(Mat2<double>::Zero()).valid());
    const Vec2<Real> none(Real(0), Real(0));
    CHECK_FALSE(Innovation<Real>(Mat2<Real>::Zero(), none).valid());
    CHECK_FALSE(Innovation<Real>(m, none).valid());
    m << Real(1), Real(2), Real(2), Real(4);
    CHECK_FALSE(Innovation<Real>(m, none).valid());
    m << Real::from_raw(1), Real(500), Real(500), Real::from_raw(1);
    CHECK_FALSE(Innovation<Real>(m, none).valid());
    m << Real::max(), Real(0), Real(0), Real::max();
    CHECK(Innovation<Real>(m, {Real::max(), Real::max()}).valid());
}

TEST(Kalman, FarInnovationsSaturateAboveAnyGate) {
    Mat2<Real> s;
    s << constant<Real>(1, 100), Real(0), Real(0), constant<Real>(1, 1000);
    CHECK(Ldl<Real>(s).distance2({Real(400), Real(0)}) > Real(100));
    CHECK(Ldl<Real>(s).distance2({Real(-400), Real(-60)}) > Real(100));
    s << Real(400), Real(0), Real(0), Real(1);
    DOUBLES_EQUAL(100, value(Ldl<Real>(s).distance2({Real(200), Real(0)})),
                  1e-3);  // 200^2 alone would saturate
}
