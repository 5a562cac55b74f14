// A paper's experiment, repeated many times: tables on the terminal; CSV, JSON and pictures in a directory.
#include <CLI/CLI.hpp>
#include <array>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <string>

#include "host_sim/study_infrared.hpp"
#include "host_sim/study_lee2000.hpp"
#include "host_sim/study_lowsnr.hpp"
#include "host_sim/study_multimodel.hpp"

namespace {

constexpr const char* kAbout =
    "Monte-Carlo studies of the association methods. Uses all cores, also of several machines under mpirun; "
    "can be\n"
    "stopped and started again with the same --out. The same seed gives the same tables in every case.\n";

constexpr const char* kFooter = R"(
Examples:
  radar_study lee2000 --runs 200 --out out/lee2000
  radar_study lee2000 --runs 1000 --out out/lee2000       (later: computes the 800 that are missing)
  mpirun -n 2 radar_study lowsnr --out out/lowsnr
  radar_study lee2000 --scenarios host_sim/studies/fresh --seed 2 --out out/fresh

Studies:
  lee2000   Lee and Kim 2000: NN, PDA, OSPDA, JPDA, OSJPDA on close targets in clutter; tables 1 to 3,
            figures 4 to 13 and 15, and whether the paper's claims hold, over clutter, detection
            probability, spacing and gate. Scenarios: host_sim/studies/lee2000*.json; in its folder fresh,
            geometries drawn up after the radar's own association was chosen
  lowsnr    2020: iterative JIPDA with amplitude information, levels 0 to 4 and full, and LM-IPDA, on five
            targets at 13 and 20 dB, one- and two-point starts; figures 2 to 5, table 1 and the claims
  infrared  2013: IHPDA alone, with optimal assignment, with greedy assignment and LM-IHPDA on two formations
            that cross in images of 1500 x 600 pixels; figures 4 and 5, table 5 and the claims
  multimodel  Kim, Park, Kim and Ji: IMM-PDAF on vehicles that turn, stop and go, against PDA filters of one
            model, laser alone or with camera and infrastructure; figures 3 and 4 and the claims

Results, in --out: STUDY.txt (what the terminal shows), STUDY.csv, STUDY.json, STUDY_cost.txt (times on this
machine, the only thing that differs between two starts), pictures with their gnuplot script and data, and
STUDY.*.runs, which another start goes on from.

Exit status: 0 finished; 1 wrong usage, bad input or a file that cannot be read or written.)";

struct Study {
    const char* name;
    const char* about;
    std::size_t runs;
    void (*run)(const sim::StudyOptions&, const sim::StudyRanks&);
};
constexpr std::array<Study, 4> kStudies{
    {{"lee2000", "the comparison of Lee and Kim 2000", 200, sim::run_lee2000},
     {"lowsnr", "iterative JIPDA at low signal-to-noise ratio, 2020", 500, sim::run_lowsnr},
     {"infrared", "LM-IHPDA in infrared image sequences, 2013", 30, sim::run_infrared},
     {"multimodel", "IMM-PDAF with one sensor and three", 500, sim::run_multimodel}}};

}  // namespace

int main(int argc, char** argv) {
    const sim::StudyRanks ranks;
    CLI::App app{kAbout};
    app.footer(kFooter);
    app.require_subcommand(1);
    sim::StudyOptions options;
    std::string out;
    std::string scenarios;
    bool no_pictures = false;
    bool quiet = false;
    std::array<CLI::App*, kStudies.size()> commands{};
    for (std::size_t i = 0; i < kStudies.size(); ++i) {
        CLI::App* command = commands[i] = app.add_subcommand(kStudies[i].name, kStudies[i].about);
        command
            ->add_option("--runs", options.runs,
                         "runs of each condition; default " + std::to_string(kStudies[i].runs))
            ->check(CLI::Range(2, 1'000'000));
        command->add_option("--seed", options.seed, "of the random numbers");
        command->add_option("--out", out, "directory of the results, made if missing")->required();
        command->add_option("--threads", options.run.threads, "default: all cores")
            ->check(CLI::Range(1, 1024));
        if (kStudies[i].run == sim::run_lowsnr)
            command
                ->add_option("--calibration", options.calibration,
                             "runs that set the confirmation thresholds; default 200")
                ->check(CLI::Range(1, 1'000'000));
        if (kStudies[i].run == sim::run_lee2000)
            command->add_option("--scenarios", scenarios,
                                "directory of lee2000.json and the geometries it names");
        command->add_flag("--no-pictures", no_pictures, "tables only; gnuplot is not needed");
        command->add_flag("--quiet", quiet, "no progress on standard error");
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::RequiredError& e) {
        if (app.get_subcommands().empty()) {
            std::fputs("radar_study: name a study: lee2000, lowsnr, infrared or multimodel; see --help\n",
                       stderr);
            return 1;
        }
        app.exit(e);
        return 1;
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 1;
    }
    try {
        options.pictures = !no_pictures;
        options.run.directory = out;
        options.scenarios = scenarios;
        options.run.show_progress = !quiet;
        for (std::size_t i = 0; i < kStudies.size(); ++i) {
            if (!commands[i]->parsed()) continue;
            if (options.runs == 0) options.runs = kStudies[i].runs;
            kStudies[i].run(options, ranks);
        }
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "radar_study: %s\n", e.what());
        ranks.give_up();
        return 1;
    }
}
