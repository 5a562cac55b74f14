#include "host_sim/study_lowsnr.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "host_sim/assignment.hpp"
#include "host_sim/gnuplot.hpp"
#include "host_sim/random.hpp"
#include "host_sim/study_statistics.hpp"

namespace sim {

namespace {

using Vec2d = tracking::Vec2<double>;
using Vec4d = tracking::VecN<double, 4>;

constexpr double kPeriod_s = 0.05;
constexpr double kSigma_m = 20;
constexpr double kFalseAlarm = 0.01;
constexpr double kGate = 9.21;  ///< g^2, PG = .99
constexpr double kCells = 50;
constexpr double kNearest_m = 20'000;
constexpr double kFarthest_m = 21'000;
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFirst_rad = 43 * kDegree;
constexpr double kLast_rad = 45.5 * kDegree;

double area_m2() {
    return (kFarthest_m * kFarthest_m - kNearest_m * kNearest_m) / 2 * (kLast_rad - kFirst_rad);
}
double threshold() {
    return -std::log(kFalseAlarm);
}
double linear(double db) {
    return std::pow(10, db / 10);
}

constexpr std::array<std::array<double, 4>, 5> kTargets{{{14166, 14117, 600, 100},
                                                         {14362, 13918, 440, 440},
                                                         {14507, 13767, 260, 700},
                                                         {14404, 14304, 500, -100},
                                                         {14846, 13844, -100, 500}}};

}  // namespace

std::vector<LowSnrFrame> simulate_low_snr(double snr_db, std::uint64_t seed, std::uint64_t purpose,
                                          std::uint64_t index) {
    Random random(seed, purpose, index);
    std::vector<LowSnrFrame> frames(kLowSnrFrames);
    const double snr = linear(snr_db);
    for (std::size_t k = 0; k < frames.size(); ++k) {
        LowSnrFrame& frame = frames[k];
        for (const auto& t : kTargets) {
            const double time = kPeriod_s * static_cast<double>(k);
            const Vec4d x(t[0] + t[2] * time, t[1] + t[3] * time, t[2], t[3]);
            frame.truth.push_back(x);
            const double amplitude = (1 + snr) * random.exponential();
            const Vec2d noise(kSigma_m * random.gaussian(), kSigma_m * random.gaussian());
            if (amplitude > threshold()) frame.measurements.push_back({x.head<2>() + noise, amplitude});
        }
        // Each cell of the detector crosses the threshold on its own; 2500 rare events are Poisson.
        for (int n = random.poisson(kCells * kCells * kFalseAlarm); n > 0; --n) {
            const double range = kNearest_m + (kFarthest_m - kNearest_m) * random.uniform();
            const double azimuth = kFirst_rad + (kLast_rad - kFirst_rad) * random.uniform();
            frame.measurements.push_back(
                {{range * std::cos(azimuth), range * std::sin(azimuth)}, threshold() + random.exponential()});
        }
    }
    return frames;
}

PlaneTrackerConfig low_snr_tracker(double snr_db, TrackStart start, int level) {
    PlaneTrackerConfig c;
    c.period_s = kPeriod_s;
    c.motion = tracking::constant_velocity<double, 2>(kPeriod_s, 0.3);
    c.sigma = kSigma_m;
    c.snr = linear(snr_db);
    c.threshold = threshold();
    c.use_amplitude = true;
    c.gate = kGate;
    c.detection_probability = std::exp(-c.threshold / (1 + c.snr));
    c.clutter_density = kCells * kCells * kFalseAlarm / area_m2();
    c.associator = level < 0                      ? tracking::Associator::lm_ipda
                   : level == tracking::kMaxLevel ? tracking::Associator::jipda
                                                  : tracking::Associator::ijipda;
    c.iterative = {.level = level < 0 || level == tracking::kMaxLevel ? 4 : level, .budget = 20'000};
    c.start = start;
    c.start_from = StartFrom::outside_all_gates;
    c.max_speed = 2.2 * 340;
    c.initial_existence = 0.001;
    c.chain = {.survive = 0.99, .appear = 0};
    c.drop = 0.00005;
    c.merge = 1;
    return c;
}

namespace {

constexpr const char* kName = "lowsnr";
constexpr int kLinear = -1;  // in place of a level

struct Method {
    const char* name;
    int level;
    double paper_threshold_13;
    double paper_threshold_20;
    double paper_ms_13;
    double paper_ms_20;
};
constexpr std::array<Method, 7> kMethods{{{"level 0 (IPDA)", 0, .999, .99, .016, .015},
                                          {"level 1", 1, .9935, .97, .018, .016},
                                          {"level 2", 2, .991, .955, .064, .034},
                                          {"level 3", 3, .99, .953, .353, .116},
                                          {"level 4", 4, .99, .952, 2.053, 1.212},
                                          {"full (JIPDA)", tracking::kMaxLevel, 0, 0, 52.821, 0},
                                          {"LM-IPDA", kLinear, .995, .975, .018, .016}}};
constexpr std::size_t kFull = 5;
constexpr std::size_t kLm = 6;

struct Condition {
    const char* label;
    double snr_db;
    TrackStart start;
    double false_tracks;  ///< a run, that the thresholds are set for: the paper's
};
constexpr std::array<Condition, 4> kConditions{{{"13 dB, one-point start", 13, TrackStart::one_point, 3},
                                                {"13 dB, two-point start", 13, TrackStart::two_point, 3},
                                                {"20 dB, one-point start", 20, TrackStart::one_point, 2},
                                                {"20 dB, two-point start", 20, TrackStart::two_point, 2}}};
constexpr std::uint64_t kCalibrationPurpose = 2;
constexpr std::uint64_t kStudyPurpose = 3;

/// A confirmed track is true while within this of a target: three sigma of a measurement. Nothing is asked of
/// the velocity, which a one-point start does not know and two measurements know to 570 m/s.
constexpr double kTrue_m = 60;
/// Thresholds are looked for in here. With amplitude information one strong return makes a track sure of
/// itself, so a higher one would not reject what is false, only what is true and weak.
constexpr double kLeastThreshold = 0.9;
constexpr double kLargestThreshold = 1 - 1e-6;
constexpr int kLateFrom = 15;  ///< frames from here on are the late half

bool is_near(const PlaneTrack& track, const Vec4d& truth) {
    return (track.x - truth).head<2>().norm() < kTrue_m;
}
/// No target is in the track's gate.
bool is_false(const PlaneTrack& track, const LowSnrFrame& frame) {
    const tracking::Ldl<double> gate(
        tracking::innovation_covariance(tracking::measured_covariance<double, 4>(track.covariance),
                                        Vec2d(kSigma_m * kSigma_m, kSigma_m * kSigma_m)));
    return std::none_of(frame.truth.begin(), frame.truth.end(), [&](const Vec4d& x) {
        return gate.distance2(x.head<2>() - track.x.head<2>()) < kGate;
    });
}

template <class Visit>
void run_tracker(std::size_t condition, std::size_t method, const std::vector<LowSnrFrame>& frames,
                 double threshold, Visit visit) {
    const Condition& c = kConditions[condition];
    PlaneTrackerConfig config = low_snr_tracker(c.snr_db, c.start, kMethods[method].level);
    config.confirm = threshold;
    PlaneTracker tracker(config);
    for (std::size_t k = 0; k < frames.size(); ++k) {
        const PlaneReport report = tracker.step(frames[k].measurements);
        visit(k, tracker, report);
    }
}

/// Of each method: how many thresholds follow, and for every track that was false at some time the highest
/// threshold that it would have passed by then.
std::vector<double> calibrate_unit(std::uint64_t seed, std::size_t unit) {
    const std::size_t c = unit % kConditions.size();
    const auto frames =
        simulate_low_snr(kConditions[c].snr_db, seed, kCalibrationPurpose, unit / kConditions.size());
    std::vector<double> out;
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
        std::map<int, double> highest;
        std::map<int, double> highest_false;
        run_tracker(c, m, frames, kLeastThreshold,
                    [&](std::size_t k, const PlaneTracker& tracker, const PlaneReport&) {
                        for (const PlaneTrack& t : tracker.tracks()) {
                            double& h = highest[t.id];
                            h = std::max(h, t.existence);
                            if (h >= kLeastThreshold && is_false(t, frames[k])) {
                                double& f = highest_false[t.id];
                                f = std::max(f, h);
                            }
                        }
                    });
        out.push_back(static_cast<double>(highest_false.size()));
        for (const auto& [id, h] : highest_false) out.push_back(h);
    }
    return out;
}

/// [condition][method]
using Thresholds = std::array<std::array<double, kMethods.size()>, kConditions.size()>;

Thresholds thresholds_from(const std::vector<std::vector<double>>& units) {
    const double runs = static_cast<double>(units.size() / kConditions.size());
    std::array<std::array<std::vector<double>, kMethods.size()>, kConditions.size()> passed;
    for (std::size_t u = 0; u < units.size(); ++u) {
        const double* in = units[u].data();
        for (std::size_t m = 0; m < kMethods.size(); ++m) {
            const auto count = static_cast<std::size_t>(*in++);
            auto& all = passed[u % kConditions.size()][m];
            all.insert(all.end(), in, in + count);
            in += count;
        }
    }
    Thresholds out{};
    for (std::size_t c = 0; c < kConditions.size(); ++c) {
        for (std::size_t m = 0; m < kMethods.size(); ++m) {
            auto& all = passed[c][m];
            std::sort(all.begin(), all.end(), std::greater<>());
            const auto wanted = static_cast<std::size_t>(kConditions[c].false_tracks * runs);
            out[c][m] = wanted < all.size() ? std::min(all[wanted], kLargestThreshold) : kLeastThreshold;
        }
    }
    return out;
}

struct Score {
    double false_tracks = 0;
    std::array<double, kLowSnrFrames> found{};   ///< targets with a confirmed true track
    std::array<double, kLowSnrFrames> square{};  ///< sum of their squared position errors
    double tracks = 0;
    double cluster_tracks = 0;
    double cluster_measurements = 0;
    double split = 0;
    double inexact = 0;
    double level = tracking::kMaxLevel;
};
constexpr std::size_t kScoreValues = 7 + 2 * kLowSnrFrames;

std::vector<double> study_unit(const Thresholds& thresholds, std::uint64_t seed, std::size_t unit) {
    const std::size_t c = unit % kConditions.size();
    const auto frames =
        simulate_low_snr(kConditions[c].snr_db, seed, kStudyPurpose, unit / kConditions.size());
    std::vector<double> out;
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
        Score score;
        std::map<int, bool> was_false;
        run_tracker(
            c, m, frames, thresholds[c][m],
            [&](std::size_t k, const PlaneTracker& tracker, const PlaneReport& report) {
                std::vector<const PlaneTrack*> confirmed;
                for (const PlaneTrack& t : tracker.tracks()) {
                    if (!t.confirmed) continue;
                    confirmed.push_back(&t);
                    if (is_false(t, frames[k])) was_false[t.id] = true;
                }
                constexpr double kFar = 1e9;
                CostMatrix cost(frames[k].truth.size(), std::max(confirmed.size(), frames[k].truth.size()));
                std::fill(cost.cost.begin(), cost.cost.end(), kFar);
                for (std::size_t t = 0; t < cost.rows; ++t)
                    for (std::size_t i = 0; i < confirmed.size(); ++i)
                        if (is_near(*confirmed[i], frames[k].truth[t]))
                            cost(t, i) = (confirmed[i]->x - frames[k].truth[t]).head<2>().squaredNorm();
                const std::vector<int> track_of = assign(cost);
                for (std::size_t t = 0; t < cost.rows; ++t) {
                    const double square = cost(t, static_cast<std::size_t>(track_of[t]));
                    if (square >= kFar) continue;
                    score.found[k] += 1;
                    score.square[k] += square;
                }
                score.tracks += static_cast<double>(report.tracks) / kLowSnrFrames;
                if (report.cluster_tracks > score.cluster_tracks) {
                    score.cluster_tracks = report.cluster_tracks;
                    score.cluster_measurements = report.cluster_measurements;
                }
                score.split += report.split;
                score.inexact += report.inexact;
                score.level = std::min(score.level, static_cast<double>(report.level));
            });
        score.false_tracks = static_cast<double>(was_false.size());
        out.insert(out.end(), {score.false_tracks, score.tracks, score.cluster_tracks,
                               score.cluster_measurements, score.split, score.inexact, score.level});
        out.insert(out.end(), score.found.begin(), score.found.end());
        out.insert(out.end(), score.square.begin(), score.square.end());
    }
    return out;
}

/// [condition][method][run]
using Scores = std::array<std::array<std::vector<Score>, kMethods.size()>, kConditions.size()>;

Scores scores_from(const std::vector<std::vector<double>>& units) {
    Scores scores;
    for (std::size_t u = 0; u < units.size(); ++u) {
        for (std::size_t m = 0; m < kMethods.size(); ++m) {
            const double* in = units[u].data() + m * kScoreValues;
            Score s;
            s.false_tracks = in[0];
            s.tracks = in[1];
            s.cluster_tracks = in[2];
            s.cluster_measurements = in[3];
            s.split = in[4];
            s.inexact = in[5];
            s.level = in[6];
            std::copy_n(in + 7, kLowSnrFrames, s.found.begin());
            std::copy_n(in + 7 + kLowSnrFrames, kLowSnrFrames, s.square.begin());
            scores[u % kConditions.size()][m].push_back(s);
        }
    }
    return scores;
}

/// Percent of the targets found, mean over frames from..to-1.
double found_percent(const Score& s, int from, int to) {
    double sum = 0;
    for (int k = from; k < to; ++k) sum += s.found[static_cast<std::size_t>(k)];
    return 100 * sum / static_cast<double>(kTargets.size()) / (to - from);
}
double late_found(const Score& s) {
    return found_percent(s, kLateFrom, kLowSnrFrames);
}
/// Mean square position error of the late half; NaN if nothing was found.
double late_square(const Score& s) {
    double sum = 0;
    double count = 0;
    for (std::size_t k = kLateFrom; k < kLowSnrFrames; ++k) {
        sum += s.square[k];
        count += s.found[k];
    }
    return sum / count;
}

using Runs = std::vector<Score>;

template <class Value>
Estimate over_runs(const Runs& runs, Value value) {
    std::vector<double> values;
    for (const Score& s : runs) values.push_back(value(s));
    return mean_of(values);
}
template <class Value>
Estimate difference(const Runs& more, const Runs& less, Value value) {
    std::vector<double> values;
    for (std::size_t r = 0; r < more.size(); ++r) values.push_back(value(more[r]) - value(less[r]));
    return mean_of(values);
}
double pooled_rms(const Runs& runs, std::size_t from, std::size_t to) {
    double sum = 0;
    double count = 0;
    for (const Score& s : runs) {
        for (std::size_t k = from; k < to; ++k) {
            sum += s.square[k];
            count += s.found[k];
        }
    }
    return count > 0 ? std::sqrt(sum / count) : std::nan("");
}
Estimate rms_improvement(const Runs& from, const Runs& to) {
    std::vector<ErrorPair> pairs;
    for (std::size_t r = 0; r < from.size(); ++r) {
        const ErrorPair pair{r, late_square(from[r]), late_square(to[r])};
        if (std::isfinite(pair.first) && std::isfinite(pair.second)) pairs.push_back(pair);
    }
    return improvement_of(pairs, from.size());
}

class Report {
  public:
    Report(const Scores& scores, const Thresholds& thresholds, std::size_t calibration)
        : scores_(scores), thresholds_(thresholds), calibration_(calibration) {}

