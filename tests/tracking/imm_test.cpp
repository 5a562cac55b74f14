// Expected values: a two-mode step worked by hand below, and plain PDA for a bank of equal modes.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <vector>

#include <Eigen/LU>

#include "tests/tracking/imm_outliers.hpp"
#include "tracking/imm_pdaf.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::constant;
using tracking::GatedMeasurement;
using tracking::ImmModel;
using tracking::ImmState;
using tracking::Vec2;

namespace {
template <class S>
double number(S x) {
    if constexpr (std::floating_point<S>) {
        return x;
    } else {
        return x.raw() / 4194304.0;
    }
}

/// Two states, uncoupled, F = I, so that every figure can be followed with a pencil.
template <class S>
ImmModel<S, 2, 2> pencil_model() {
    ImmModel<S, 2, 2> m;
    m.mode[0].noise.setZero();
    m.mode[1].noise = tracking::Mat2<S>::Identity() * S(3);
    m.mode[1].input = {S(1), S(0)};
    m.change = {{{constant<S>(9, 10), constant<S>(1, 10)}, {constant<S>(2, 10), constant<S>(8, 10)}}};
    return m;
}

template <class S>
void pencil_step(double tolerance) {
    ImmState<S, 2, 2> s;
    s.x = {Vec2<S>(S(0), S(0)), Vec2<S>(S(2), S(0))};
    s.covariance = {tracking::Mat2<S>::Identity(), tracking::Mat2<S>::Identity()};
    s.probability = {constant<S>(6, 10), constant<S>(4, 10)};
    predict(s, pencil_model<S>());
    // c = [.9*.6 + .2*.4, .1*.6 + .8*.4] = [.62, .38].
    // mu_{i|1} = [.54/.62, .08/.62]; x0_1 = 2 * .08/.62 = .2580645; spread 4 * (.54/.62)(.08/.62) = .4495317.
    // mu_{i|2} = [.06/.38, .32/.38]; x0_2 = 2 * .32/.38 = 1.6842105; spread 4 * (.06/.38)(.32/.38) =
    // .5318560.
    DOUBLES_EQUAL(.62, number(s.probability[0]), tolerance);
    DOUBLES_EQUAL(.38, number(s.probability[1]), tolerance);
    DOUBLES_EQUAL(.2580645, number(s.x[0][0]), tolerance);
    DOUBLES_EQUAL(2.6842105, number(s.x[1][0]), tolerance);
    DOUBLES_EQUAL(1.4495317, number(s.covariance[0](0, 0)), tolerance);
    DOUBLES_EQUAL(4.5318560, number(s.covariance[1](0, 0)), tolerance);
    DOUBLES_EQUAL(1, number(s.covariance[0](1, 1)), tolerance);
    DOUBLES_EQUAL(4, number(s.covariance[1](1, 1)), tolerance);

    update(s, Vec2<S>(S(1), S(0)), Vec2<S>(S(1), S(1)));
    // S_1 = diag(2.4495317, 2), nu_1 = .7419355: L_1 = exp(-.7419355^2 / 4.8990634) / (2 pi sqrt(4.8990634))
    //     = .8937176 / 13.9071 = .0642633
    // S_2 = diag(5.5318560, 5), nu_2 = -1.6842105: L_2 = exp(-2.8365651 / 11.0637120) / (2 pi sqrt(27.65928))
    //     = .7738362 / 33.04451 = .0234180
    const double l1 = std::exp(-.7419355 * .7419355 / (2 * 2.4495317)) / std::sqrt(2.4495317 * 2);
    const double l2 = std::exp(-1.6842105 * 1.6842105 / (2 * 5.5318560)) / std::sqrt(5.5318560 * 5);
    const double mu = .62 * l1 / (.62 * l1 + .38 * l2);
    DOUBLES_EQUAL(mu, number(s.probability[0]), tolerance);
    DOUBLES_EQUAL(.8174, mu, 1e-4);
    // K_1 = 1.4495317 / 2.4495317 = .5917587; K_2 = 4.5318560 / 5.5318560 = .8192288.
    DOUBLES_EQUAL(.2580645 + .5917587 * .7419355, number(s.x[0][0]), tolerance);
    DOUBLES_EQUAL(2.6842105 - .8192288 * 1.6842105, number(s.x[1][0]), tolerance);
    DOUBLES_EQUAL(.5917587, number(s.covariance[0](0, 0)), tolerance);  // P S^-1 R with R = 1
    DOUBLES_EQUAL(.8192288, number(s.covariance[1](0, 0)), tolerance);
    const auto all = combined(s);
    const double x1 = .2580645 + .5917587 * .7419355;
    const double x2 = 2.6842105 - .8192288 * 1.6842105;
    DOUBLES_EQUAL(mu * x1 + (1 - mu) * x2, number(all.x[0]), 2 * tolerance);
    DOUBLES_EQUAL(mu * .5917587 + (1 - mu) * .8192288 + mu * (1 - mu) * (x1 - x2) * (x1 - x2),
                  number(all.covariance(0, 0)), 2 * tolerance);
}
}  // namespace

