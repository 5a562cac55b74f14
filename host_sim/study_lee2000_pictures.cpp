#include <fstream>
#include <sstream>

#include "host_sim/gnuplot.hpp"
#include "host_sim/json_fields.hpp"
#include "host_sim/plots.hpp"
#include "host_sim/simulation.hpp"
#include "host_sim/study_lee2000_parts.hpp"

namespace sim::lee2000 {

namespace {

std::ofstream create(const std::filesystem::path& file) {
    std::ofstream out(file);
    if (!out) throw InputError(file.string() + ": cannot be written");
    return out;
}

constexpr const char* kGrid = "set grid lt 1 lw 0.5 lc rgb '#dddddd'\nset xlabel 'time / s'\n";

class Pictures {
  public:
    Pictures(std::filesystem::path directory, const Plan& plan, std::uint64_t seed)
        : directory_(std::move(directory)),
          plan_(plan),
          condition_(plan.conditions[plan.pictured]),
          geometry_(plan.geometries[condition_.geometry]),
          run_(simulate_study_run(geometry_, condition_.seen, seed, condition_.geometry, 0)) {}

    void draw(const std::vector<StudyFilter>& filters, const Scores& scores) {
        measurements();
        const std::array<std::pair<const char*, const char*>, 6> tracks{{{"fig05_nn", "nn"},
                                                                         {"fig06_pda", "pda"},
                                                                         {"fig07_ospda4", "ospda(4)"},
                                                                         {"fig08_jpda", "jpda"},
                                                                         {"fig09_osjpda6", "osjpda(6)"},
                                                                         {"default_ospda", "ospda"}}};
        for (const auto& [picture, name] : tracks)
            for (const StudyFilter& f : filters)
                if (f.name == name) tracks_of(f, picture);
        for (std::size_t t = 0; t < geometry_.targets.size(); ++t) correct_association(t, scores);
        loss_over_clutter(filters, scores);
    }

  private:
    void measurements() {
        auto truth = create(directory_ / "truth.dat");
        for (std::size_t t = 0; t < geometry_.targets.size(); ++t) {
            for (std::size_t k = 0; k < run_.truth.size(); ++k)
                truth << time(k) << ' ' << run_.truth[k][t][0] << ' ' << run_.truth[k][t][1] << '\n';
            truth << '\n';
        }
        auto hits = create(directory_ / "fig04_targets.dat");
        auto clutter = create(directory_ / "fig04_clutter.dat");
        for (std::size_t k = 0; k < run_.frames.size(); ++k)
            for (const StudyMeasurement& m : run_.frames[k])
                (m.targets != 0 ? hits : clutter)
                    << time(k + 1) << ' ' << m.value.z[0] << ' ' << m.value.z[1] << '\n';
        clutter << "NaN NaN NaN\n";
        truth.flush();
        hits.flush();
        clutter.flush();
        std::ostringstream gp;
        gp << kGrid << "set xrange [0:" << geometry_.duration_s << "]\nset lmargin 9\n"
           << "set key outside top right\nset multiplot layout 2,1 title 'Noisy targets and clutter ("
           << condition_.label << ")'\n";
        for (const int column : {2, 3})
            gp << "set ylabel '" << (column == 2 ? "range / m" : "range rate / (m/s)") << "'\nplot "
               << "'fig04_clutter.dat' using 1:" << column
               << " with points pt 7 ps 0.3 lc rgb '#b0b0b0' title 'clutter', "
               << "'fig04_targets.dat' using 1:" << column
               << " with points pt 7 ps 0.45 lc rgb '#1f77b4' title 'targets', "
               << "'truth.dat' using 1:" << column << " with lines lw 1 lc rgb '#000000' title 'truth'\n";
        gp << "unset multiplot\n";
        run_gnuplot(directory_, "fig04_measurements", gp.str());
    }

    void tracks_of(const StudyFilter& filter, const std::string& picture) {
        const StudyResult result = run_study_filter<double>(filter, geometry_, condition_.seen, run_);
        {
            auto out = create(directory_ / (picture + ".dat"));
            for (std::size_t t = 0; t < geometry_.targets.size(); ++t) {
                for (std::size_t k = 0; k < result.estimate.size(); ++k)
                    out << time(k) << ' ' << result.estimate[k][t][0] << ' ' << result.estimate[k][t][1]
                        << ' ' << t + 1 << '\n';
                out << '\n';
            }
        }
        // Two pairs far from each other: the vertical axis follows each.
        std::ostringstream gp;
        gp << kGrid << "set xrange [0:" << geometry_.duration_s << "]\nset lmargin 9\n"
           << "set palette maxcolors 4 defined (1 '#d62728', 2 '#1f77b4', 3 '#2ca02c', 4 '#9467bd')\n"
           << "unset colorbox\nset cbrange [0.5:4.5]\nset key outside top right\nset multiplot layout "
           << geometry_.pairs.size() << ",1 title 'Tracking four targets using " << filter.name << " ("
           << condition_.label << ", first run)'\n";
        for (const auto& [a, b] : geometry_.pairs) {
            double low = 1e9;
            double high = -1e9;
            for (const auto& frame : run_.truth) {
                low = std::min({low, frame[a][0], frame[b][0]});
                high = std::max({high, frame[a][0], frame[b][0]});
            }
            gp << "set ylabel 'range / m'\nset yrange [" << low - 2 << ':' << high + 2 << "]\n"
               << "plot 'truth.dat' using 1:2 with lines lw 1 lc rgb '#000000' title 'truth', '" << picture
               << ".dat' using 1:2:4 with lines lw 3 lc palette title 'tracks'\n";
        }
        gp << "unset multiplot\n";
        run_gnuplot(directory_, picture, gp.str());
    }

