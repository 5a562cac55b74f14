#include "tests/bench/accuracy_sim.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <string>

#include "dsp/detect.hpp"
#include "hal/host/frame_file_source.hpp"
#include "tests/host_sim/quiet_run.hpp"
#include "tracking/tracker.hpp"

namespace bench {

namespace {

using dsp::Real;
using sim_test::quiet;
using sim_test::simulate;

double number(Real v) {
    return tracking::scalar_from<double>(v);
}

template <class S>
std::vector<tracking::Measurement<S>> measurements_of(const dsp::DetectionList& detections) {
    std::vector<tracking::Measurement<S>> list;
    for (const dsp::Detection& d : detections.view()) {
        auto& m = list.emplace_back();
        m.z = {tracking::scalar_from<S>(d.range_m), tracking::scalar_from<S>(d.range_rate_mps)};
        m.variance = {tracking::scalar_from<S>(d.range_variance_m2),
                      tracking::scalar_from<S>(d.rate_variance_m2ps2)};
        m.snr_db = tracking::scalar_from<S>(d.snr_db);
    }
    return list;
}

std::vector<sim::TrackEstimate> confirmed(std::span<const tracking::Track<Real>> tracks) {
    std::vector<sim::TrackEstimate> list;
    for (const auto& t : tracks)
        if (t.is_confirmed()) list.push_back({t.id, number(t.x[0]), number(t.x[1])});
    return list;
}

bool absent(const std::filesystem::path& file, const char* what) {
    if (std::filesystem::exists(file)) return false;
    std::printf("SKIPPED: %s: no %s\n", what, file.c_str());
    return true;
}

}  // namespace

std::vector<Row> four_targets(int seeds) {
    double confirmation_s = 0;
    double range_rmse_m = 0;
    double rate_rmse_mps = 0;
    int lost = 0;
    int switches = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
        const auto m = simulate(quiet("four-targets", {}, static_cast<std::uint64_t>(seed))).metrics;
        if (m.targets != 4 || m.never_confirmed > 0) confirmation_s = std::numeric_limits<double>::infinity();
        confirmation_s = std::max(confirmation_s, m.first_confirmation_s.value_or(0));
        range_rmse_m = std::max(range_rmse_m, m.range_rmse_m);
        rate_rmse_mps = std::max(rate_rmse_mps, m.velocity_rmse_mps);
        lost += m.track_losses;
        switches += m.id_switches;
    }
    const std::string what = "four-targets, " + std::to_string(seeds) + " seeds: ";
    return {{what + "longest wait for a confirmed track", confirmation_s, 0.6, false, "s"},
            {what + "tracks lost", static_cast<double>(lost), 0, false, ""},
            {what + "identity switches that last", static_cast<double>(switches), 0, false, ""},
            {what + "range RMSE, worst seed", range_rmse_m, 0.6, false, "m"},
            {what + "range rate RMSE, worst seed", rate_rmse_mps, 0.2, false, "m/s"}};
}

std::vector<Row> empty_road(double hours) {
    auto o = quiet("empty");
    o.scenario->duration_s = hours * 3600;
    const auto m = simulate(o).metrics;
    std::ostringstream what;
    what << "empty road, " << hours << " h simulated: false confirmed tracks";
    return {{what.str(), static_cast<double>(m.false_tracks), std::max(1.0, std::floor(hours)), false, ""}};
}