TEST_GROUP(Imm){};

TEST(Imm, TwoModesWithAPencil) {
    pencil_step<double>(2e-7);
    pencil_step<Real>(3e-6);
}

TEST(Imm, ModeProbabilitiesSurviveOutliers) {
    LONGS_EQUAL(0, tracking_test::unsound_imm_steps<double>(100'000));
    LONGS_EQUAL(0, tracking_test::unsound_imm_steps<Real>(100'000));
}

TEST(Imm, ModesRecognised) {
    const auto model = tracking::RadarModes<double>{}.model();
    std::mt19937 random(42);  // NOLINT
    std::normal_distribution<double> normal;
    ImmState<double, 2, 2> s;
    s.start({150, 0}, tracking::Mat2<double>::Identity());
    double range = 150;
    double rate = 0;
    double steady_before = 0;
    for (int k = 0; k < 200; ++k) {
        const double a = k >= 150 ? -6 : 0;
        range += rate * .1 + a * .005;
        rate += a * .1;
        predict(s, model);
        update(s, Vec2<double>(range + .3 * normal(random), rate + .1 * normal(random)),
               Vec2<double>(.09, .01));
        if (k == 149) steady_before = s.probability[0];
    }
    CHECK(steady_before > .8);
    CHECK(s.probability[1] > .9);
    DOUBLES_EQUAL(rate, combined(s).x[1], .3);
}

TEST(Imm, EqualModesArePdaAndIpda) {
    // A bank of two equal modes is one PDA filter: compared with its textbook form, common R. The nine digits
    // are those of ln 2 pi in kalman.hpp.
    ImmState<double, 2, 2> s;
    tracking::Mat2<double> p;
    p << 2, .5, .5, 1;
    s.start({100, -3}, p);
    double psi = .4;
    const std::array<GatedMeasurement<double>, 2> z{{{{101, -3.2}, {.5, .2}}, {{99, -2}, {.5, .2}}}};
    const tracking::SensorLogs<double> logs{.detected = std::log(.9 / .05),
                                            .missed = std::log(1 - .9 * .9997)};
    std::array<double, 2> beta{};
    const double none = pda_update<double, 2, 2>(s, psi, z, logs, beta);

    const tracking::Mat2<double> innovation = p + tracking::Mat2<double>(Vec2<double>(.5, .2).asDiagonal());
    const tracking::Mat2<double> inverse = innovation.inverse();
    std::array<double, 2> e{};
    std::array<Vec2<double>, 2> nu;
    for (std::size_t i = 0; i < 2; ++i) {
        nu[i] = z[i].z - Vec2<double>(100, -3);
        e[i] = .9 / .05 * std::exp(-.5 * nu[i].dot(inverse * nu[i])) /
               (2 * 3.14159265358979324 * std::sqrt(innovation.determinant()));
    }
    const double b = 1 - .9 * .9997;
    const double sum = b + e[0] + e[1];
    DOUBLES_EQUAL(b / sum, none, 1e-9);
    DOUBLES_EQUAL(e[0] / sum, beta[0], 1e-9);
    DOUBLES_EQUAL(.4 * sum / (.6 + .4 * sum), psi, 1e-9);
    const tracking::Mat2<double> k = p * inverse;
    const Vec2<double> mean_nu = (e[0] * nu[0] + e[1] * nu[1]) / sum;
    const tracking::Mat2<double> corrected = p - k * innovation * k.transpose();
    const tracking::Mat2<double> spread =
        k *
        (e[0] / sum * nu[0] * nu[0].transpose() + e[1] / sum * nu[1] * nu[1].transpose() -
         mean_nu * mean_nu.transpose()) *
        k.transpose();
    const tracking::Mat2<double> expected = b / sum * p + (1 - b / sum) * corrected + spread;
    for (std::size_t j = 0; j < 2; ++j) {
        CHECK((s.x[j] - (Vec2<double>(100, -3) + k * mean_nu)).norm() < 1e-9);
        CHECK((s.covariance[j] - expected).norm() < 1e-9);
        DOUBLES_EQUAL(.5, s.probability[j], 1e-9);
    }
}

TEST(Imm, FixedPointFollowsDouble) {
    // The same target, clutter and misses, 500 frames.
    std::mt19937 random(43);  // NOLINT
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0, 1);
    const auto real = [](double x) {
        return Real::from_raw(static_cast<std::int32_t>(std::lround(x * 4194304)));
    };
    const auto model = tracking::RadarModes<double>{}.model();
    const auto fixed_model = tracking::RadarModes<Real>{}.model();
    ImmState<double, 2, 2> s;
    ImmState<Real, 2, 2> f;
    s.start({120, -2}, tracking::Mat2<double>::Identity());
    f.start({Real(120), Real(-2)}, tracking::Mat2<Real>::Identity());
    double psi = .5;
    Real fixed_psi = Real::ratio(1, 2);
    double range = 120;
    double rate = -2;
    double worst_range = 0;
    double worst_rate = 0;
    double worst_mode = 0;
    for (int k = 0; k < 500; ++k) {
        const double a = k % 100 < 40 ? 0 : (k % 100 < 70 ? 4 : -4);
        range += rate * .1 + a * .005;
        rate += a * .1;
        predict(s, model);
        predict(f, fixed_model);
        std::vector<GatedMeasurement<double>> z;
        if (uniform(random) < .9)
            z.push_back({{range + .3 * normal(random), rate + .1 * normal(random)}, {.09, .01}});
        if (uniform(random) < .3)
            z.push_back({{range + 2 * normal(random), rate + normal(random)}, {.09, .01}});
        std::vector<GatedMeasurement<Real>> fz;
        fz.reserve(z.size());
        for (auto& m : z) {
            m.z = {number(real(m.z[0])), number(real(m.z[1]))};
            fz.push_back({{real(m.z[0]), real(m.z[1])}, {real(m.variance[0]), real(m.variance[1])}});
        }
        pda_update<double, 2, 2>(s, psi, z, {.detected = std::log(.9 / .001), .missed = std::log(.1)});
        pda_update<Real, 2, 2>(f, fixed_psi, fz,
                               {.detected = real(std::log(.9 / .001)), .missed = real(std::log(.1))});
        worst_range = std::max(worst_range, std::abs(combined(s).x[0] - number(combined(f).x[0])));
        worst_rate = std::max(worst_rate, std::abs(combined(s).x[1] - number(combined(f).x[1])));
        worst_mode = std::max(worst_mode, std::abs(s.probability[0] - number(f.probability[0])));
    }
    CHECK(worst_range < 0.05);
    CHECK(worst_rate < 0.02);
    CHECK(worst_mode < 0.02);
}
