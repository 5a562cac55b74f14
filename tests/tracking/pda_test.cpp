// Expected values: probabilistic data association as in the textbooks (Bar-Shalom, Li and Kirubarajan 2001),
// written out in double precision.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <span>
#include <vector>

#include <Eigen/Dense>

#include "tests/tracking/synthetic_road.hpp"
#include "tracking/nearest_neighbour.hpp"
#include "tracking/pda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
using tracking::constant;
using tracking::Gate;
using tracking::GateConfig;
using tracking::Mat2;
using tracking::Measurement;
using tracking::Vec2;
using tracking_test::scalar;
using tracking_test::value;

namespace {
template <class S>
AssociationRow<S> row_of(S log_missed, const std::vector<S>& log_ratios) {
    AssociationRow<S> row;
    row.log_missed = log_missed;
    for (std::size_t j = 0; j < log_ratios.size(); ++j) {
        row.item[j] = {static_cast<std::uint16_t>(j), log_ratios[j], S(0), S(0)};
        ++row.count;
    }
    return row;
}

/// Two measurements of equal accuracy: the standard PDA equations hold.
template <class S>
void update_is_the_textbooks(double tolerance) {
    GateConfig<S> config;
    config.clutter_density = constant<S>(1, 10);  // so that beta_0 counts
    const Gate<S> gate(config);
    std::vector<Measurement<S>> measurements(2);
    measurements[0].z = {constant<S>(505, 10), constant<S>(-102, 10)};
    measurements[1].z = {constant<S>(498, 10), constant<S>(-97, 10)};
    for (auto& m : measurements) m.variance = {constant<S>(9, 100), constant<S>(4, 100)};
    Vec2<S> x(S(50), S(-10));
    Mat2<S> p;
    p << constant<S>(16, 100), constant<S>(3, 100), constant<S>(3, 100), constant<S>(5, 100);
    AssociationRow<S> row;
    gate.fill(row, x, p, measurements, 3, false);
    LONGS_EQUAL(2, row.count);
    tracking::pda<S>({&row, 1});

    Eigen::Matrix2d prior, r = Eigen::Vector2d(.09, .04).asDiagonal();
    prior << .16, .03, .03, .05;
    const Eigen::Matrix2d s = prior + r;
    const Eigen::Matrix2d k = prior * s.inverse();
    const Eigen::Vector2d nu[] = {{.5, -.2}, {-.2, .3}};
    const double b = 1 - .9 * (1 - std::exp(-8.0));
    double e[2], sum = b;
    for (int j = 0; j < 2; ++j) {
        e[j] = .9 * std::exp(-.5 * nu[j].dot(s.inverse() * nu[j])) / (2 * M_PI * std::sqrt(s.determinant())) /
               .1;
        sum += e[j];
    }
    const double beta[] = {e[0] / sum, e[1] / sum}, beta_0 = b / sum;
    for (std::size_t j = 0; j < 2; ++j) DOUBLES_EQUAL(beta[j], value(row.item[j].beta), tolerance);
    DOUBLES_EQUAL(beta_0, value(row.missed), tolerance);
    DOUBLES_EQUAL(std::log(sum), value(row.log_evidence), tolerance);

    const Eigen::Vector2d combined = beta[0] * nu[0] + beta[1] * nu[1];
    const Eigen::Matrix2d spread = beta[0] * nu[0] * nu[0].transpose() + beta[1] * nu[1] * nu[1].transpose() -
                                   combined * combined.transpose();
    const Eigen::Vector2d mean = Eigen::Vector2d(50, -10) + k * combined;
    const Eigen::Matrix2d posterior =
        beta_0 * prior + (1 - beta_0) * (prior - k * s * k.transpose()) + k * spread * k.transpose();
    tracking::update_with_row(x, p, row, std::span<const Measurement<S>>(measurements), gate);
    for (int i = 0; i < 2; ++i) {
        DOUBLES_EQUAL(mean[i], value(x[i]), tolerance);
        for (int j = 0; j < 2; ++j) DOUBLES_EQUAL(posterior(i, j), value(p(i, j)), tolerance);
    }
}
}  // namespace

