/// What the existence-based solvers say in drawn scenes, and how often it comes true.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "tests/tracking/existence_scenes.hpp"
#include "tracking/ihpda.hpp"
#include "tracking/ipda.hpp"
#include "tracking/jipda.hpp"

namespace existence_scenes {

/// What was said of existence, and what came true.
struct Calibration {
    double said = 0;
    double true_count = 0;
    int count = 0;
    std::array<double, 10> bin_said{};
    std::array<double, 10> bin_true{};
    std::array<int, 10> bin_count{};
    void add(double psi, bool exists) {
        ++count;
        said += psi;
        true_count += exists ? 1 : 0;
        const auto b = static_cast<std::size_t>(psi >= 1 ? 9 : psi * 10);
        bin_said[b] += psi;
        bin_true[b] += exists ? 1 : 0;
        ++bin_count[b];
    }
    /// Mean probability less frequency.
    [[nodiscard]] double off() const { return (said - true_count) / count; }
    [[nodiscard]] double worst_bin() const {
        double worst = 0;
        for (std::size_t b = 0; b < 10; ++b)
            if (bin_count[b] > 2000)
                worst = std::max(worst, std::abs(bin_said[b] - bin_true[b]) / bin_count[b]);
        return worst;
    }
};

inline constexpr double kDetection = 0.85;
inline constexpr double kClutter = 0.3;  // per unit length; sigma of the innovation is 1
inline constexpr double kGate = 5.0;     // half width: PG = 1 - 6e-7

/// Predicted tracks in one dimension of a field of clutter; each target exists with its track's psi.
struct Drawn {
    Scene scene;
    std::vector<double> strength;
    std::array<bool, 2> exists{};
};

inline Drawn draw(std::mt19937& random, int tracks, double separation, double snr) {
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
struct CalibrationResult {
    Calibration ipda;          ///< one target
    Calibration jipda;         ///< two, 1.2 sigma apart
    Calibration ipda_for_two;  ///< the same; too sure, since each target is clutter to the other's track
    Calibration ihpda;         ///< one target; known to be off, since only the likeliest rank is kept
};
inline CalibrationResult calibrate(int scenes) {
    CalibrationResult result;
    std::mt19937 random(21);  // NOLINT
    const auto jpda = std::make_unique<tracking::JpdaWorkspace<double>>();
    const auto ihpda = std::make_unique<tracking::IhpdaWorkspace<double>>();
    for (int i = 0; i < scenes; ++i) {
        Drawn one = draw(random, 1, 0, 4);
        Scene again = one.scene;
        tracking::ipda<double>(one.scene.rows, one.scene.existence);
        result.ipda.add(one.scene.existence[0], one.exists[0]);
        const std::array<tracking::RankInput<double>, 1> input{
            {{.log_gate_clutter = std::log(kClutter * 2 * kGate), .log_spread = std::log(5.0)}}};
        tracking::ihpda<double>(again.rows, again.existence, one.strength, input,
                                {.sharing = tracking::Sharing::ignored}, *ihpda);
        result.ihpda.add(again.existence[0], one.exists[0]);

        Drawn two = draw(random, 2, 1.2, 4);
        Scene two_again = two.scene;
        tracking::jipda<double>(two.scene.rows, two.scene.existence, *jpda);
        tracking::ipda<double>(two_again.rows, two_again.existence);
        for (std::size_t t = 0; t < 2; ++t) {
            result.jipda.add(two.scene.existence[t], two.exists[t]);
            result.ipda_for_two.add(two_again.existence[t], two.exists[t]);
        }
    }
    return result;
}

/// Rank probabilities against the ranks of a target in drawn scenes: largest difference, in standard
/// deviations of the count.
inline double worst_rank_sigma(int scenes) {
    std::mt19937_64 random(31);  // NOLINT
    std::exponential_distribution<double> exponential;
    double worst = 0;
    for (const auto& [m, snr] : {std::pair{3, 4.0}, std::pair{8, 1.0}}) {
        std::vector<double> p(static_cast<std::size_t>(m));
        tracking::rank_probabilities<double>(std::log(1 + snr), p);
        std::vector<int> count(static_cast<std::size_t>(m));
        for (int i = 0; i < scenes; ++i) {
            const double target = (1 + snr) * exponential(random);
            std::size_t rank = 0;
            for (int j = 1; j < m; ++j) rank += exponential(random) > target ? 1U : 0U;
            ++count[rank];
        }
        for (std::size_t l = 0; l < p.size(); ++l)
            worst = std::max(worst, std::abs(p[l] - static_cast<double>(count[l]) / scenes) /
                                        std::sqrt(p[l] * (1 - p[l]) / scenes));
    }
    return worst;
}

}  // namespace existence_scenes