    std::string text() {
        std::string out = print(
            "%zu runs of each condition, %zu others to set the confirmation thresholds for the paper's "
            "number of\n"
            "confirmed false tracks (3 a run at 13 dB, 2 at 20 dB); intervals are 95 %%. 13 dB is the mean "
            "signal-to-noise\nratio of the amplitude model, so PD = exp(-ln 100 / (1 + 10^1.3)) = %.4f; the "
            "paper's .8296 would be 13.74 dB.\nA confirmed track is true within %g m of a target; "
            "gate "
            "%g; survival .99 a frame.\nThresholds are looked for from %g to 1 - 1e-6. Where the false "
            "tracks are "
            "not the paper's number, none of them gives it:\nwith amplitude information one strong return "
            "makes a track "
            "sure of itself.\n",
            scores_[0][0].size(), calibration_,
            low_snr_tracker(13, TrackStart::one_point, 0).detection_probability, kTrue_m,
            low_snr_tracker(13, TrackStart::one_point, 0).gate, kLeastThreshold);
        for (std::size_t c = 0; c < kConditions.size(); ++c) out += condition_table(c);
        return out + claims();
    }

    [[nodiscard]] std::string csv() const {
        std::string out = "condition,method,frame,found_percent,low,high,rms_m\n";
        for (std::size_t c = 0; c < kConditions.size(); ++c) {
            for (std::size_t m = 0; m < kMethods.size(); ++m) {
                for (int k = 0; k < kLowSnrFrames; ++k) {
                    const Estimate e =
                        over_runs(scores_[c][m], [&](const Score& s) { return found_percent(s, k, k + 1); });
                    const auto at = static_cast<std::size_t>(k);
                    out += print("\"%s\",%s,%d,%.6g,%.6g,%.6g,%.6g\n", kConditions[c].label, kMethods[m].name,
                                 k + 1, e.value, e.low, e.high, pooled_rms(scores_[c][m], at, at + 1));
                }
            }
        }
        return out;
    }