    void correct_association(std::size_t target, const Scores& scores) {
        const std::string picture = print("fig%zu_correct_target%zu", 10 + target, target + 1);
        const auto runs = static_cast<double>(scores.of[plan_.pictured][0].size());
        {
            auto out = create(directory_ / (picture + ".dat"));
            const std::size_t frames = scores.correct_at.at(kDrawn[0])[target].size();
            constexpr std::size_t kHalf = 5;  // a second is averaged
            for (std::size_t k = kHalf; k + kHalf < frames; ++k) {
                out << time(k + 1);
                for (const char* name : kDrawn) {
                    const auto& sums = scores.correct_at.at(name)[target];
                    double sum = 0;
                    for (std::size_t i = k - kHalf; i <= k + kHalf; ++i) sum += sums[i];
                    out << ' ' << sum / runs / (2 * kHalf + 1);
                }
                out << '\n';
            }
        }
        std::ostringstream gp;
        gp << kGrid << "set xrange [0:" << geometry_.duration_s << "]\nset lmargin 9\n"
           << "set key outside top right\nset yrange [0:1]\nset ylabel 'probability of correct association'\n"
           << "set title 'Target " << target + 1 << " (" << condition_.label << ", mean of all runs)'\nplot ";
        for (std::size_t i = 0; i < kDrawn.size(); ++i)
            gp << (i > 0 ? ", " : "") << "'" << picture << ".dat' using 1:" << i + 2
               << " with lines lw 2 title '" << kDrawn[i] << "'";
        gp << '\n';
        run_gnuplot(directory_, picture, gp.str());
    }

    void loss_over_clutter(const std::vector<StudyFilter>& filters, const Scores& scores) {
        const StudyCondition middle;
        for (std::size_t g = 0; g < plan_.geometries.size(); ++g) {
            std::map<double, std::size_t> by_density;
            for (std::size_t c = 0; c < plan_.conditions.size(); ++c) {
                const StudyCondition& s = plan_.conditions[c].seen;
                const bool only_clutter = s.detection_probability == middle.detection_probability &&
                                          s.spacing == middle.spacing && s.gate == middle.gate;
                if (plan_.conditions[c].geometry == g && only_clutter) by_density[s.clutter_density] = c;
            }
            const std::string picture =
                "loss_" + plan_.geometries[g].name.substr(std::string(kName).size() + 1);
            {
                auto out = create(directory_ / (picture + ".dat"));
                for (const auto& [density, c] : by_density) {
                    out << density;
                    for (const char* name : kDrawn)
                        for (std::size_t f = 0; f < filters.size(); ++f)
                            if (filters[f].name == name)
                                out << ' ' << over_runs(scores.of[c][f], lost).value << ' '
                                    << over_runs(scores.of[c][f], own_lost).value;
                    out << '\n';
                }
            }
            std::ostringstream gp;
            gp << kGrid << "set key outside top right\nset lmargin 9\nset logscale x\n"
               << "set xlabel 'clutter, false measurements a frame per m (m/s)'\nset yrange [0:*]\n"
               << "set multiplot layout 2,1 title '" << plan_.geometries[g].description << "'\n";
            for (const int own : {0, 1}) {
                gp << "set ylabel '" << (own == 0 ? "targets without a track / %" : "own track lost / %")
                   << "'\nplot ";
                for (std::size_t i = 0; i < kDrawn.size(); ++i)
                    gp << (i > 0 ? ", " : "") << "'" << picture
                       << ".dat' using 1:" << 2 * static_cast<int>(i) + 2 + own
                       << " with linespoints lw 2 pt 7 title '" << kDrawn[i] << "'";
                gp << '\n';
            }
            gp << "unset multiplot\n";
            run_gnuplot(directory_, picture, gp.str());
        }
    }

    [[nodiscard]] double time(std::size_t frame) const {
        return static_cast<double>(frame) * condition_.seen.period_s;
    }

    std::filesystem::path directory_;
    const Plan& plan_;
    const Condition& condition_;
    const StudyGeometry& geometry_;
    StudyRun run_;
};

}  // namespace

void draw_figure_15(const std::filesystem::path& directory) {
    SimulationOptions options;
    options.scenario = load_scenario("four-targets");
    options.tracker = tracking::Associator::ospda;
    options.quiet = true;
    Simulation simulation(options);
    Plots plots(directory / "fig15", "Detection and tracking from beat signals, OSPDA (four-targets)",
                simulation.waveform(), simulation.frames());
    while (simulation.step()) plots.add(simulation.view());
    plots.draw();
}

void draw_pictures(const std::filesystem::path& directory, const Plan& plan,
                   const std::vector<StudyFilter>& filters, const Scores& scores, std::uint64_t seed) {
    Pictures(directory, plan, seed).draw(filters, scores);
    draw_figure_15(directory);
}

}  // namespace sim::lee2000
