#include "host_sim/study_scenario.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>

#include "host_sim/json_fields.hpp"
#include "host_sim/random.hpp"

namespace sim {

namespace {

using Vec2 = tracking::Vec2<double>;

/// Clutter is drawn this far around the targets; farther away it could not reach a track worth keeping.
constexpr double kMargin_m = 10;
constexpr double kMargin_mps = 4;
/// A cell of the radar's map.
constexpr double kCell_m = 4.997;
constexpr double kCell_mps = 0.9505;

StudyMeasurement measurement(Vec2 z, const StudyCondition& condition, std::uint32_t targets) {
    StudyMeasurement m;
    m.value.z = z;
    m.value.variance = {condition.range_sigma_m * condition.range_sigma_m,
                        condition.rate_sigma_mps * condition.rate_sigma_mps};
    m.value.snr_db = 15;
    m.targets = targets;
    return m;
}

Vec2 own_truth(const StudyGeometry::Target& target, double time_s) {
    return {target.range_m + target.motion.distance_at(time_s), target.motion.speed_at(time_s)};
}

}  // namespace

StudyGeometry read_study_geometry(const std::filesystem::path& file) {
    const nlohmann::json json = read_json_file(file);
    JsonFields fields(json, file.string());
    StudyGeometry geometry;
    geometry.name = file.stem().string();
    geometry.description = fields.text("description");
    geometry.duration_s = fields.number("duration_s", {3, 600, "s"});
    for (JsonFields& item : fields.objects("targets")) {
        StudyGeometry::Target target;
        target.range_m = item.number("range_m", {0, 500, "m"});
        target.motion.speed_mps = item.number("range_rate_mps", {-100, 100, "m/s"});
        target.motion.acceleration_mps2 =
            item.pairs("acceleration_mps2", {0, geometry.duration_s, "s"}, {-20, 20, "m/s^2"});
        item.done();
        geometry.targets.push_back(target);
    }
    if (geometry.targets.empty() || geometry.targets.size() > tracking::kMaxConfirmed)
        fields.fail("targets", "1 to " + std::to_string(tracking::kMaxConfirmed) +
                                   " are possible, there are " + std::to_string(geometry.targets.size()));
    const auto last = static_cast<double>(geometry.targets.size());
    for (const auto& [a, b] : fields.pairs("pairs", {1, last, ""}, {1, last, ""})) {
        if (a == b || a != std::floor(a) || b != std::floor(b))
            fields.fail("pairs", "must be pairs of two different target numbers");
        geometry.pairs.emplace_back(static_cast<std::size_t>(a) - 1, static_cast<std::size_t>(b) - 1);
    }
    fields.done();
    return geometry;
}

Vec2 study_truth(const StudyGeometry& geometry, const StudyCondition& condition, std::size_t target,
                 double time_s) {
    const Vec2 own = own_truth(geometry.targets[target], time_s);
    for (const auto& [a, b] : geometry.pairs) {
        if (a != target && b != target) continue;
        const Vec2 mean =
            0.5 * (own_truth(geometry.targets[a], time_s) + own_truth(geometry.targets[b], time_s));
        return mean + condition.spacing * (own - mean);
    }
    return own;
}

StudyRun simulate_study_run(const StudyGeometry& geometry, const StudyCondition& condition,
                            std::uint64_t seed, std::uint64_t condition_index, std::uint64_t index) {
    Random random(seed, condition_index, index);
    StudyRun run;
    const std::size_t targets = geometry.targets.size();
    const auto frames = static_cast<std::size_t>(std::lround(geometry.duration_s / condition.period_s)) + 1;
    for (std::size_t frame = 0; frame < frames; ++frame) {
        std::vector<Vec2>& truth = run.truth.emplace_back();
        for (std::size_t t = 0; t < targets; ++t)
            truth.push_back(
                study_truth(geometry, condition, t, static_cast<double>(frame) * condition.period_s));
        if (frame == 0) continue;

        std::vector<StudyMeasurement>& list = run.frames.emplace_back();
        std::vector<Vec2> at;
        std::vector<std::uint32_t> of;
        for (std::size_t t = 0; t < targets; ++t) {
            // Drawn in any case, so that the other draws do not depend on what is detected.
            const bool detected = random.uniform() < condition.detection_probability;
            const double range_error = condition.range_sigma_m * random.gaussian();
            const double rate_error = condition.rate_sigma_mps * random.gaussian();
            if (!detected) continue;
            const Vec2 z(truth[t][0] + range_error, truth[t][1] + rate_error);
            if (condition.merging) {
                bool merged = false;
                for (std::size_t i = 0; i < at.size() && !merged; ++i) {
                    const auto other = static_cast<std::size_t>(std::countr_zero(of[i]));
                    merged = std::abs(truth[t][0] - truth[other][0]) < kCell_m &&
                             std::abs(truth[t][1] - truth[other][1]) < kCell_mps;
                    if (!merged) continue;
                    at[i] = 0.5 * (at[i] + z);
                    of[i] |= 1U << t;
                }
                if (merged) continue;
            }
            at.push_back(z);
            of.push_back(1U << t);
        }
        for (std::size_t i = 0; i < at.size(); ++i) list.push_back(measurement(at[i], condition, of[i]));

        Vec2 low = truth[0];
        Vec2 high = truth[0];
        for (const Vec2& x : truth) {
            low = low.cwiseMin(x);
            high = high.cwiseMax(x);
        }
        low -= Vec2(kMargin_m, kMargin_mps);
        high += Vec2(kMargin_m, kMargin_mps);
        const Vec2 size = high - low;
        const int clutter = random.poisson(condition.clutter_density * size[0] * size[1]);
        for (int i = 0; i < clutter; ++i) {
            const double range = low[0] + size[0] * random.uniform();
            const double rate = low[1] + size[1] * random.uniform();
            list.push_back(measurement({range, rate}, condition, 0));
        }
    }
    return run;
}

std::filesystem::path study_directory() {
    std::error_code none;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", none);
    const auto installed = program.parent_path().parent_path() / "share/fmcw_radar/studies";
    return std::filesystem::is_directory(installed, none) ? installed
                                                          : std::filesystem::path(RADAR_STUDY_DIR);
}

}  // namespace sim