    [[nodiscard]] nlohmann::json json() const {
        nlohmann::json out;
        out["study"] = kName;
        out["runs"] = scores_[0][0].size();
        for (std::size_t c = 0; c < kConditions.size(); ++c) {
            nlohmann::json condition;
            condition["condition"] = kConditions[c].label;
            for (std::size_t m = 0; m < kMethods.size(); ++m) {
                const Runs& runs = scores_[c][m];
                nlohmann::json& method = condition["methods"][kMethods[m].name];
                const auto put = [&](const char* name, const Estimate& e) {
                    method[name] = {e.value, e.low, e.high};
                };
                method["threshold"] = thresholds_[c][m];
                put("false_tracks", over_runs(runs, [](const Score& s) { return s.false_tracks; }));
                put("late_found_percent", over_runs(runs, late_found));
                method["late_rms_m"] = pooled_rms(runs, kLateFrom, kLowSnrFrames);
            }
            out["conditions"].push_back(condition);
        }
        out["claims"] = claims_;
        return out;
    }

  private:
    std::string condition_table(std::size_t c) const {
        const bool low = kConditions[c].snr_db < 15;
        std::string out = print("\n%s\n%-16s%20s%9s%10s%10s%10s%19s%9s%14s%8s\n", kConditions[c].label, "",
                                "threshold (paper)", "false", "found 10", "found 20", "found 30",
                                "late half %", "RMS m", "largest", "level");
        for (std::size_t m = 0; m < kMethods.size(); ++m) {
            const Runs& runs = scores_[c][m];
            const double paper = low ? kMethods[m].paper_threshold_13 : kMethods[m].paper_threshold_20;
            const auto at = [&](int frame) {
                return over_runs(runs, [&](const Score& s) { return found_percent(s, frame - 1, frame); })
                    .value;
            };
            const Estimate late = over_runs(runs, late_found);
            const Score* largest = &runs[0];
            double level = tracking::kMaxLevel;
            for (const Score& s : runs) {
                if (s.cluster_tracks > largest->cluster_tracks) largest = &s;
                level = std::min(level, s.level);
            }
            out += print("%-16s%10.6f (%s)%9.2f%10.1f%10.1f%10.1f%8.1f (%4.1f..%4.1f)%7.2f%8.0f x %-4.0f",
                         kMethods[m].name, thresholds_[c][m],
                         paper > 0 ? print("%.4f", paper).c_str() : "   -  ",
                         over_runs(runs, [](const Score& s) { return s.false_tracks; }).value, at(10), at(20),
                         at(30), late.value, late.low, late.high, pooled_rms(runs, kLateFrom, kLowSnrFrames),
                         largest->cluster_tracks, largest->cluster_measurements);
            out +=
                m == kLm ? "\n" : (level == tracking::kMaxLevel ? "  exact\n" : print("  >= %.0f\n", level));
        }
        double inexact = 0;
        double split = 0;
        for (const Score& s : scores_[c][kFull]) {
            inexact += s.inexact;
            split += s.split;
        }
        const auto frames = static_cast<double>(scores_[c][kFull].size()) * kLowSnrFrames;
        out += print(
            "full: %.2f clusters a frame past exact JIPDA's 12 to 14 tracks went to level 4 within the "
            "budget, "
            "%.3f past 32\ntracks were cut by existence.\n",
            inexact / frames, split / frames);
        return out;
    }

