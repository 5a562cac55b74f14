// What the radar measures of itself, each figure beside its bar.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/bench/accuracy_association.hpp"
#include "tests/bench/accuracy_dsp.hpp"
#include "tests/bench/accuracy_existence.hpp"
#include "tests/bench/accuracy_sim.hpp"
#include "tests/bench/row.hpp"
#include "tests/bench/speed.hpp"

namespace {

bool write_json(const std::string& path, const nlohmann::json& out) {
    std::ofstream file(path);
    file << out.dump(2) << '\n';
    return static_cast<bool>(file.flush());
}

bool write_json(const std::string& path, const std::vector<bench::Row>& rows) {
    nlohmann::json out = nlohmann::json::array();
    for (const bench::Row& row : rows) {
        // JSON has no NaN: a figure that could not be measured is null.
        out.push_back(
            {{"what", row.what},
             {"measured", std::isfinite(row.measured) ? nlohmann::json(row.measured) : nlohmann::json()},
             {"bar", row.bar},
             {"at_least", row.at_least},
             {"unit", row.unit},
             {"met", row.met()}});
    }
    return write_json(path, out);
}

bool write_json(const std::string& path, const std::vector<bench::Timing>& timings) {
    nlohmann::json out = nlohmann::json::array();
    for (const bench::Timing& timing : timings) {
        out.push_back({{"task", timing.task},
                       {"by", timing.by},
                       {"nanoseconds", timing.nanoseconds},
                       {"of_ours", timing.of_ours}});
    }
    return write_json(path, out);
}

struct Measured {
    bool met = false;      ///< every bar
    bool written = false;  ///< the file that was asked for
};

Measured accuracy(const std::string& part, const std::string& recordings, const std::string& json) {
    std::vector<bench::Row> rows;
    int missed = 0;
    const auto add = [&](const std::vector<bench::Row>& more) {
        missed += bench::print(more);
        std::fflush(stdout);
        rows.insert(rows.end(), more.begin(), more.end());
    };
    const auto wanted = [&part](const char* name) { return part == "all" || part == name; };
    if (wanted("dsp")) add(bench::accuracy_dsp());
    if (wanted("association")) add(bench::accuracy_association());
    if (wanted("association")) add(bench::accuracy_existence());
    if (wanted("system")) add(bench::accuracy_sim(recordings));
    std::printf("%zu figures, %d bars missed\n", rows.size(), missed);
    return {missed == 0, json.empty() || write_json(json, rows)};
}

Measured speed(bool quick, const std::string& only, const std::string& json) {
    const std::vector<bench::Timing> timings = bench::compare_speed(quick, only);
    return {bench::print(timings), json.empty() || write_json(json, timings)};
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Measures the radar, each figure beside its bar."};
    app.require_subcommand(1);
    app.footer(
        "exit code: 0 every bar met; 1 wrong usage, a file that cannot be read or written, or a competitor "
        "that "
        "computes something else; 2 a bar missed");
    std::string json;
    CLI::App* accuracy_command = app.add_subcommand(
        "accuracy",
        "signal processing against double precision and the Cramer-Rao bound, tracks against the truth");
    std::string part = "all";
    accuracy_command
        ->add_option("--only", part,
                     "dsp: signal processing; association: solvers against listing; system: scenarios "
                     "and recordings")
        ->check(CLI::IsMember({"all", "dsp", "association", "system"}));
    std::string recordings = RADAR_RECORDINGS_DIR;
    accuracy_command
        ->add_option("--recordings", recordings,
                     "where recorded radar data lies; rows that need it are skipped without")
        ->capture_default_str();
    CLI::App* speed_command =
        app.add_subcommand("speed",
                           "time on this PC beside KissFFT, FFTW, Eigen, OS-CFAR by sorting and JPDA by "
                           "listing events, and frames "
                           "a second of the firmware's loop; boards: toolchains/target_report.py");
    bool quick = false;
    std::string only;
    speed_command->add_flag("--quick", quick, "seconds instead of half a minute, and a little less certain");
    speed_command->add_option("--only", only, "tasks whose name starts so, as the table has them");
    for (CLI::App* command : {accuracy_command, speed_command})
        command->add_option("--json", json, "write the figures to this file");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 1;
    }
    Measured measured;
    try {
        measured = accuracy_command->parsed() ? accuracy(part, recordings, json) : speed(quick, only, json);
    } catch (const std::runtime_error& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    if (!measured.written) {
        std::fprintf(stderr, "cannot write %s\n", json.c_str());
        return 1;
    }
    return measured.met ? 0 : 2;
}
