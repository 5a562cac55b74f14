// Expected values: hand-worked chains; brute-force simulation for the calibration.
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <vector>

#include "tests/tracking/existence_scenes.hpp"
#include "tracking/existence.hpp"
#include "tracking/ihpda.hpp"
#include "tracking/ipda.hpp"
#include "tracking/jipda.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::AssociationRow;
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

namespace {
/// Two predicted tracks in one dimension of a unit-density field, 1.2 sigma apart; each target exists with
/// its psi. What each solver says must come true as often as it says.
struct Calibration {
    double said = 0;
    double true_count = 0;
    std::array<double, 10> bin_said{};
    std::array<double, 10> bin_true{};
    std::array<int, 10> bin_count{};
    void add(double psi, bool exists) {
        said += psi;
        true_count += exists ? 1 : 0;
        const auto b = static_cast<std::size_t>(psi >= 1 ? 9 : psi * 10);
        bin_said[b] += psi;
        bin_true[b] += exists ? 1 : 0;
        ++bin_count[b];
    }
    [[nodiscard]] double worst_bin() const {
        double worst = 0;
        for (std::size_t b = 0; b < 10; ++b)
            if (bin_count[b] > 2000)
                worst = std::max(worst, std::abs(bin_said[b] - bin_true[b]) / bin_count[b]);
        return worst;
    }
};

constexpr double kDetection = 0.85;
constexpr double kClutter = 0.3;  // per unit length; sigma of the innovation is 1
constexpr double kGate = 5.0;     // half width: PG = 1 - 6e-7

struct Drawn {
    existence_scenes::Scene scene;
    std::vector<double> strength;
    std::array<bool, 2> exists{};
};

Drawn draw(std::mt19937& random, int tracks, double separation, double snr) {
    std::uniform_real_distribution<double> uniform(0, 1);
    std::normal_distribution<double> normal;
    std::exponential_distribution<double> exponential;
    Drawn d;
    std::vector<double> z;
    std::array<double, 2> psi{};
    for (int t = 0; t < tracks; ++t) {
        const auto i = static_cast<std::size_t>(t);
        psi[i] = 0.1 + 0.8 * uniform(random);
        d.exists[i] = uniform(random) < psi[i];
        if (d.exists[i] && uniform(random) < kDetection) {
            z.push_back(separation * t + normal(random));
            d.strength.push_back((1 + snr) * exponential(random));
        }
    }
    const double from = -kGate - 1;
    const double to = separation * (tracks - 1) + kGate + 1;
    std::poisson_distribution<int> count(kClutter * (to - from));
    for (int n = count(random); n > 0; --n) {
        z.push_back(from + (to - from) * uniform(random));
        d.strength.push_back(exponential(random));
    }
    for (int t = 0; t < tracks; ++t) {
        AssociationRow<double> row;
        row.log_missed = std::log(1 - kDetection);
        for (std::size_t j = 0; j < z.size() && row.count < tracking::kMaxGated; ++j) {
            const double nu = z[j] - separation * t;
            if (std::abs(nu) > kGate) continue;
            auto& c = row.item[static_cast<std::size_t>(row.count++)];
            c.measurement = static_cast<std::uint16_t>(j);
            c.log_ratio = std::log(kDetection / kClutter / std::sqrt(2 * 3.14159265358979324)) - nu * nu / 2;
        }
        d.scene.rows.push_back(row);
        d.scene.existence.push_back(psi[static_cast<std::size_t>(t)]);
    }
    return d;
}
}  // namespace

TEST(Existence, CalibrationOfIpdaAndJipda) {
    constexpr int kScenes = 60'000;
    std::mt19937 random(21);  // NOLINT
    Calibration single;
    Calibration joint;
    Calibration ipda_for_two;
    Calibration rank;
    const auto jpda = std::make_unique<tracking::JpdaWorkspace<double>>();
    const auto ihpda = std::make_unique<tracking::IhpdaWorkspace<double>>();
    for (int i = 0; i < kScenes; ++i) {
        Drawn one = draw(random, 1, 0, 4);
        existence_scenes::Scene again = one.scene;
        tracking::ipda<double>(one.scene.rows, one.scene.existence);
        single.add(one.scene.existence[0], one.exists[0]);
        const std::array<tracking::RankInput<double>, 1> input{
            {{.log_gate_clutter = std::log(kClutter * 2 * kGate), .log_spread = std::log(5.0)}}};
        tracking::ihpda<double>(again.rows, again.existence, one.strength, input,
                                {.sharing = tracking::Sharing::ignored}, *ihpda);
        rank.add(again.existence[0], one.exists[0]);

        Drawn two = draw(random, 2, 1.2, 4);
        existence_scenes::Scene two_again = two.scene;
        tracking::jipda<double>(two.scene.rows, two.scene.existence, *jpda);
        tracking::ipda<double>(two_again.rows, two_again.existence);
        for (std::size_t t = 0; t < 2; ++t) {
            joint.add(two.scene.existence[t], two.exists[t]);
            ipda_for_two.add(two_again.existence[t], two.exists[t]);
        }
    }
    const auto off = [](const Calibration& c, int n) { return (c.said - c.true_count) / n; };
    std::printf(
        "\n  mean psi - frequency: IPDA one target %+.4f (worst tenth %.4f), JIPDA two targets %+.4f "
        "(%.4f);\n"
        "  known to be off: IPDA two targets %+.4f (%.4f), IHPDA one target %+.4f (%.4f)\n  ",
        off(single, kScenes), single.worst_bin(), off(joint, 2 * kScenes), joint.worst_bin(),
        off(ipda_for_two, 2 * kScenes), ipda_for_two.worst_bin(), off(rank, kScenes), rank.worst_bin());
    DOUBLES_EQUAL(0, off(single, kScenes), 0.01);
    DOUBLES_EQUAL(0, off(joint, 2 * kScenes), 0.01);
    CHECK(single.worst_bin() < 0.02);  // 3 sigma of a tenth of 2000 scenes is 0.033 at its widest
    CHECK(joint.worst_bin() < 0.02);
    CHECK(off(rank, kScenes) > 0.005);  // the documented bias is there
}