TEST_GROUP(Pda){};

TEST(Pda, UpdateIsTheTextbooks) {
    update_is_the_textbooks<double>(1e-12);
    update_is_the_textbooks<Real>(5e-6);
}

TEST(Pda, FixedPointUpdateKeepsItsErrorBounds) {
    // Expected: the update in double precision on the very same numbers. Measurements up to 100 times as
    // inaccurate as others, correlated predictions, weights that are the betas and others.
    std::mt19937 random(5);
    std::uniform_real_distribution<double> u(-1, 1);
    GateConfig<Real> config;
    config.min_range_sigma_m = config.min_rate_sigma_mps = constant<Real>(1, 100);
    const Gate<Real> gate(config);
    GateConfig<double> reference_config;
    reference_config.min_range_sigma_m = reference_config.min_rate_sigma_mps = 0.01;
    const Gate<double> reference_gate(reference_config);
    double worst_mean = 0;        // in parts of the bound
    double worst_covariance = 0;  // in parts of the bound
    for (int trial = 0; trial < 20'000; ++trial) {
        const double a = std::pow(10, u(random)) / 3;
        const double b = std::pow(10, u(random)) / 3;
        Mat2<Real> p;
        p(0, 0) = scalar<Real>(a * a);
        p(1, 1) = scalar<Real>(b * b);
        p(0, 1) = p(1, 0) = scalar<Real>(0.99 * u(random) * a * b);
        const Eigen::Matrix2d exact_p{{value(p(0, 0)), value(p(0, 1))}, {value(p(1, 0)), value(p(1, 1))}};

        const int count = 1 + static_cast<int>(random() % 16);
        std::vector<Measurement<Real>> measurements;
        std::vector<Measurement<double>> exact;
        AssociationRow<Real> row;
        AssociationRow<double> exact_row;
        std::vector<double> beta(static_cast<std::size_t>(count));
        double sum = 0.1 + 0.1 * u(random);
        const double missed = sum;
        for (double& v : beta) sum += v = 0.05 + 1 + u(random);
        double scale_range = a * a;  // of P, R and squared moves
        double scale_rate = b * b;
        double independent = 1;
        for (std::size_t i = 0; i < beta.size(); ++i) {
            Measurement<Real> m;
            m.variance = {scalar<Real>(0.01 * std::pow(10, 1 + u(random))),
                          scalar<Real>(0.01 * std::pow(10, 1 + u(random)))};
            const double s0 = value(p(0, 0)) + value(m.variance[0]);
            const double s1 = value(p(1, 1)) + value(m.variance[1]);
            m.z = {scalar<Real>(4 * u(random) * std::sqrt(s0)), scalar<Real>(4 * u(random) * std::sqrt(s1))};
            measurements.push_back(m);
            exact.push_back({{value(m.z[0]), value(m.z[1])},
                             {value(m.variance[0]), value(m.variance[1])},
                             value(m.snr_db)});
            const double rho2 = value(p(0, 1)) * value(p(0, 1)) / (s0 * s1);
            independent = std::min(independent, 1 - rho2);
            scale_range = std::max(scale_range, 16 * s0);
            scale_rate = std::max(scale_rate, 16 * s1);
            const Real share = scalar<Real>(beta[i] / sum);
            const Real weight = trial % 2 == 0 ? share : scalar<Real>(i == 0 ? 1 - missed / sum : 0);
            row.item[i] = {static_cast<std::uint16_t>(i), Real(0), share, weight};
            exact_row.item[i] = {static_cast<std::uint16_t>(i), 0, value(share), value(weight)};
        }
        row.count = exact_row.count = count;
        row.missed = scalar<Real>(missed / sum);
        exact_row.missed = value(row.missed);

        Vec2<Real> x(Real(0), Real(0));
        tracking::update_with_row(x, p, row, std::span<const Measurement<Real>>(measurements), gate);
        Vec2<double> exact_x(0, 0);
        Mat2<double> updated = exact_p;
        tracking::update_with_row(exact_x, updated, exact_row, std::span<const Measurement<double>>(exact),
                                  reference_gate);
        const double lsb = std::ldexp(4, -22);
        const double part = std::ldexp(1, -18) / independent;
        const auto worsen = [](double& worst, double error, double bound) {
            worst = std::max(worst, std::abs(error) / bound);
        };
        worsen(worst_mean, value(x[0]) - exact_x[0], lsb + part * std::sqrt(scale_range));
        worsen(worst_mean, value(x[1]) - exact_x[1], lsb + part * std::sqrt(scale_rate));
        worsen(worst_covariance, value(p(0, 0)) - updated(0, 0), lsb + part * scale_range);
        worsen(worst_covariance, value(p(1, 1)) - updated(1, 1), lsb + part * scale_rate);
        worsen(worst_covariance, value(p(0, 1)) - updated(0, 1),
               lsb + part * std::sqrt(scale_range * scale_rate));
        CHECK(p(0, 1) == p(1, 0));
    }
    std::printf("update: mean at %.3f, covariance at %.3f of their bounds\n", worst_mean, worst_covariance);
    CHECK(worst_mean <= 1);
    CHECK(worst_covariance <= 1);
}