    std::string claim(const char* what, std::size_t c, const Estimate& e, const char* unit) {
        const char* verdict = verdict_above(e);
        claims_[what].push_back(claim_json("condition", kConditions[c].label, e, verdict));
        return claim_line(kConditions[c].label, 24, e, unit, verdict);
    }

    std::string claims() {
        std::string out = "\nClaims of the paper, late half of the run\n";
        const auto for_each = [&](const char* what, const char* unit, auto value) {
            out += std::string(what) + "\n";
            for (std::size_t c = 0; c < kConditions.size(); ++c) out += claim(what, c, value(c), unit);
        };
        const auto more_found = [&](std::size_t more, std::size_t less) {
            return [this, more, less](std::size_t c) {
                return difference(scores_[c][more], scores_[c][less], late_found);
            };
        };
        const auto better_rms = [&](std::size_t better, std::size_t worse) {
            return [this, better, worse](std::size_t c) {
                const Estimate e = rms_improvement(scores_[c][worse], scores_[c][better]);
                return Estimate{100 * e.value, 100 * e.low, 100 * e.high};
            };
        };
        for_each("level 1 finds more targets than level 0", "points", more_found(1, 0));
        for_each("level 2 finds more targets than level 1", "points", more_found(2, 1));
        for_each("level 3 finds more targets than level 2", "points", more_found(3, 2));
        for_each("level 4 finds more targets than level 3", "points", more_found(4, 3));
        for_each("full finds more targets than level 3", "points", more_found(kFull, 3));
        for_each("LM finds more targets than level 0", "points", more_found(kLm, 0));
        for_each("level 1 finds more targets than LM", "points", more_found(1, kLm));
        for_each("level 1 has less RMS error than level 0", "%", better_rms(1, 0));
        for_each("level 2 has less RMS error than level 1", "%", better_rms(2, 1));
        for_each("level 3 has less RMS error than level 2", "%", better_rms(3, 2));
        for_each("full has less RMS error than level 3", "%", better_rms(kFull, 3));
        for_each("LM has less RMS error than level 0", "%", better_rms(kLm, 0));
        for_each("level 1 has less RMS error than LM", "%", better_rms(1, kLm));
        return out;
    }

