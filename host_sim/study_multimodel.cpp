#include "host_sim/study_multimodel.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <vector>

#include "host_sim/gnuplot.hpp"
#include "host_sim/random.hpp"
#include "host_sim/study_statistics.hpp"
#include "tracking/imm_pdaf.hpp"

namespace sim {

namespace {

using Vec2d = tracking::Vec2<double>;
using Vec4d = tracking::VecN<double, 4>;
using Mat4d = tracking::MatN<double, 4>;
using Mode = tracking::LinearMode<double, 4>;

constexpr const char* kName = "multimodel";
constexpr std::uint64_t kPurpose = 5;

// ---- scene

constexpr double kPeriod_s = 0.1;
constexpr std::size_t kFrames = 200;
constexpr double kHalfWidth_m = 100;
constexpr double kClutter_per_m2 = 1e-4;  // the paper's
constexpr double kDetection = 0.9;        // the paper's
constexpr double kGate = 16;

/// Longitudinal acceleration and turn rate from a time on.
struct Manoeuvre {
    double from_s = 1e9;
    double acceleration_mps2 = 0;
    double turn_radps = 0;
};
struct Vehicle {
    const char* name;
    Vec2d position;
    double heading_rad;
    double speed_mps;
    std::array<Manoeuvre, 5> manoeuvres;
};

const std::array<Vehicle, 4>& vehicles() {
    constexpr double kPi = std::numbers::pi;
    static const std::array<Vehicle, 4> all{
        {{"steady", {-90, -40}, 0, 9, {}},
         {"turns left", {-60, -80}, 0, 10, {{{5, 0, 0.4}, {5 + kPi / 2 / 0.4, 0, 0}}}},
         {"stops and goes", {80, 60}, kPi, 14, {{{4, -4, 0}, {7.5, 0, 0}, {11, 3, 0}, {15, 0, 0}}}},
         {"turns right, brakes",
          {20, 90},
          -kPi / 2,
          12,
          {{{4, -3, 0}, {6, 0, -0.5}, {6 + kPi, 0, 0}, {14, 4, 0}, {16, 0, 0}}}}}};
    return all;
}

std::vector<Vec4d> path_of(const Vehicle& vehicle) {
    std::vector<Vec4d> path;
    Vec2d position = vehicle.position;
    double heading = vehicle.heading_rad;
    double speed = vehicle.speed_mps;
    constexpr int kSteps = 20;
    constexpr double kStep_s = kPeriod_s / kSteps;
    for (std::size_t k = 0; k < kFrames; ++k) {
        path.emplace_back(position[0], position[1], speed * std::cos(heading), speed * std::sin(heading));
        for (int i = 0; i < kSteps; ++i) {
            const double time = kPeriod_s * static_cast<double>(k) + kStep_s * i;
            Manoeuvre now{0, 0, 0};
            for (const Manoeuvre& m : vehicle.manoeuvres)
                if (time >= m.from_s) now = m;
            heading += now.turn_radps * kStep_s;
            speed = std::max(0.0, speed + now.acceleration_mps2 * kStep_s);
            position += Vec2d(std::cos(heading), std::sin(heading)) * speed * kStep_s;
        }
    }
    return path;
}

struct Sensor {
    const char* name;
    Vec2d sigma_m;
};
const std::array<Sensor, 3>& sensors() {
    static const std::array<Sensor, 3> all{
        {{"laser", {0.3, 0.3}}, {"camera", {1.5, 0.4}}, {"infrastructure", {1, 1}}}};
    return all;
}

/// [frame][sensor]
using Scene = std::vector<std::array<std::vector<Vec2d>, 3>>;

Scene simulate(std::uint64_t seed, std::uint64_t run) {
    Random random(seed, kPurpose, run);
    std::vector<std::vector<Vec4d>> paths;
    for (const Vehicle& v : vehicles()) paths.push_back(path_of(v));
    Scene scene(kFrames);
    for (std::size_t k = 0; k < kFrames; ++k) {
        for (std::size_t s = 0; s < 3; ++s) {
            for (const auto& path : paths) {
                const Vec2d noise(sensors()[s].sigma_m[0] * random.gaussian(),
                                  sensors()[s].sigma_m[1] * random.gaussian());
                if (random.uniform() < kDetection) scene[k][s].emplace_back(path[k].head<2>() + noise);
            }
            for (int n = random.poisson(kClutter_per_m2 * 4 * kHalfWidth_m * kHalfWidth_m); n > 0; --n) {
                const double x = kHalfWidth_m * (2 * random.uniform() - 1);
                scene[k][s].emplace_back(x, kHalfWidth_m * (2 * random.uniform() - 1));
            }
        }
    }
    return scene;
}

// ---- filters

/// Coordinated turn at a known rate: linear. Noise as of constant velocity.
Mode turning(double rate_radps, double sigma_mps2) {
    Mode mode = tracking::constant_velocity<double, 2>(kPeriod_s, sigma_mps2);
    const double a = rate_radps * kPeriod_s;
    const double s = std::sin(a);
    const double c = std::cos(a);
    mode.transition << 1, 0, s / rate_radps, -(1 - c) / rate_radps,  //
        0, 1, (1 - c) / rate_radps, s / rate_radps,                  //
        0, 0, c, -s,                                                 //
        0, 0, s, c;
    return mode;
}

/// Modes change on average every 3 s, to any other alike.
template <std::size_t M>
tracking::ImmModel<double, 4, M> model_of(const std::array<Mode, M>& modes) {
    tracking::ImmModel<double, 4, M> model;
    model.mode = modes;
    const double stay = M == 1 ? 1 : 1 - kPeriod_s / 3;
    for (std::size_t i = 0; i < M; ++i)
        for (std::size_t j = 0; j < M; ++j)
            model.change[i][j] = i == j ? stay : (1 - stay) / static_cast<double>(M - 1);
    return model;
}

Mode steady(double sigma_mps2) {
    return tracking::constant_velocity<double, 2>(kPeriod_s, sigma_mps2);
}

constexpr std::size_t kKinds = 5;
constexpr std::array<const char*, kKinds> kKindNames{"PDAF, sigma 1", "PDAF, sigma 4", "IMM, sigma 1 and 2",
                                                     "IMM, sigma 1 and 8", "IMM, 1 and 8 and turns"};
constexpr std::array<std::size_t, 2> kSensorCounts{1, 3};
constexpr std::size_t kFilters = kKinds * kSensorCounts.size();

std::string filter_name(std::size_t filter) {
    return print("%s; %s", kKindNames[filter % kKinds], filter < kKinds ? "laser" : "three sensors");
}

struct Result {
    std::vector<std::vector<Vec4d>> estimate;            ///< [vehicle][frame]
    std::vector<std::vector<double>> first_probability;  ///< [vehicle][frame], of the first mode
};

template <std::size_t M>
Result run_modes(const std::array<Mode, M>& modes, std::size_t sensor_count, const Scene& scene) {
    const auto model = model_of<M>(modes);
    const double gate_probability = 1 - std::exp(-kGate / 2);
    const tracking::SensorLogs<double> logs{.detected = std::log(kDetection / kClutter_per_m2),
                                            .missed = std::log(1 - kDetection * gate_probability)};
    Result result;
    for (const Vehicle& vehicle : vehicles()) {
        const Vec4d start = path_of(vehicle)[0];
        Mat4d p = Mat4d::Zero();
        p.diagonal() << 0.09, 0.09, 1, 1;
        tracking::ImmState<double, 4, M> state;
        state.start(start, p);
        std::vector<Vec4d> estimate{start};
        std::vector<double> probability{state.probability[0]};
        for (std::size_t k = 1; k < kFrames; ++k) {
            predict(state, model);
            for (std::size_t s = 0; s < sensor_count; ++s) {
                const Vec2d sigma = sensors()[s].sigma_m;
                const Vec2d variance(sigma[0] * sigma[0], sigma[1] * sigma[1]);
                const auto all = combined(state);
                const tracking::Ldl<double> gate(tracking::innovation_covariance(
                    tracking::measured_covariance<double, 4>(all.covariance), variance));
                std::vector<std::pair<double, std::size_t>> near;
                for (std::size_t i = 0; i < scene[k][s].size(); ++i) {
                    const double distance2 = gate.distance2(scene[k][s][i] - all.x.template head<2>());
                    if (distance2 < kGate) near.emplace_back(distance2, i);
                }
                std::sort(near.begin(), near.end());
                if (near.size() > tracking::kMaxGated) near.resize(tracking::kMaxGated);
                std::vector<tracking::GatedMeasurement<double>> gated;
                for (const auto& [distance2, i] : near) gated.push_back({scene[k][s][i], variance});
                double existence = 1;
                tracking::pda_update<double, 4, M>(state, existence, gated, logs);
            }
            estimate.push_back(combined(state).x);
            probability.push_back(state.probability[0]);
        }
        result.estimate.push_back(estimate);
        result.first_probability.push_back(probability);
    }
    return result;
}

Result run_filter(std::size_t filter, const Scene& scene) {
    const std::size_t sensor_count = kSensorCounts[filter / kKinds];
    switch (filter % kKinds) {
        case 0:
            return run_modes<1>({steady(1)}, sensor_count, scene);
        case 1:
            return run_modes<1>({steady(4)}, sensor_count, scene);
        case 2:
            return run_modes<2>({steady(1), steady(2)}, sensor_count, scene);
        case 3:
            return run_modes<2>({steady(1), steady(8)}, sensor_count, scene);
        default:
            return run_modes<4>({steady(1), steady(8), turning(0.45, 1), turning(-0.45, 1)}, sensor_count,
                                scene);
    }
}

// ---- scores

constexpr double kLost_m = 5;
constexpr std::size_t kLostFrames = 10;

/// Of one filter in one run.
struct Score {
    std::vector<double> square;       ///< [frame], mean square position error of the vehicles kept
    std::vector<double> kept_square;  ///< [vehicle], mean over frames; NaN where lost
};

Score score_of(const Result& result) {
    Score score;
    const std::size_t count = vehicles().size();
    score.square.assign(kFrames, 0);
    std::size_t kept = 0;
    for (std::size_t v = 0; v < count; ++v) {
        const std::vector<Vec4d> path = path_of(vehicles()[v]);
        std::vector<double> square(kFrames);
        std::size_t far = 0;  // frames in a row
        bool lost = false;
        for (std::size_t k = 0; k < kFrames; ++k) {
            square[k] = (result.estimate[v][k] - path[k]).head<2>().squaredNorm();
            far = square[k] > kLost_m * kLost_m ? far + 1 : 0;
            lost = lost || far >= kLostFrames;
        }
        if (lost) {
            score.kept_square.push_back(std::nan(""));
            continue;
        }
        ++kept;
        double mean = 0;
        for (std::size_t k = 0; k < kFrames; ++k) {
            score.square[k] += square[k];
            mean += square[k] / kFrames;
        }
        score.kept_square.push_back(mean);
    }
    for (double& s : score.square) s = kept > 0 ? s / static_cast<double>(kept) : std::nan("");
    return score;
}

using Runs = std::vector<Score>;

double lost_percent(const Score& s) {
    const auto lost =
        std::count_if(s.kept_square.begin(), s.kept_square.end(), [](double v) { return std::isnan(v); });
    return 100 * static_cast<double>(lost) / static_cast<double>(s.kept_square.size());
}
double rms_at(const Runs& runs, std::size_t frame) {
    double sum = 0;
    double count = 0;
    for (const Score& s : runs) {
        if (std::isnan(s.square[frame])) continue;
        sum += s.square[frame];
        count += 1;
    }
    return std::sqrt(sum / count);
}
double rms_of(const Runs& runs, std::size_t vehicle) {
    double sum = 0;
    double count = 0;
    for (const Score& s : runs) {
        if (std::isnan(s.kept_square[vehicle])) continue;
        sum += s.kept_square[vehicle];
        count += 1;
    }
    return std::sqrt(sum / count);
}
/// By how much the second has less RMS error on vehicles both kept, percent.
Estimate improvement(const Runs& first, const Runs& second) {
    std::vector<ErrorPair> pairs;
    for (std::size_t r = 0; r < first.size(); ++r)
        for (std::size_t v = 0; v < first[r].kept_square.size(); ++v)
            if (!std::isnan(first[r].kept_square[v]) && !std::isnan(second[r].kept_square[v]))
                pairs.push_back({r, first[r].kept_square[v], second[r].kept_square[v]});
    const Estimate e = improvement_of(pairs, first.size());
    return {100 * e.value, 100 * e.low, 100 * e.high};
}
Estimate lost_of(const Runs& runs) {
    std::vector<double> values;
    for (const Score& s : runs) values.push_back(lost_percent(s));
    return mean_of(values);
}

struct Tables {
    std::string text;
    std::string csv;
    nlohmann::json json;
};

Tables make_tables(const std::vector<Runs>& runs) {
    Tables out;
    out.text = print(
        "%zu runs; four vehicles, %.0f s at %g s; clutter %g a square metre and sensor, PD %g; intervals are "
        "95 %%.\n"
        "Laser 0.3 m, camera 1.5 m by 0.4 m, infrastructure 1 m, one after another. A vehicle is lost when "
        "its track "
        "is more\nthan %g m off for a second. RMS position error in metres over tracks "
        "kept.\n\n%-38s%20s",
        runs[0].size(), kPeriod_s * kFrames, kPeriod_s, kClutter_per_m2, kDetection, kLost_m, "", "lost %");
    for (const Vehicle& v : vehicles()) out.text += print("%21s", v.name);
    out.text += "\n";
    out.csv = "filter,sensors,time_s,rms_m\n";
    out.json["study"] = kName;
    out.json["runs"] = runs[0].size();
    for (std::size_t f = 0; f < kFilters; ++f) {
        const Estimate lost = lost_of(runs[f]);
        out.text +=
            print("%-38s%7.2f (%4.2f..%5.2f)", filter_name(f).c_str(), lost.value, lost.low, lost.high);
        nlohmann::json filter;
        filter["filter"] = filter_name(f);
        filter["lost_percent"] = {lost.value, lost.low, lost.high};
        for (std::size_t v = 0; v < vehicles().size(); ++v) {
            const double rms = rms_of(runs[f], v);
            out.text += std::isnan(rms) ? print("%21s", "all lost") : print("%21.3f", rms);
            if (!std::isnan(rms)) filter["rms_m"][vehicles()[v].name] = rms;
        }
        out.text += "\n";
        out.json["filters"].push_back(filter);
        for (std::size_t k = 0; k < kFrames; ++k)
            out.csv += print("\"%s\",%zu,%.1f,%.6g\n", kKindNames[f % kKinds], kSensorCounts[f / kKinds],
                             kPeriod_s * static_cast<double>(k), rms_at(runs[f], k));
    }
    out.text += "\nClaims: fewer vehicles lost, and less RMS error on those that both keep\n";
    const auto state = [&](const std::string& what, const char* unit, const Estimate& e) {
        const char* verdict = verdict_above(e);
        out.text += claim_line(what, 86, e, unit, verdict);
        out.json["claims"].push_back(claim_json("claim", what, e, verdict));
    };
    const auto claim = [&](const std::string& what, std::size_t first, std::size_t second) {
        state(what + ": error", "%", improvement(runs[first], runs[second]));
        std::vector<double> fewer;
        for (std::size_t r = 0; r < runs[first].size(); ++r)
            fewer.push_back(lost_percent(runs[first][r]) - lost_percent(runs[second][r]));
        const Estimate e = mean_of(fewer);
        if (e.value != 0) state(what + ": lost", "points", e);
    };
    for (const std::size_t s : {std::size_t{0}, kKinds}) {
        const char* where = s == 0 ? "laser" : "three sensors";
        claim(print("IMM-PDAF (1 and 8) than PDAF of sigma 1, %s", where), s, s + 3);
        claim(print("IMM-PDAF (1 and 8) than PDAF of sigma 4, %s", where), s + 1, s + 3);
        claim(print("IMM of unlike modes (1 and 8) than of like ones (1 and 2), %s", where), s + 2, s + 3);
        claim(print("IMM with turns than with straight modes only (1 and 8), %s", where), s + 3, s + 4);
    }
    for (std::size_t kind = 0; kind < kKinds; ++kind)
        claim(print("three sensors than the laser alone, %s", kKindNames[kind]), kind, kKinds + kind);
    return out;
}

/// The paper: work grows with sensors x models x targets.
std::string cost_table(std::uint64_t seed) {
    const Scene scene = simulate(seed, 0);
    std::string out = "\nMicroseconds a frame and vehicle on this machine (best of 5)\n";
    for (std::size_t f = 0; f < kFilters; ++f) {
        const double best = best_of(5, [&] {
            const double before = cpu_ms();
            static_cast<void>(run_filter(f, scene));
            return cpu_ms() - before;
        });
        out += print("  %-38s%8.2f\n", filter_name(f).c_str(),
                     1e3 * best / kFrames / static_cast<double>(vehicles().size()));
    }
    return out;
}

void draw(const std::filesystem::path& directory, const std::vector<Runs>& runs, std::uint64_t seed) {
    std::ostringstream rms;
    for (std::size_t k = 0; k < kFrames; ++k) {
        rms << kPeriod_s * static_cast<double>(k);
        for (std::size_t f = 0; f < kFilters; ++f) rms << ' ' << rms_at(runs[f], k);
        rms << '\n';
    }
    write_text(directory / "fig03_rms.dat", rms.str());
    std::ostringstream gp;
    gp << "set grid lc rgb '#dddddd'\nset key outside top right\nset xlabel 'time / s'\nset ylabel 'RMS "
          "position error of "
          "vehicles kept / m'\nset yrange [0:*]\nset multiplot layout 2,1 title 'Turning, stopping and going "
          "in clutter'\n";
    for (std::size_t s = 0; s < kSensorCounts.size(); ++s) {
        gp << "set title '" << (s == 0 ? "laser alone" : "laser, camera and infrastructure") << "'\nplot ";
        for (std::size_t kind = 0; kind < kKinds; ++kind)
            gp << (kind > 0 ? ", " : "") << "'fig03_rms.dat' using 1:" << 2 + s * kKinds + kind
               << " with lines lw 2 title '" << kKindNames[kind] << "'";
        gp << '\n';
    }
    gp << "unset multiplot\n";
    run_gnuplot(directory, "fig03_rms", gp.str());

    const Scene scene = simulate(seed, 0);
    const Result result = run_filter(kFilters - 1, scene);
    std::ostringstream points;
    std::ostringstream lines;
    std::ostringstream truth;
    std::ostringstream modes;
    for (const auto& frame : scene)
        for (const Vec2d& z : frame[0]) points << z[0] << ' ' << z[1] << '\n';
    for (std::size_t v = 0; v < vehicles().size(); ++v, lines << '\n', truth << '\n') {
        const auto path = path_of(vehicles()[v]);
        for (std::size_t k = 0; k < kFrames; ++k) {
            lines << result.estimate[v][k][0] << ' ' << result.estimate[v][k][1] << '\n';
            truth << path[k][0] << ' ' << path[k][1] << '\n';
        }
    }
    for (std::size_t k = 0; k < kFrames; ++k) {
        modes << kPeriod_s * static_cast<double>(k);
        for (std::size_t v = 0; v < vehicles().size(); ++v) modes << ' ' << result.first_probability[v][k];
        modes << '\n';
    }
    write_text(directory / "fig04_measurements.dat", points.str());
    write_text(directory / "fig04_tracks.dat", lines.str());
    write_text(directory / "fig04_truth.dat", truth.str());
    write_text(directory / "modes.dat", modes.str());
    run_gnuplot(
        directory, "fig04_tracks",
        "set title 'Laser measurements and tracks of the first run, IMM-PDAF with three sensors'\nset size "
        "ratio "
        "-1\nset grid lc rgb '#dddddd'\nset xlabel 'x / m'\nset ylabel 'y / m'\nset key outside top right\n"
        "plot 'fig04_measurements.dat' with points pt 7 ps 0.25 lc rgb '#c0c0c0' title 'measurements', "
        "'fig04_truth.dat' with lines lw 3 lc rgb '#000000' title 'vehicles', "
        "'fig04_tracks.dat' with lines lw 1.5 lc rgb '#d62728' title 'tracks'\n");
    std::ostringstream picture;
    picture << "set grid lc rgb '#dddddd'\nset key outside top right\nset xlabel 'time / s'\nset yrange "
               "[0:1]\nset ylabel "
               "'probability of steady motion'\nset title 'Mode of the first run, IMM-PDAF with three "
               "sensors'\nplot ";
    for (std::size_t v = 0; v < vehicles().size(); ++v)
        picture << (v > 0 ? ", " : "") << "'modes.dat' using 1:" << v + 2 << " with lines lw 2 title '"
                << vehicles()[v].name << "'";
    run_gnuplot(directory, "modes", picture.str() + "\n");
}

}  // namespace

void run_multimodel(const StudyOptions& options, const StudyRanks& ranks) {
    if (options.pictures && ranks.self().rank == 0) require_gnuplot();
    StudyWork work;
    work.name = kName;
    work.configuration = print("%s seed %llu, 1", kName, static_cast<unsigned long long>(options.seed));
    work.units = options.runs;
    work.run = [&](std::size_t unit) {
        const Scene scene = simulate(options.seed, unit);
        std::vector<double> out;
        for (std::size_t f = 0; f < kFilters; ++f) {
            const Score score = score_of(run_filter(f, scene));
            out.insert(out.end(), score.square.begin(), score.square.end());
            out.insert(out.end(), score.kept_square.begin(), score.kept_square.end());
        }
        return out;
    };
    const auto units = run_study_units(work, options.run, ranks);
    if (ranks.self().rank != 0) return;

    std::vector<Runs> runs(kFilters);
    for (const std::vector<double>& unit : units) {
        auto in = unit.begin();
        for (std::size_t f = 0; f < kFilters; ++f) {
            Score score;
            score.square.assign(in, in + kFrames);
            in += kFrames;
            const auto count = static_cast<std::ptrdiff_t>(vehicles().size());
            score.kept_square.assign(in, in + count);
            in += count;
            runs[f].push_back(score);
        }
    }
    const auto& directory = options.run.directory;
    const Tables tables = make_tables(runs);
    const std::string cost = cost_table(options.seed);
    std::printf("%s%s", tables.text.c_str(), cost.c_str());
    write_text(directory / "multimodel.txt", tables.text);
    write_text(directory / "multimodel_cost.txt", cost);
    write_text(directory / "multimodel.csv", tables.csv);
    write_text(directory / "multimodel.json", tables.json.dump(1) + "\n");
    if (options.pictures) draw(directory, runs, options.seed);
    std::printf("\nTables, CSV, JSON and pictures are in %s\n", directory.c_str());
}

}  // namespace sim