std::vector<Row> walking_person(const std::filesystem::path& data) {
    const auto frames = data / "openradar_77ghz/simple_gate64_slide.bin";
    const auto reference_file = data / "openradar_77ghz/reference.csv";
    if (absent(frames, "walking person") || absent(reference_file, "walking person")) return {};

    struct Place {
        double range_bin;
        double doppler_bin;
    };
    std::map<int, std::vector<Place>> reference;  // by frame, strongest first
    std::ifstream in(reference_file);
    for (std::string line; std::getline(in, line);) {
        std::vector<std::string> cells;
        std::istringstream row(line);
        for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
        if (cells.size() < 9 || cells[0] != "simple_gate64_slide.bin") continue;
        reference[std::stoi(cells[1])].push_back({std::stod(cells[8]), std::stod(cells[5])});
    }

    dsp::Waveform waveform;
    waveform.carrier_hz = 78'956'000'000;
    waveform.bandwidth_hz = 3'072'000'000;
    waveform.sample_rate_hz = 1'250'000;
    waveform.chirp_interval_ns = 184'000;
    waveform.range_offset_um = 1'171'064;
    waveform.period_ms = 12;
    firmware::RadarConfig config = sim::radar_config(waveform, 16, tracking::Associator::ospda);
    config.tracker.motion.period_s = Real::ratio(736, 1'000'000);
    // Nobody in the room walks faster than the waveform can tell: no ambiguities to look for.
    config.tracker.max_start_rate_mps = config.tracker.gate.rate_span_mps * Real::ratio(1, 2);
    config.tracker.min_start_rate_mps = -config.tracker.max_start_rate_mps;
    tracking::Tracker<Real> tracker(config.tracker);
    dsp::Workspace workspace;
    dsp::DetectionList detections;
    const dsp::CellScale cell = waveform.scale();

    hal::FrameFileSource source(frames);
    dsp::BeatFrame frame;
    std::uint32_t index = 0;
    int detected = 0;
    std::set<int> tracks_of_person;
    const auto is_near = [&](Real range, Real rate, const Place& place, double cells) {
        const double range_bin =
            (number(range) + number(cell.coupling_s * rate) - number(cell.range_offset_m)) /
            number(cell.range_cell_m);
        return std::fabs(range_bin - place.range_bin) <= cells &&
               std::fabs(number(rate) / number(cell.rate_cell_mps) - place.doppler_bin) <= cells;
    };
    while (source.acquire(frame, index) == hal::BeatResult::ok) {
        const auto& places = reference[static_cast<int>(index)];
        dsp::detect(frame, config.dsp, cell, workspace, detections);
        tracker.step(measurements_of<Real>(detections));
        const auto near_person = [&](Real range, Real rate, double cells) {
            return std::any_of(places.begin(),
                               places.begin() + std::min<std::ptrdiff_t>(2, std::ssize(places)),
                               [&](const Place& p) { return is_near(range, rate, p, cells); });
        };
        const auto found = detections.view();
        if (std::any_of(found.begin(), found.end(),
                        [&](const dsp::Detection& d) { return near_person(d.range_m, d.range_rate_mps, 1); }))
            ++detected;
        for (const auto& t : tracker.tracks())
            if (t.is_confirmed() && !places.empty() && is_near(t.x[0], t.x[1], places[0], 2))
                tracks_of_person.insert(t.id);
    }
    std::printf(
        "walking person: %d confirmed tracks of the person, %zu tracks in the room with its furniture\n",
        static_cast<int>(tracks_of_person.size()), tracker.tracks().size());
    return {{"walking person: frames detected within 1 cell of the reference",
             100.0 * detected / static_cast<double>(source.frames()), 90, true, "%"},
            {"walking person: confirmed tracks of it, off from one",
             std::fabs(static_cast<double>(tracks_of_person.size()) - 1), 0, false, ""}};
}

std::vector<Row> recorded_traffic(const std::filesystem::path& data) {
    sim::SimulationOptions o;
    o.traffic = data / "comma2k19_highway/traffic_30s.csv";
    o.ego = data / "comma2k19_highway/ego_speed_30s.csv";
    o.quiet = true;
    if (absent(o.traffic, "recorded traffic") || absent(o.ego, "recorded traffic")) return {};

    const dsp::Waveform waveform;
    const double range_cell = static_cast<double>(waveform.range_cell_um()) * 1e-6;
    const double rate_cell = static_cast<double>(waveform.rate_cell_umps()) * 1e-6;
    sim::Simulation simulation(o);
    sim::Metrics matcher;
    std::map<int, double> first_seen_s;
    int apart = 0;
    int apart_tracked = 0;
    int close = 0;
    int close_tracked = 0;
    while (simulation.step()) {
        const sim::CycleView view = simulation.view();
        const auto tracks = confirmed(view.radar.tracks());
        const auto match = matcher.match(view.truth, tracks);
        for (std::size_t i = 0; i < view.truth.size(); ++i) {
            const sim::TruthObject& t = view.truth[i];
            if (t.range_m > 160 || std::fabs(t.range_rate_mps) > 30.4) continue;
            const double since = view.time_s - first_seen_s.try_emplace(t.id, view.time_s).first->second;
            if (since <= 1) continue;
            const bool is_apart =
                std::none_of(view.truth.begin(), view.truth.end(), [&](const sim::TruthObject& other) {
                    return other.id != t.id && std::fabs(other.range_m - t.range_m) < 2 * range_cell &&
                           std::fabs(other.range_rate_mps - t.range_rate_mps) < 2 * rate_cell;
                });
            const bool tracked = match.track_of_truth[i] >= 0;
            ++(is_apart ? apart : close);
            if (tracked) ++(is_apart ? apart_tracked : close_tracked);
        }
    }
    const auto m = simulation.result().metrics;
    std::printf(
        "recorded traffic: %d object frames two cells apart; nearer ones: tracked in %d of %d; false "
        "tracks %d of %d "
        "confirmed; losses %d, identity switches %d; range RMSE %.3f m, range rate %.3f m/s\n",
        apart, close_tracked, close, m.false_tracks, m.confirmed_tracks, m.track_losses, m.id_switches,
        m.range_rmse_m, m.velocity_rmse_mps);
    return {{"recorded traffic, objects two cells apart: tracked after their first second",
             apart > 0 ? 100.0 * apart_tracked / apart : std::numeric_limits<double>::quiet_NaN(), 90, true,
             "%"}};
}