    const Scores& scores_;
    const Thresholds& thresholds_;
    std::size_t calibration_;
    nlohmann::json claims_;
};

/// Table 1: processor time a frame of everything the tracker does, one thread.
std::string cost_table(const Thresholds& thresholds, std::uint64_t seed, std::uint64_t runs) {
    std::string out =
        print("\nTable 1. Milliseconds a frame on this machine: mean, longest (paper's mean, i7-6700)\n");
    for (const std::size_t c : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{3}}) {
        out += print("%s\n", kConditions[c].label);
        for (std::size_t m = 0; m < kMethods.size(); ++m) {
            double sum = 0;
            double longest = 0;
            for (std::uint64_t run = 0; run < runs; ++run) {
                const auto frames = simulate_low_snr(kConditions[c].snr_db, seed, kStudyPurpose, run);
                double before = cpu_ms();
                run_tracker(c, m, frames, thresholds[c][m],
                            [&](std::size_t, const PlaneTracker&, const PlaneReport&) {
                                const double now = cpu_ms();
                                sum += now - before;
                                longest = std::max(longest, now - before);
                                before = cpu_ms();
                            });
            }
            const double paper =
                kConditions[c].snr_db < 15 ? kMethods[m].paper_ms_13 : kMethods[m].paper_ms_20;
            out += print("  %-16s%9.3f%9.2f   (%s)\n", kMethods[m].name,
                         sum / static_cast<double>(runs) / kLowSnrFrames, longest,
                         paper > 0 ? print("%.3f", paper).c_str() : "-");
        }
    }
    return out +
           "The longest frame of the paper: 51 ms at level 4, 1429 ms at full level, and runs that never "
           "ended.\n";
}

