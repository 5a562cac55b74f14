/// radar_monitor: the other end of the bus.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include <unistd.h>

#include "hal/host/candump_log.hpp"
#include "hal/host/real_clock.hpp"
#include "hal/host/socket_can.hpp"
#include "host_sim/bus_monitor.hpp"
#include "host_sim/dbc_writer.hpp"
#include "host_sim/monitor_view.hpp"

namespace {

enum ExitCode : int { kClean = 0, kUsage = 1, kErrorsSeen = 2 };

struct Options {
    std::string source;
    std::string json;
    std::string dbc;
    int bus_load_objects = -1;
    std::uint64_t frames = std::numeric_limits<std::uint64_t>::max();
    double duration_s = 1e9;
    bool quiet = false;

    std::uint64_t duration_us() const { return static_cast<std::uint64_t>(duration_s * 1e6); }
};

volatile std::sig_atomic_t stop_requested = 0;

int refuse(const std::string& reason) {
    std::cerr << "radar_monitor: " << reason << '\n';
    return kUsage;
}

/// Shows what is new: a table that stays in its place on a terminal, else a line a list.
class Display {
  public:
    Display(bool quiet, bool table) : quiet_(quiet), table_(table) {}

    void update(sim::BusMonitor& monitor) {
        const auto events = monitor.take_events();
        if (quiet_) return;
        if (!events.empty()) erase_table();
        for (const std::string& event : events) tell(event);
        if (monitor.lists() == lists_) return;
        lists_ = monitor.lists();
        if (!table_) {
            std::cout << sim::cycle_line(monitor) << '\n';
            return;
        }
        erase_table();
        const std::string text = sim::cycle_table(monitor);
        rows_ = std::count(text.begin(), text.end(), '\n');
        std::cout << text << std::flush;
    }

  private:
    void erase_table() {
        if (rows_ > 0) std::cout << "\x1b[" << rows_ << "A\x1b[J";
        rows_ = 0;
    }

    /// A broken bus must not bury the objects: the first events are told, the rest only counted.
    void tell(const std::string& event) {
        constexpr int kMostEvents = 200;
        if (told_ < kMostEvents) std::cout << event << '\n';
        if (told_ == kMostEvents) std::cout << "further events are counted only, see the summary\n";
        told_ = std::min(told_ + 1, kMostEvents + 1);
    }

