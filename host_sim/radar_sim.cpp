// The firmware on a PC, in a simulated or recorded world. Parses, runs, prints; everything else is in the
// library.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "host_sim/hil.hpp"
#include "host_sim/live_view.hpp"
#include "host_sim/plots.hpp"
#include "host_sim/simulation.hpp"
#include "host_sim/summary.hpp"

namespace {

constexpr const char* kAbout =
    "Runs the radar firmware against synthetic or recorded beat signals, shows its tracks, and compares them "
    "with the "
    "truth.\n";

constexpr const char* kFooter = R"(
Examples:
  radar_sim --scenario four-targets --plot out --log out/can.log
  radar_sim --scenario highway --tracker jpda --seed 7 --json result.json
  radar_sim --scenario approach --can vcan0 --realtime        (candump vcan0, or radar_monitor vcan0, in another terminal)
  radar_sim --hil /dev/ttyUSB1 --can can0 --scenario approach (beat frames to a board; its CAN frames compared with the PC's)
  radar_sim --replay frames.bin --waveform waveform.json
  radar_sim --traffic traffic.csv --ego ego.csv --plot out

Files:
  scenario  JSON; the shipped ones are listed by --list-scenarios and lie in
            )";

constexpr const char* kFormats = R"(
  frames    .bin, little-endian int16 [frame][chirp 0..63][sample 0..63], 8192 bytes a frame
  waveform  JSON object with any of carrier_hz, bandwidth_hz, sample_rate_hz, chirp_interval_ns, range_offset_um, period_ms
  traffic   CSV with columns time_s, track_id, range_m, range_rate_mps
  ego       CSV with columns time_s, speed_mps
  detections  CSV with columns frame, range_m, range_rate_mps, snr_db

Exit status: 0 the run went to its end; 1 wrong usage, bad input or a file that cannot be read or written;
2 with --hil: the board's CAN frames differ from the PC's, or it did not process every frame.)";

void list_scenarios() {
    for (const auto& name : sim::shipped_scenarios())
        std::printf("%-14s %s\n", name.c_str(), sim::load_scenario(name).description.c_str());
}

std::string tracker_names() {
    std::string names;
    for (const auto name : tracking::kAssociatorNames)
        names += (names.empty() ? "" : ", ") + std::string(name);
    return names + "; ijipda:L for iterative JIPDA of level L, 0 to " + std::to_string(tracking::kMaxLevel);
}

struct Arguments {
    sim::SimulationOptions options;
    std::string scenario;
    std::string waveform;
    std::string tracker = "ospda";
    std::int64_t frames = 0;
    std::string json;
    std::string plot;
    bool realtime = false;
    bool list = false;
    sim::HilOptions hil;
    int patience_s = 3;
};

void resolve(Arguments& a, bool frames_given) {
    sim::SimulationOptions& o = a.options;
    if (const auto choice = tracking::associator_chosen(a.tracker)) {
        o.tracker = choice->associator;
        o.tracker_level = choice->level;
    } else {
        throw sim::InputError("--tracker: no tracker named \"" + a.tracker + "\"; known: " + tracker_names());
    }
    if (frames_given) {
        if (a.frames < 1)
            throw sim::InputError("--frames: must be at least 1, is " + std::to_string(a.frames));
        o.frames = static_cast<std::uint64_t>(a.frames);
    }
    if (a.realtime) o.speed = 1;
    if (!a.scenario.empty()) o.scenario = sim::load_scenario(a.scenario);
    if (!a.waveform.empty()) o.waveform = sim::read_waveform(a.waveform);
    a.hil.patience = std::chrono::seconds(a.patience_s);
}

/// Created before the run, so that a path that cannot be written costs no run.
std::ofstream create_json(const Arguments& a) {
    std::ofstream file;
    if (!a.json.empty()) {
        file.open(a.json);
        if (!file) throw sim::InputError(a.json + ": cannot be created");
    }
    return file;
}

void write_json(const Arguments& a, std::ofstream& file, const nlohmann::json& json) {
    file << json.dump(2) << '\n';
    if (!file.flush()) throw sim::InputError(a.json + ": cannot be written, is the disk full?");
    if (!a.options.quiet) std::printf("wrote %s\n", a.json.c_str());
}

/// A board in place of the firmware in this process.
int run_board(const Arguments& a) {
    std::ofstream json = create_json(a);
    std::uint64_t shown = 0;
    std::size_t told = 0;
    const sim::HilReport report = sim::run_hil(a.options, a.hil, [&](const sim::HilReport& r) {
        for (; told < r.differences.size(); ++told)
            std::printf("different: %s\n", r.differences[told].c_str());
        if (a.options.quiet || r.board.lists < shown + 10) return;
        shown = r.board.lists;
        std::printf("frame %llu: %llu lists, %llu CAN frames compared, %llu lists different\n",
                    static_cast<unsigned long long>(r.frames_sent),
                    static_cast<unsigned long long>(r.board.lists),
                    static_cast<unsigned long long>(r.board.can_frames),
                    static_cast<unsigned long long>(r.board.different));
        std::fflush(stdout);
    });
    std::fputs(sim::to_text(report).c_str(), stdout);
    if (json.is_open()) write_json(a, json, sim::to_json(report));
    return report.identical() ? 0 : 2;
}