void draw(const std::filesystem::path& directory, const Scores& scores, std::uint64_t seed) {
    {
        const auto frames = simulate_low_snr(13, seed, kStudyPurpose, 0);
        std::ostringstream points;
        for (const LowSnrFrame& f : frames)
            for (const PlaneMeasurement& m : f.measurements) points << m.z[0] << ' ' << m.z[1] << '\n';
        write_text(directory / "fig01_measurements.dat", points.str());
        std::ostringstream truth;
        for (std::size_t t = 0; t < kTargets.size(); ++t, truth << '\n')
            for (const LowSnrFrame& f : frames) truth << f.truth[t][0] << ' ' << f.truth[t][1] << '\n';
        write_text(directory / "fig01_truth.dat", truth.str());
        run_gnuplot(
            directory, "fig01_scene",
            "set title 'Targets and measurements of 30 frames at 13 dB'\nset size ratio -1\nset grid lc rgb "
            "'#dddddd'\nset xlabel 'x / m'\nset ylabel 'y / m'\nset key outside top right\n"
            "plot 'fig01_measurements.dat' with points pt 7 ps 0.4 lc rgb '#c8a000' title 'measurements', "
            "'fig01_truth.dat' with linespoints pt 2 ps 0.6 lw 2 lc rgb '#000000' title 'targets'\n");
    }
    for (std::size_t c = 0; c < kConditions.size(); ++c) {
        const bool one = kConditions[c].start == TrackStart::one_point;
        const int number = kConditions[c].snr_db < 15 ? 2 : 4;
        const std::string suffix = one ? "one_point" : "two_point";
        const std::string data = print("fig0%d_%s.dat", number, suffix.c_str());
        std::ostringstream out;
        for (int k = 0; k < kLowSnrFrames; ++k) {
            out << k + 1;
            const auto at = static_cast<std::size_t>(k);
            for (std::size_t m = 0; m < kMethods.size(); ++m)
                out << ' '
                    << over_runs(scores[c][m], [&](const Score& s) { return found_percent(s, k, k + 1); })
                           .value
                    << ' ' << pooled_rms(scores[c][m], at, at + 1);
            out << '\n';
        }
        write_text(directory / data, out.str());
        for (const int quantity : {0, 1}) {
            std::ostringstream gp;
            gp << "set grid lc rgb '#dddddd'\nset key outside top right\nset xlabel 'frame'\nset title '"
               << kConditions[c].label << "; thresholds set for " << kConditions[c].false_tracks
               << " confirmed false tracks a run'\nset ylabel '"
               << (quantity == 0 ? "targets with a confirmed true track / %"
                                 : "RMS position error of these / m")
               << "'\nset yrange [" << (quantity == 0 ? "0" : "*<10") << ":*]\nplot ";
            for (std::size_t m = 0; m < kMethods.size(); ++m)
                gp << (m > 0 ? ", " : "") << "'" << data
                   << "' using 1:" << 2 * static_cast<int>(m) + 2 + quantity << " with linespoints lw 2 pt "
                   << m + 1 << " title '" << kMethods[m].name
                   << print(" (%.1f)'",
                            over_runs(scores[c][m], [](const Score& s) { return s.false_tracks; }).value);
            gp << '\n';
            run_gnuplot(
                directory,
                print("fig0%d_%s_%s", number + quantity, quantity == 0 ? "found" : "rms", suffix.c_str()),
                gp.str());
        }
    }
}

}  // namespace