    bool quiet_;
    bool table_;
    std::uint32_t lists_ = 0;
    std::ptrdiff_t rows_ = 0;
    int told_ = 0;
};

int watch_log(const Options& options, sim::BusMonitor& monitor) {
    const std::string path = options.source == "-" ? "/dev/stdin" : options.source;
    const auto reader = hal::CandumpReader::open(path);
    if (!reader.value) return refuse(reader.error);
    Display display(options.quiet, false);
    hal::CandumpLine line;
    while (stop_requested == 0 && monitor.counters().frames < options.frames &&
           monitor.duration_us() < options.duration_us() && reader.value->next(line)) {
        monitor.line(line, reader.value->line_number());
        display.update(monitor);
    }
    if (reader.value->line_number() == 0) return refuse("CAN log " + path + " is empty");
    return kClean;
}

int watch_interface(const Options& options, sim::BusMonitor& monitor) {
    const auto port = hal::SocketCan::open(options.source);
    if (!port.value) return refuse(port.error);
    std::cerr << "listening on " << options.source << ", Ctrl-C ends\n";
    constexpr int kTurnMs = 100;
    hal::RealClock clock;
    Display display(options.quiet, ::isatty(STDOUT_FILENO) == 1);
    std::string problem;
    while (stop_requested == 0 && monitor.counters().frames < options.frames &&
           clock.now_us() < options.duration_us()) {
        port.value->begin_cycle();
        if (port.value->problem() != problem) {
            problem = port.value->problem();
            std::cerr << (problem.empty() ? options.source + " is back" : problem) << '\n';
        }
        port.value->wait_for_frame(kTurnMs);
        can::Frame frame;
        while (monitor.counters().frames < options.frames && port.value->receive(frame)) {
            monitor.frame(clock.now_us(), frame);
            display.update(monitor);
        }
        // Silence counts once something was heard.
        if (monitor.counters().frames > 0) monitor.advance(clock.now_us());
        monitor.port_counters(port.value->counters());
        display.update(monitor);
    }
    return kClean;
}

/// An interface has no dot and no slash in its name, and is no file here.
bool is_log(const std::string& source) {
    return source == "-" || source.find_first_of("./") != std::string::npos ||
           std::filesystem::exists(source);
}

int write_dbc(const std::string& path) {
    std::ofstream file(path, std::ios::binary);
    file << sim::dbc_text() << std::flush;
    return file ? kClean : refuse("cannot write " + path);
}

int run(const Options& options) {
    if (!options.dbc.empty()) return write_dbc(options.dbc);
    if (options.bus_load_objects >= 0) {
        std::cout << sim::bus_load_text(options.bus_load_objects);
        return kClean;
    }
    if (options.source.empty())
        return refuse("name an interface or a CAN log, for example vcan0; see --help");

    // Opened before the run, so that a wrong path does not cost its result.
    std::ofstream json;
    if (!options.json.empty()) {
        json.open(options.json);
        if (!json) return refuse("cannot write " + options.json);
    }
    sim::BusMonitor monitor;
    const int opened =
        is_log(options.source) ? watch_log(options, monitor) : watch_interface(options, monitor);
    if (opened != kClean) return opened;

    std::cout << sim::summary_text(monitor) << std::flush;
    if (json.is_open()) {
        json << sim::summary_json(monitor).dump(2) << std::endl;
        if (!json) return refuse("cannot write " + options.json);
    }
    if (monitor.counters().frames == monitor.counters().foreign) {
        std::cerr << "radar_monitor: no frame of the radar on " << options.source << '\n';
        return kErrorsSeen;
    }
    return monitor.errors() == 0 ? kClean : kErrorsSeen;
}

int parse_and_run(int argc, char** argv) {
    Options options;
    CLI::App app{
        "Decodes the radar's CAN messages and checks them end to end: CRC, counter, length, ranges, torn "
        "object lists,\n"
        "missing messages. Shows tracks, warnings and health, and counts every kind of error at the end."};
    app.footer(
        "examples\n"
        "  radar_monitor vcan0                    live, until Ctrl-C\n"
        "  radar_monitor run.log --json run.json  a log of radar_sim --log, or of candump -L\n"
        "  candump -L can0 | radar_monitor -      a log as it comes\n"
        "  radar_monitor --bus-load               what the messages cost at 500 kbit/s\n"
        "exit code\n"
        "  0  the radar was heard and nothing was wrong\n"
        "  1  wrong usage, or a file or interface that cannot be used\n"
        "  2  errors on the bus or in the log, or the radar was not heard");
    app.add_option(
        "IFACE|FILE", options.source,
        "CAN interface, or a log in candump -L format: anything with a dot or slash, an existing file, - for "
        "standard input");
    app.add_option("--json", options.json, "write the summary to this file");
    app.add_option("--frames", options.frames, "stop after that many frames")
        ->check(CLI::Range(1, 1'000'000'000));
    app.add_option("--duration", options.duration_s,
                   "stop after that many seconds, of the log or of the clock")
        ->check([](const std::string& text) {
            const double seconds = std::atof(text.c_str());
            return seconds >= 0.001 && seconds <= 1e9 ? ""
                                                      : text + " is not 0.001 to 1e9 seconds";  // nor is NaN
        });
    app.add_flag("--quiet", options.quiet, "the summary only");
    app.add_option("--bus-load", options.bus_load_objects, "print the load of the bus with N objects and end")
        ->expected(0, 1)
        ->default_str("16")
        ->type_name("N")
        ->check(CLI::Range(0, can::kMaxObjects));
    app.add_option("--write-dbc", options.dbc, "write the description of the bus, can/radar.dbc, and end");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? kClean : kUsage;
    }
    std::signal(SIGINT, [](int) { stop_requested = 1; });
    std::signal(SIGTERM, [](int) { stop_requested = 1; });
    return run(options);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return parse_and_run(argc, argv);
    } catch (const std::exception& error) {
        return refuse(error.what());
    }
}
