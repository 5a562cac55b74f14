#include "host_sim/study_infrared.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <vector>

#include "host_sim/assignment.hpp"
#include "host_sim/gnuplot.hpp"
#include "host_sim/infrared_scene.hpp"
#include "host_sim/study_statistics.hpp"

namespace sim {

namespace {

using tracking::Associator;
using tracking::Sharing;

constexpr const char* kName = "infrared";
constexpr int kBefore = 12;  // frames from 1: the formations are apart,
constexpr int kAfter = 18;   // and apart again
constexpr int kDensest = 14;
constexpr double kTrue_px = 5;

struct Method {
    const char* name;
    Associator associator;
    tracking::IhpdaConfig sharing;
};
constexpr std::array<Method, 7> kMethods{
    {{"IHPDA alone",
      Associator::ihpda,
      {.sharing = Sharing::ignored, .modulated = false, .by_existence = false}},
     {"2-D assignment, beta",
      Associator::jihpda,
      {.sharing = Sharing::optimal, .modulated = false, .by_existence = false}},
     {"2-D assignment, psi beta",
      Associator::jihpda,
      {.sharing = Sharing::optimal, .modulated = false, .by_existence = true}},
     {"MMR, beta",
      Associator::jihpda,
      {.sharing = Sharing::greedy, .modulated = false, .by_existence = false}},
     {"LM-IHPDA, beta",
      Associator::lm_ihpda,
      {.sharing = Sharing::greedy, .modulated = true, .by_existence = false}},
     {"LM-IHPDA, psi beta",
      Associator::lm_ihpda,
      {.sharing = Sharing::greedy, .modulated = true, .by_existence = true}},
     {"JIPDA", Associator::jipda, {}}}};
constexpr std::size_t kAlone = 0;
constexpr std::size_t kOptimal = 1;
constexpr std::size_t kGreedy = 3;
constexpr std::size_t kLinear = 4;

/// The paper's parameters; what it does not give: PD, survival, and the strength of a target for the ranks.
PlaneTrackerConfig tracker_of(const Method& method) {
    PlaneTrackerConfig c;
    c.period_s = 1;  // a frame
    c.motion = tracking::constant_velocity<double, 2>(1, 0);
    constexpr double kPowerDensity = 5;  // S_w
    for (int axis = 0; axis < 2; ++axis) {
        c.motion.noise(axis, axis) = kPowerDensity / 3;
        c.motion.noise(axis, axis + 2) = c.motion.noise(axis + 2, axis) = kPowerDensity / 2;
        c.motion.noise(axis + 2, axis + 2) = kPowerDensity;
    }
    c.sigma = 1;
    c.gate = 16;
    c.detection_probability = 0.95;
    c.clutter_density = (kFlashes + kNoiseAlarms) / (kImageWidth * kImageHeight);
    c.snr = 4;
    c.associator = method.associator;
    c.sharing = method.sharing;
    c.start = TrackStart::two_point;
    c.start_from = StartFrom::untaken;
    c.max_speed = 60;
    c.initial_existence = 0.1;
    c.chain = {.survive = 0.98, .appear = 0};
    c.confirm = 0.995;
    c.drop = 0.01;
    c.merge = 1;
    return c;
}

using Detections = std::vector<std::vector<PlaneMeasurement>>;  ///< [frame]

Detections detect_all(std::uint64_t seed, std::uint64_t run) {
    Detections out;
    for (int f = 1; f <= kInfraredFrames; ++f) out.push_back(detect_points(infrared_image(seed, run, f)));
    return out;
}

/// Confirmed track of each target within kTrue_px, 0 if there is none.
std::map<int, int> track_of_target(const std::vector<PlaneTrack>& tracks, int frame) {
    const std::vector<InfraredTarget> targets = infrared_targets(frame);
    std::vector<const PlaneTrack*> confirmed;
    for (const PlaneTrack& t : tracks)
        if (t.confirmed) confirmed.push_back(&t);
    std::map<int, int> out;
    if (targets.empty()) return out;
    CostMatrix cost(targets.size(), std::max(confirmed.size(), targets.size()));
    std::fill(cost.cost.begin(), cost.cost.end(), kTrue_px);
    for (std::size_t t = 0; t < targets.size(); ++t)
        for (std::size_t i = 0; i < confirmed.size(); ++i)
            cost(t, i) = std::min(kTrue_px, (confirmed[i]->x.head<2>() - targets[t].position).norm());
    const std::vector<int> assigned = assign(cost);
    for (std::size_t t = 0; t < targets.size(); ++t) {
        const auto i = static_cast<std::size_t>(assigned[t]);
        out[targets[t].id] = cost(t, i) < kTrue_px ? confirmed[i]->id : 0;
    }
    return out;
}

struct Score {
    std::array<double, kInfraredFrames> tentative{};
    std::array<double, kInfraredFrames> confirmed{};
    double known = 0;         ///< formation targets with a track before the crossing; of these, after it:
    double kept = 0;          ///< still have it
    double swapped = 0;       ///< have a track that was another target's
    double renewed = 0;       ///< have one that did not exist
    double lost = 0;          ///< have none
    double false_frames = 0;  ///< confirmed tracks more than kTrue_px from every target, sum over frames
};
constexpr std::size_t kScoreValues = 2 * kInfraredFrames + 6;

Score track(const Method& method, const Detections& detections) {
    Score score;
    PlaneTracker tracker(tracker_of(method));
    std::map<int, int> before;
    for (int f = 1; f <= kInfraredFrames; ++f) {
        const auto k = static_cast<std::size_t>(f - 1);
        tracker.step(detections[k]);
        const std::vector<InfraredTarget> targets = infrared_targets(f);
        for (const PlaneTrack& t : tracker.tracks()) {
            (t.confirmed ? score.confirmed : score.tentative)[k] += 1;
            if (t.confirmed && std::none_of(targets.begin(), targets.end(), [&](const InfraredTarget& x) {
                    return (t.x.head<2>() - x.position).norm() < kTrue_px;
                }))
                ++score.false_frames;
        }
        if (f == kBefore) before = track_of_target(tracker.tracks(), f);
        if (f != kAfter) continue;
        std::set<int> known_ids;
        for (const auto& [target, id] : before)
            if (id != 0) known_ids.insert(id);
        const std::map<int, int> after = track_of_target(tracker.tracks(), f);
        for (const auto& [target, id] : before) {
            if (id == 0) continue;
            ++score.known;
            const int now = after.at(target);
            (now == id                  ? score.kept
             : now == 0                 ? score.lost
             : known_ids.count(now) > 0 ? score.swapped
                                        : score.renewed) += 1;
        }
    }
    return score;
}

using Runs = std::vector<Score>;

template <class Value>
Estimate over_runs(const Runs& runs, Value value) {
    std::vector<double> values;
    for (const Score& s : runs) values.push_back(value(s));
    return mean_of(values);
}
template <class Value>
Estimate difference(const Runs& first, const Runs& second, Value value) {
    std::vector<double> values;
    for (std::size_t r = 0; r < first.size(); ++r) values.push_back(value(first[r]) - value(second[r]));
    return mean_of(values);
}
double kept_percent(const Score& s) {
    return s.known > 0 ? 100 * s.kept / s.known : 0;
}

struct Tables {
    std::string text;
    std::string csv;
    nlohmann::json json;
};

Tables make_tables(const std::vector<Runs>& runs, const std::vector<double>& detections) {
    Tables out;
    out.text = print(
        "%zu image sequences of %d frames, %d x %d pixels; two formations of 7 cross in frames 13 to 15. "
        "Parameters "
        "of the paper;\nPD .95, survival .98 and a strength of 1 + 4 for the ranks are ours. Tracks start "
        "from pairs "
        "of measurements no confirmed\ntrack took. Targets of the formations that have a confirmed track in "
        "frame %d, "
        "of 14, and what they have in frame %d;\nintervals are 95 "
        "%%.\n\n%-26s%7s%24s%9s%9s%7s%7s%12s%12s%15s\n",
        runs[0].size(), kInfraredFrames, kImageWidth, kImageHeight, kBefore, kAfter, "", "known",
        "same track %", "swapped", "new", "none", "false", "tentative", "confirmed", "most tracks");
    out.csv = "method,frame,tentative,confirmed,detections\n";
    out.json["study"] = kName;
    out.json["runs"] = runs[0].size();
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
        const auto mean = [&](auto value) { return over_runs(runs[m], value).value; };
        const Estimate kept = over_runs(runs[m], kept_percent);
        double most = 0;
        int most_frame = 0;
        for (int f = 1; f <= kInfraredFrames; ++f) {
            const auto k = static_cast<std::size_t>(f - 1);
            const double tentative = mean([&](const Score& s) { return s.tentative[k]; });
            const double confirmed = mean([&](const Score& s) { return s.confirmed[k]; });
            if (tentative + confirmed > most) {
                most = tentative + confirmed;
                most_frame = f;
            }
            out.csv +=
                print("\"%s\",%d,%.6g,%.6g,%.6g\n", kMethods[m].name, f, tentative, confirmed, detections[k]);
        }
        out.text +=
            print("%-26s%7.2f%7.1f (%5.1f..%5.1f)%9.2f%9.2f%7.2f%7.2f%12.1f%12.1f%8.1f in %3d\n",
                  kMethods[m].name, mean([](const Score& s) { return s.known; }), kept.value, kept.low,
                  kept.high, mean([](const Score& s) { return s.swapped; }),
                  mean([](const Score& s) { return s.renewed; }), mean([](const Score& s) { return s.lost; }),
                  mean([](const Score& s) { return s.false_frames / kInfraredFrames; }),
                  mean([](const Score& s) { return s.tentative[kDensest - 1]; }),
                  mean([](const Score& s) { return s.confirmed[kDensest - 1]; }), most, most_frame);
        nlohmann::json method;
        method["method"] = kMethods[m].name;
        method["kept_percent"] = {kept.value, kept.low, kept.high};
        method["swapped"] = mean([](const Score& s) { return s.swapped; });
        method["lost"] = mean([](const Score& s) { return s.lost; });
        out.json["methods"].push_back(method);
    }
    out.text += print(
        "\nThe columns tentative and confirmed are of frame %d; the paper has 68 and 14 there, its largest "
        "number.\n"
        "false: confirmed tracks more than %g pixels from every target, mean over the frames.\n\nClaims\n",
        kDensest, kTrue_px);
    const auto claim = [&](const std::string& what, const Estimate& e, const char* unit, bool equal) {
        const char* verdict = equal ? verdict_equal(e) : verdict_above(e);
        out.text += claim_line(what, 78, e, unit, verdict);
        out.json["claims"].push_back(claim_json("claim", what, e, verdict));
    };
    claim("2-D assignment keeps more tracks through the crossing than IHPDA alone",
          difference(runs[kOptimal], runs[kAlone], kept_percent), "points", false);
    claim("LM-IHPDA keeps more tracks through the crossing than IHPDA alone",
          difference(runs[kLinear], runs[kAlone], kept_percent), "points", false);
    claim("LM-IHPDA keeps as many as 2-D assignment", difference(runs[kLinear], runs[kOptimal], kept_percent),
          "points", true);
    claim("LM-IHPDA keeps more than MMR without the linear form",
          difference(runs[kLinear], runs[kGreedy], kept_percent), "points", false);
    claim("2-D assignment: no swaps", over_runs(runs[kOptimal], [](const Score& s) { return s.swapped; }),
          "a run", true);
    claim("LM-IHPDA: no swaps", over_runs(runs[kLinear], [](const Score& s) { return s.swapped; }), "a run",
          true);
    const auto total = [](auto counts) {
        return [counts](const Score& s) {
            double sum = 0;
            for (const double v : s.*counts) sum += v / kInfraredFrames;
            return sum;
        };
    };
    claim("LM-IHPDA and 2-D assignment have the same number of tentative tracks",
          difference(runs[kLinear], runs[kOptimal], total(&Score::tentative)), "a frame", true);
    claim("LM-IHPDA and 2-D assignment have the same number of confirmed tracks",
          difference(runs[kLinear], runs[kOptimal], total(&Score::confirmed)), "a frame", true);
    return out;
}

/// Table 5: processor time of the tracker in the densest frame, best of some repetitions of a sequence.
std::string cost_table(const Detections& detections) {
    std::string out =
        print("\nTable 5. Milliseconds of frame %d on this machine, all of the tracker (paper, i5-2500K)\n",
              kDensest);
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
        const double best = best_of(20, [&] {
            PlaneTracker tracker(tracker_of(kMethods[m]));
            for (std::size_t k = 0; k + 1 < kDensest; ++k) tracker.step(detections[k]);
            const double before = cpu_ms();
            tracker.step(detections[kDensest - 1]);
            return cpu_ms() - before;
        });
        out += print("  %-26s%8.3f%s\n", kMethods[m].name, best,
                     m == kOptimal ? "   (0.360)" : (m == kLinear ? "   (0.302)" : ""));
    }
    return out;
}

