// Expected values: hand-worked chains; brute-force simulation for the calibration.
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/tracking/existence_calibration.hpp"
#include "tracking/existence.hpp"
#include "tracking/ihpda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::ExistenceChain;
using tracking::ObservableChain;
using tracking::ObservableExistence;

TEST_GROUP(Existence){};

TEST(Existence, MarkovOne) {
    DOUBLES_EQUAL(0.98 * 0.6 + 0.1 * 0.4, (ExistenceChain<double>{.survive = .98, .appear = .1}.predict(0.6)),
                  1e-15);
    CHECK(!(ExistenceChain<double>{.survive = 1.1, .appear = 0}.valid()));
}

TEST(Existence, MarkovTwo) {
    const ObservableChain<double> chain;
    CHECK(chain.valid());
    const ObservableExistence<double> next = chain.predict({.seen = .5, .hidden = .2});
    DOUBLES_EQUAL(.5 * .9 + .2 * .3, next.seen, 1e-15);
    DOUBLES_EQUAL(.5 * .08 + .2 * .68, next.hidden, 1e-15);
    // Musicki, Evans and Stankovic 1994: both posteriors are over the same 1 - delta psi_seen.
    const double delta = 0.7;
    const double norm = 1 - delta * next.seen;
    const double seen = (1 - delta) * next.seen / norm;
    const auto updated = tracking::update_observable(next, seen);
    DOUBLES_EQUAL(next.hidden / norm, updated.hidden, 1e-15);
    // The chain with nothing hidden is chain one.
    const auto certain =
        tracking::update_observable(ObservableExistence<double>{.seen = 1, .hidden = 0}, 1.0);
    DOUBLES_EQUAL(1, certain.exists(), 0);
    const ObservableChain<Real> fixed;
    CHECK(fixed.valid());
    DOUBLES_EQUAL(
        next.seen,
        fixed.predict({.seen = Real::ratio(1, 2), .hidden = Real::ratio(1, 5)}).seen.raw() / 4194304.0, 1e-6);
}

TEST(Existence, AmplitudeRatioIsTheRatioOfTheDensities) {
    // f1/PD over f0/Pfa for a = 6, threshold 4.6, 13 dB.
    const double d = std::pow(10, 1.3);
    const double a = 6;
    const double tau = 4.6;
    const double target = std::exp(-a / (1 + d)) / (1 + d) / std::exp(-tau / (1 + d));
    const double clutter = std::exp(-a) / std::exp(-tau);
    DOUBLES_EQUAL(std::log(target / clutter), tracking::log_amplitude_ratio(a, tau, d), 1e-13);
    const Real fixed =
        tracking::log_amplitude_ratio(Real(6), Real::ratio(46, 10), Real::ratio(19952623, 1000000));
    DOUBLES_EQUAL(std::log(target / clutter), fixed.raw() / 4194304.0, 1e-5);
}

TEST(Existence, CalibrationOfIpdaAndJipda) {
    const existence_scenes::CalibrationResult c = existence_scenes::calibrate(60'000);
    std::printf(
        "\n  mean psi - frequency: IPDA one target %+.4f (worst tenth %.4f), JIPDA two targets %+.4f "
        "(%.4f);\n"
        "  known to be off: IPDA two targets %+.4f (%.4f), IHPDA one target %+.4f (%.4f)\n  ",
        c.ipda.off(), c.ipda.worst_bin(), c.jipda.off(), c.jipda.worst_bin(), c.ipda_for_two.off(),
        c.ipda_for_two.worst_bin(), c.ihpda.off(), c.ihpda.worst_bin());
    DOUBLES_EQUAL(0, c.ipda.off(), 0.01);
    DOUBLES_EQUAL(0, c.jipda.off(), 0.01);
    CHECK(c.ipda.worst_bin() < 0.02);  // 3 sigma of a tenth of 2000 scenes is 0.033 at its widest
    CHECK(c.jipda.worst_bin() < 0.02);
    CHECK(c.ihpda.off() > 0.005);  // the documented bias is there
}
