// A paper's experiment, repeated many times: tables on the terminal; CSV, JSON and pictures in a directory.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "host_sim/study_lee2000.hpp"

namespace {

constexpr const char* kAbout =
    "Monte-Carlo studies of the association methods. Uses all cores, also of several machines under mpirun; "
    "can be\n"
    "stopped and started again with the same --out. The same seed gives the same tables in every case.\n";

constexpr const char* kFooter = R"(
Examples:
  radar_study lee2000 --runs 200 --out out/lee2000
  mpirun -n 2 radar_study lee2000 --runs 1000 --out out/lee2000

Studies:
  lee2000   Lee and Kim 2000: NN, PDA, OSPDA, JPDA, OSJPDA on close targets in clutter; tables 1 to 3,
            figures 4 to 13 and 15, and whether the paper's claims hold, over clutter, detection
            probability, spacing and gate. Scenarios: host_sim/studies/lee2000*.json

Exit status: 0 finished; 1 wrong usage, bad input or a file that cannot be read or written.)";

}  // namespace

int main(int argc, char** argv) {
    const sim::StudyRanks ranks;
    CLI::App app{kAbout};
    app.footer(kFooter);
    app.require_subcommand(1);
    CLI::App* lee2000 = app.add_subcommand("lee2000", "the comparison of Lee and Kim 2000");
    sim::Lee2000Options options;
    std::string out;
    std::string scenarios;
    bool no_pictures = false;
    bool quiet = false;
    lee2000->add_option("--runs", options.runs, "runs of each condition")->check(CLI::Range(2, 1'000'000));
    lee2000->add_option("--seed", options.seed, "of the random numbers");
    lee2000->add_option("--out", out, "directory of the results, made if missing")->required();
    lee2000->add_option("--threads", options.run.threads, "default: all cores")->check(CLI::Range(1, 1024));
    lee2000->add_option("--scenarios", scenarios, "directory of lee2000.json and the geometries it names");
    lee2000->add_flag("--no-pictures", no_pictures, "tables only; gnuplot is not needed");
    lee2000->add_flag("--quiet", quiet, "no progress on standard error");
    CLI11_PARSE(app, argc, argv);
    try {
        options.pictures = !no_pictures;
        options.run.directory = out;
        options.scenarios = scenarios;
        options.run.show_progress = !quiet;
        sim::run_lee2000(options, ranks);
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "radar_study: %s\n", e.what());
        ranks.give_up();
        return 1;
    }
}