void draw(const std::filesystem::path& directory, const std::vector<Runs>& runs,
          const std::vector<double>& detections, const Detections& first, std::uint64_t seed) {
    std::ostringstream counts;
    for (std::size_t k = 0; k < kInfraredFrames; ++k) {
        counts << k + 1 << ' ' << detections[k];
        for (const std::size_t m : {kOptimal, kLinear})
            counts << ' ' << over_runs(runs[m], [&](const Score& s) { return s.tentative[k]; }).value << ' '
                   << over_runs(runs[m], [&](const Score& s) { return s.confirmed[k]; }).value;
        counts << '\n';
    }
    write_text(directory / "fig05_tracks.dat", counts.str());
    run_gnuplot(
        directory, "fig05_tracks",
        "set grid lc rgb '#dddddd'\nset key outside top right\nset xlabel 'frame'\nset yrange [0:*]\n"
        "set multiplot layout 2,1 title 'Mean number of tracks'\nset ylabel 'tentative tracks'\n"
        "plot 'fig05_tracks.dat' using 1:3 with linespoints lw 2 title 'IHPDA, 2-D assignment', '' using 1:5 "
        "with "
        "linespoints lw 2 title 'LM-IHPDA'\nset ylabel 'confirmed tracks'\n"
        "plot 'fig05_tracks.dat' using 1:2 with lines lw 2 lc rgb '#000000' title 'detections of targets', "
        "'' using "
        "1:4 with linespoints lw 2 title 'IHPDA, 2-D assignment', '' using 1:6 with linespoints lw 2 title "
        "'LM-IHPDA'\nunset multiplot\n");

    // Figure 4: confirmed tracks of LM-IHPDA on the images in which the formations pass through each other.
    constexpr int kLeft = 640;
    constexpr int kTop = 250;
    constexpr int kWide = 220;
    constexpr int kHigh = 105;
    PlaneTracker tracker(tracker_of(kMethods[kLinear]));
    std::map<int, int> formation;  // of a track, by the target it had before the crossing
    std::ostringstream gp;
    gp << "set multiplot layout 2,2 title 'LM-IHPDA, first run: confirmed tracks, red flying right, white "
          "flying left'\n"
          "set palette gray\nunset colorbox\nset cbrange [98:125]\nunset key\nset size ratio -1\nset xrange ["
       << kLeft << ':' << kLeft + kWide << "]\nset yrange [" << kTop + kHigh << ':' << kTop << "]\n";
    for (int f = 1; f <= 15; ++f) {
        tracker.step(first[static_cast<std::size_t>(f - 1)]);
        if (f == kBefore) {
            for (const auto& [target, id] : track_of_target(tracker.tracks(), f))
                formation[id] = target <= 7 ? 1 : 2;
        }
        if (f < kBefore) continue;
        const std::vector<float> image = infrared_image(seed, 0, f);
        std::ostringstream cells;
        for (int y = kTop; y < kTop + kHigh; ++y, cells << '\n')
            for (int x = kLeft; x < kLeft + kWide; ++x)
                cells << image[static_cast<std::size_t>(y) * kImageWidth + static_cast<std::size_t>(x)]
                      << ' ';
        write_text(directory / print("fig04_image%d.dat", f), cells.str());
        std::ostringstream tracks;
        for (const PlaneTrack& t : tracker.tracks())
            if (t.confirmed) tracks << t.x[0] << ' ' << t.x[1] << ' ' << formation[t.id] << '\n';
        write_text(directory / print("fig04_tracks%d.dat", f), tracks.str() + "NaN NaN 0\n");
        gp << "set title 'frame " << f << "'\nplot 'fig04_image" << f << ".dat' matrix using ($1+" << kLeft
           << "):($2+" << kTop << "):3 with image, 'fig04_tracks" << f
           << ".dat' using ($3==1?$1:NaN):2 with points pt 4 ps 1.6 lw 2 lc rgb '#ff3030', '' using "
              "($3==2?$1:NaN):2 with "
              "points pt 4 ps 1.6 lw 2 lc rgb '#ffffff', '' using ($3==0?$1:NaN):2 with points pt 4 ps 1.6 "
              "lw 2 lc rgb "
              "'#ffd000'\n";
    }
    gp << "unset multiplot\n";
    run_gnuplot(directory, "fig04_crossing", gp.str(), 1400, 900);
}

}  // namespace