void run_lowsnr(const StudyOptions& options, const StudyRanks& ranks) {
    if (options.pictures && ranks.self().rank == 0) require_gnuplot();
    const std::string configuration =
        print("%s seed %llu, 1", kName, static_cast<unsigned long long>(options.seed));

    StudyWork calibration;
    calibration.name = std::string(kName) + "_calibration";
    calibration.configuration = configuration;
    calibration.units = options.calibration * kConditions.size();
    calibration.run = [&](std::size_t unit) { return calibrate_unit(options.seed, unit); };
    std::vector<double> flat(kConditions.size() * kMethods.size());
    const auto calibrated = run_study_units(calibration, options.run, ranks);
    Thresholds thresholds{};
    if (ranks.self().rank == 0) thresholds = thresholds_from(calibrated);
    for (std::size_t i = 0; i < flat.size(); ++i)
        flat[i] = thresholds[i / kMethods.size()][i % kMethods.size()];
    flat = ranks.spread(flat);
    for (std::size_t i = 0; i < flat.size(); ++i)
        thresholds[i / kMethods.size()][i % kMethods.size()] = flat[i];

    StudyWork work;
    work.name = kName;
    work.configuration = configuration;
    for (const double t : flat) work.configuration += print(" %.17g", t);
    work.units = options.runs * kConditions.size();
    work.run = [&](std::size_t unit) { return study_unit(thresholds, options.seed, unit); };
    const auto units = run_study_units(work, options.run, ranks);
    if (ranks.self().rank != 0) return;

    const Scores scores = scores_from(units);
    const auto& directory = options.run.directory;
    Report report(scores, thresholds, options.calibration);
    const std::string text = report.text();
    const std::string cost = cost_table(thresholds, options.seed, std::min<std::uint64_t>(10, options.runs));
    std::printf("%s%s", text.c_str(), cost.c_str());
    write_text(directory / "lowsnr.txt", text);
    write_text(directory / "lowsnr_cost.txt", cost);
    write_text(directory / "lowsnr.csv", report.csv());
    write_text(directory / "lowsnr.json", report.json().dump(1) + "\n");
    if (options.pictures) draw(directory, scores, options.seed);
    std::printf("\nTables, CSV, JSON and pictures are in %s\n", directory.c_str());
}

}  // namespace sim
