// Expected values: probabilistic data association as in the textbooks (Bar-Shalom, Li and Kirubarajan 2001),
// written out in double precision.
#include <cmath>
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