void run_infrared(const StudyOptions& options, const StudyRanks& ranks) {
    if (options.pictures && ranks.self().rank == 0) require_gnuplot();
    StudyWork work;
    work.name = kName;
    work.configuration = print("%s seed %llu, 1", kName, static_cast<unsigned long long>(options.seed));
    work.units = options.runs;
    work.run = [&](std::size_t unit) {
        const Detections detections = detect_all(options.seed, unit);
        std::vector<double> out;
        for (int f = 1; f <= kInfraredFrames; ++f) {
            const auto& found = detections[static_cast<std::size_t>(f - 1)];
            double hits = 0;
            for (const InfraredTarget& t : infrared_targets(f))
                hits += std::any_of(found.begin(), found.end(),
                                    [&](const PlaneMeasurement& m) { return (m.z - t.position).norm() < 2; })
                            ? 1
                            : 0;
            out.push_back(hits);
        }
        for (const Method& method : kMethods) {
            const Score s = track(method, detections);
            out.insert(out.end(), s.tentative.begin(), s.tentative.end());
            out.insert(out.end(), s.confirmed.begin(), s.confirmed.end());
            out.insert(out.end(), {s.known, s.kept, s.swapped, s.renewed, s.lost, s.false_frames});
        }
        return out;
    };
    const auto units = run_study_units(work, options.run, ranks);
    if (ranks.self().rank != 0) return;

    std::vector<Runs> runs(kMethods.size());
    std::vector<double> hits(kInfraredFrames, 0);
    for (const std::vector<double>& unit : units) {
        for (std::size_t k = 0; k < kInfraredFrames; ++k)
            hits[k] += unit[k] / static_cast<double>(units.size());
        for (std::size_t m = 0; m < kMethods.size(); ++m) {
            const double* in = unit.data() + kInfraredFrames + m * kScoreValues;
            Score s;
            std::copy_n(in, kInfraredFrames, s.tentative.begin());
            std::copy_n(in + kInfraredFrames, kInfraredFrames, s.confirmed.begin());
            in += 2 * kInfraredFrames;
            s.known = in[0];
            s.kept = in[1];
            s.swapped = in[2];
            s.renewed = in[3];
            s.lost = in[4];
            s.false_frames = in[5];
            runs[m].push_back(s);
        }
    }
    const auto& directory = options.run.directory;
    const Tables tables = make_tables(runs, hits);
    const Detections first = detect_all(options.seed, 0);
    const std::string cost = cost_table(first);
    std::printf("%s%s", tables.text.c_str(), cost.c_str());
    write_text(directory / "infrared.txt", tables.text);
    write_text(directory / "infrared_cost.txt", cost);
    write_text(directory / "infrared.csv", tables.csv);
    write_text(directory / "infrared.json", tables.json.dump(1) + "\n");
    if (options.pictures) draw(directory, runs, hits, first, options.seed);
    std::printf("\nTables, CSV, JSON and pictures are in %s\n", directory.c_str());
}

}  // namespace sim