namespace {

/// The radar's configuration for a simulated run, in double.
tracking::TrackerConfig<double> as_double(const tracking::TrackerConfig<Real>& fixed) {
    tracking::TrackerConfig<double> config;
    config.associator = fixed.associator;
    config.motion.period_s = number(fixed.motion.period_s);
    config.modes.period_s = number(fixed.modes.period_s);
    config.gate.rate_span_mps = number(fixed.gate.rate_span_mps);
    config.gate.alias_range_m = number(fixed.gate.alias_range_m);
    config.resolution_range_m = number(fixed.resolution_range_m);
    config.resolution_rate_mps = number(fixed.resolution_rate_mps);
    config.max_range_m = number(fixed.max_range_m);
    return config;
}

struct Recording {
    tracking::TrackerConfig<Real> config;
    std::vector<std::vector<tracking::Measurement<Real>>> frames;
};

/// What the signal processing detects in every scenario, for all trackers the same.
std::vector<Recording> detections_of_scenarios() {
    std::vector<Recording> recordings;
    for (const std::string& name : sim::shipped_scenarios()) {
        sim::Simulation simulation(quiet(name, 600));
        Recording& recording = recordings.emplace_back();
        recording.config = simulation.view().radar.config().tracker;
        while (simulation.step())
            recording.frames.push_back(measurements_of<Real>(simulation.view().radar.detections()));
    }
    return recordings;
}

std::vector<tracking::Measurement<double>> as_double(const std::vector<tracking::Measurement<Real>>& fixed) {
    std::vector<tracking::Measurement<double>> list;
    for (const auto& m : fixed)
        list.push_back({{number(m.z[0]), number(m.z[1])},
                        {number(m.variance[0]), number(m.variance[1])},
                        number(m.snr_db)});
    return list;
}

}  // namespace

std::vector<Row> fixed_against_double() {
    const std::vector<Recording> recordings = detections_of_scenarios();
    std::vector<Row> rows;
    for (std::size_t a = 0; a < tracking::kAssociatorNames.size(); ++a) {
        const auto associator = static_cast<tracking::Associator>(a);
        double worst_range_m = 0;
        double worst_rate_mps = 0;
        int frames = 0;
        int equal = 0;
        for (const Recording& recording : recordings) {
            auto config = recording.config;
            config.associator = associator;
            tracking::Tracker<Real> tracker(config);
            tracking::Tracker<double> reference(as_double(config));
            for (const auto& measurements : recording.frames) {
                tracker.step(measurements);
                reference.step(as_double(measurements));
                ++frames;
                const auto fixed = tracker.tracks();
                const auto exact = reference.tracks();
                if (!std::equal(
                        fixed.begin(), fixed.end(), exact.begin(), exact.end(),
                        [](const auto& f, const auto& e) { return f.id == e.id && f.state == e.state; })) {
                    // A measurement at the very edge of a gate is in for one and out for the other. What
                    // follows are two histories, which no arithmetic makes equal: both begin anew.
                    tracker = tracking::Tracker<Real>(config);
                    reference = tracking::Tracker<double>(as_double(config));
                    continue;
                }
                ++equal;
                for (std::size_t i = 0; i < fixed.size(); ++i) {
                    worst_range_m = std::max(worst_range_m, std::fabs(number(fixed[i].x[0]) - exact[i].x[0]));
                    worst_rate_mps =
                        std::max(worst_rate_mps, std::fabs(number(fixed[i].x[1]) - exact[i].x[1]));
                }
            }
        }
        const std::string what =
            "fixed against double, all scenarios, " + std::string(name_of(associator)) + ": ";
        if (a == 0)
            rows.push_back({"fixed against double, all scenarios: frames", 1.0 * frames, 2000, true, ""});
        rows.push_back({what + "equal ids and states", 100.0 * equal / frames, 99.9, true, "%"});
        rows.push_back({what + "range", worst_range_m, 0.05, false, "m"});
        rows.push_back({what + "range rate", worst_rate_mps, 0.02, false, "m/s"});
    }
    return rows;
}

std::vector<Row> speed() {
    const auto o = quiet("four-targets");
    const auto start = std::chrono::steady_clock::now();
    const auto result = simulate(o);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    return {{"four-targets, synthesis included: times real time on one core",
             static_cast<double>(result.frames) * 0.1 / took.count(), 20, true, "x"}};
}

std::vector<Row> accuracy_sim(const std::filesystem::path& data) {
    std::vector<Row> rows;
    for (const auto& part : {four_targets(), empty_road(), walking_person(data), recorded_traffic(data),
                             fixed_against_double(), speed()})
        rows.insert(rows.end(), part.begin(), part.end());
    return rows;
}

}  // namespace bench
