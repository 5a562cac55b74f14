// What the radar measures of itself, each figure beside its bar.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/bench/accuracy_association.hpp"
#include "tests/bench/accuracy_dsp.hpp"
#include "tests/bench/accuracy_existence.hpp"
#include "tests/bench/accuracy_sim.hpp"
#include "tests/bench/row.hpp"

namespace {

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
    std::ofstream file(path);
    file << out.dump(2) << '\n';
    return static_cast<bool>(file.flush());
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Measures the radar, each figure beside its bar."};
    app.require_subcommand(1);
    app.footer("exit code: 0 every bar met, 1 wrong usage or a file that cannot be written, 2 a bar missed");
    std::string json;
    CLI::App* accuracy = app.add_subcommand(
        "accuracy",
        "signal processing against double precision and the Cramer-Rao bound, tracks against the truth");
    std::string part = "all";
    accuracy
        ->add_option(
            "--only", part,
            "dsp: signal processing; association: solvers against listing; system: scenarios and recordings")
        ->check(CLI::IsMember({"all", "dsp", "association", "system"}));
    std::string recordings = RADAR_RECORDINGS_DIR;
    accuracy
        ->add_option("--recordings", recordings,
                     "where recorded radar data lies; rows that need it are skipped without")
        ->capture_default_str();
    accuracy->add_option("--json", json, "write the figures to this file");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 1;
    }

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
    if (!json.empty() && !write_json(json, rows)) {
        std::fprintf(stderr, "cannot write %s\n", json.c_str());
        return 1;
    }
    return missed == 0 ? 0 : 2;
}