int run(const Arguments& a) {
    if (!a.hil.serial.empty()) return run_board(a);
    sim::Simulation simulation(a.options);
    std::optional<sim::Plots> plots;
    if (!a.plot.empty()) {
        const std::string title = simulation.result().scenario + ", " + a.tracker;
        plots.emplace(a.plot, title, simulation.waveform(), simulation.frames());
    }
    std::ofstream json;
    if (!a.json.empty()) {
        json.open(a.json);
        if (!json) throw sim::InputError(a.json + ": cannot be created");
    }
    std::optional<sim::LiveView> live;
    if (!a.options.quiet) live.emplace(stdout, simulation.frames());

    const auto start = std::chrono::steady_clock::now();
    while (simulation.step()) {
        if (live) live->show(simulation.view());
        if (plots) plots->add(simulation.view());
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    const sim::SimulationResult result = simulation.result();
    if (live && result.frames > 0) live->finish(simulation.view());
    if (!a.options.quiet) {
        const double simulated_s =
            static_cast<double>(result.frames) * simulation.waveform().period_ms / 1000;
        std::fputs(sim::to_text(result, simulated_s, took.count()).c_str(), stdout);
        for (const auto* file : {&a.options.log, &a.options.record})
            if (!file->empty()) std::printf("wrote %s\n", file->c_str());
    }
    if (plots) {
        for (const auto& picture : plots->draw())
            if (!a.options.quiet) std::printf("wrote %s\n", picture.c_str());
    }
    if (json.is_open()) write_json(a, json, sim::to_json(result));
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    Arguments a;
    sim::SimulationOptions& o = a.options;
    CLI::App app(kAbout);
    app.footer(kFooter + sim::scenario_directory().string() + kFormats);
    app.get_formatter()->column_width(26);

    auto* scenario =
        app.add_option("--scenario", a.scenario, "name of a shipped scenario, or a file that ends in .json");
    auto* replay = app.add_option("--replay", o.replay, "recorded beat frames in place of a scenario");
    auto* traffic = app.add_option("--traffic", o.traffic,
                                   "recorded motion to synthesise beat signals from, RCS 10 dBsm each");
    auto* detections =
        app.add_option("--detections", o.detections, "detections that bypass the signal processing");
    auto* list = app.add_flag("--list-scenarios", a.list, "list the shipped scenarios and end");
    auto* waveform =
        app.add_option("--waveform", a.waveform, "of the recording; the standard one if not given");
    app.add_option("--ego", o.ego, "own speed for a recording; not given, the radar is told none");
    auto* frames = app.add_option("--frames", a.frames, "stop after so many frames of 0.1 s");
    app.add_option("--seed", o.seed, "of noise, fluctuation and clutter")->capture_default_str();
    auto* tracker =
        app.add_option("--tracker", a.tracker, "data association: " + tracker_names())->capture_default_str();
    auto* nonparametric =
        app.add_flag("--nonparametric", o.nonparametric,
                     "clutter density from the measurements in each track's gate; else known, "
                     "raised where detections keep being nobody's");
    app.add_option("--can", o.bus, "CAN interface, or loopback: a bus inside this program")
        ->capture_default_str();
    app.add_option("--log", o.log, "write all CAN traffic, in the format of candump -L");
    auto* record = app.add_option("--record", o.record, "write the beat frames");
    app.add_option("--json", a.json, "write the summary");
    auto* plot = app.add_option("--plot", a.plot, "directory for pictures of the run (needs gnuplot)");
    auto* realtime = app.add_flag("--realtime", a.realtime, "one second a second; else as fast as possible");
    auto* speed = app.add_option("--speed", o.speed, "so many seconds in one second")
                      ->check(CLI::PositiveNumber)
                      ->excludes(realtime);
    auto* hil =
        app.add_option("--hil", a.hil.serial,
                       "a board that runs the firmware: serial line to send it beat frames on; --can names "
                       "the bus it is on")
            ->excludes(detections);
    auto* lockstep = app.add_flag(
        "--lockstep", a.hil.lockstep,
        "with --hil: the next frame after the last CAN frame of the one before; else in real time");
    lockstep->needs(hil);
    auto* patience =
        app.add_option("--patience", a.patience_s,
                       "with --hil: seconds the board may say nothing or leave a frame unanswered; "
                       "more for an emulated board on a busy machine");
    patience->check(CLI::Range(1, 600))->capture_default_str();
    patience->needs(hil);
    app.add_flag("--quiet", o.quiet, "no output but errors");
    for (auto* input : {scenario, replay, traffic, detections}) {
        for (auto* other : {scenario, replay, traffic, detections, list})
            if (input != other) input->excludes(other);
    }
    waveform->excludes(scenario);
    for (auto* other : {tracker, nonparametric, record, plot, realtime, speed, list}) hil->excludes(other);

    try {
        app.parse(argc, argv);
        if (a.list) {
            list_scenarios();
            return 0;
        }
        if (a.scenario.empty() && o.replay.empty() && o.traffic.empty() && o.detections.empty())
            throw sim::InputError(
                "nothing to do: give --scenario, --replay, --traffic or --detections, or see --help");
        resolve(a, !frames->empty());
        return run(a);
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "radar_sim: %s\n", e.what());
        return 1;
    }
}