TEST(Pda, NoScaleOfLikelihoodsEmptiesARow) {
    for (const int scale : {-300, -40, 0, 40, 300}) {
        auto row = row_of<Real>(Real(scale - 2), {Real(scale), Real(scale + 1), Real(scale - 30)});
        tracking::pda<Real>({&row, 1});
        const double sum = std::exp(-2) + 1 + std::exp(1) + std::exp(-30);
        DOUBLES_EQUAL(std::exp(-2) / sum, value(row.missed), 1e-6);
        DOUBLES_EQUAL(1 / sum, value(row.item[0].beta), 1e-6);
        DOUBLES_EQUAL(std::exp(1) / sum, value(row.item[1].beta), 1e-6);
        DOUBLES_EQUAL(scale + std::log(sum), value(row.log_evidence), 1e-5);
        CHECK(row.item[1].weight == row.item[1].beta);
        CHECK(row.missed_weight == row.missed);
    }
}

TEST(Pda, WithoutCandidatesThePredictionStays) {
    auto row = row_of<Real>(Real(-2), {});
    tracking::pda<Real>({&row, 1});
    CHECK(row.missed == Real(1));
    CHECK(row.log_evidence == Real(-2));
    Vec2<Real> x(Real(50), Real(-10));
    Mat2<Real> p;
    p << constant<Real>(1, 4), constant<Real>(1, 8), constant<Real>(1, 8), constant<Real>(1, 2);
    const Mat2<Real> before = p;
    const Gate<Real> gate{GateConfig<Real>{}};
    tracking::update_with_row(x, p, row, {}, gate);
    CHECK(x[0] == Real(50) && x[1] == Real(-10));
    CHECK(p == before);
    tracking::pda<Real>({});
}

TEST(Pda, IdenticalMeasurementsShareEqually) {
    auto row = row_of<Real>(Real(-2), {Real(3), Real(3), Real(3)});
    tracking::pda<Real>({&row, 1});
    CHECK(row.item[0].beta == row.item[1].beta && row.item[1].beta == row.item[2].beta);
    DOUBLES_EQUAL(1 / (3 + std::exp(-5)), value(row.item[0].beta), 1e-6);
}

TEST(Pda, NearestNeighbourTakesTheLikeliestWhole) {
    auto row = row_of<Real>(Real(-2), {Real(-5), Real(-4), Real(-4)});
    tracking::nearest_neighbour<Real>({&row, 1});
    CHECK(row.item[0].weight == Real(0));
    CHECK(row.item[1].weight == Real(1));  // the first of equals
    CHECK(row.item[2].weight == Real(0));
    CHECK(row.missed_weight == Real(0));
    auto empty = row_of<Real>(Real(-2), {});
    tracking::nearest_neighbour<Real>({&empty, 1});
    CHECK(empty.missed_weight == Real(1));
}
