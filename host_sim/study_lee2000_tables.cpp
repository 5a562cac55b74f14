#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <sstream>

#include "host_sim/study_lee2000_parts.hpp"

namespace sim::lee2000 {

namespace {

template <class Value>
double over_tracks(const RunScore& run, Value value) {
    double sum = 0;
    for (const StudyTrackResult& t : run.track) sum += value(t);
    return sum / static_cast<double>(run.track.size());
}
using Error = double StudyTrackResult::*;
struct Quantity {
    const char* name;
    const char* unit;
    Error error;
};
constexpr std::array<Quantity, 4> kQuantities{
    {{"range estimate", "m", &StudyTrackResult::range_estimate},
     {"rate estimate", "m/s", &StudyTrackResult::rate_estimate},
     {"range prediction", "m", &StudyTrackResult::range_prediction},
     {"rate prediction", "m/s", &StudyTrackResult::rate_prediction}}};

constexpr std::size_t kEstimates = 2;  ///< of these, the first are of estimates

/// Root mean square errors of each run in which the track was kept on its own target.
std::vector<double> kept_errors(const Runs& runs, std::size_t target, Error error) {
    std::vector<double> kept;
    for (const RunScore& r : runs)
        if (r.track[target].own > 0) kept.push_back(std::sqrt(r.track[target].*error));
    return kept;
}
double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return values.empty() ? std::nan("") : std::sqrt(sum / static_cast<double>(values.size()));
}

Estimate improvement(const Runs& from, const Runs& to, Error error) {
    std::vector<ErrorPair> pairs;
    for (std::size_t r = 0; r < from.size(); ++r)
        for (std::size_t t = 0; t < from[r].track.size(); ++t)
            if (from[r].track[t].own > 0 && to[r].track[t].own > 0)
                pairs.push_back({r, from[r].track[t].*error, to[r].track[t].*error});
    return improvement_of(pairs, from.size());
}

/// Lost by the first less lost by the second, in points.
Estimate fewer_lost(const Runs& first, const Runs& second) {
    std::vector<double> difference;
    for (std::size_t r = 0; r < first.size(); ++r) difference.push_back(lost(first[r]) - lost(second[r]));
    return mean_of(difference);
}

class Report {
  public:
    Report(const Plan& plan, const std::vector<StudyFilter>& filters, const Scores& scores)
        : plan_(plan), filters_(filters), scores_(scores) {
        for (std::size_t f = 0; f < filters.size(); ++f) index_[filters[f].name] = f;
    }

    std::string text() {
        std::ostringstream out;
        const std::size_t runs = scores_.of[0][0].size();
        out << print("%zu runs of each of %zu conditions; intervals are 95 %%.\n", runs,
                     plan_.conditions.size())
            << print(
                   "A target is lost when no track is within %g m and %g m/s of it in most of the last %d "
                   "frames; its "
                   "own\ntrack is lost when that of the start is not. RMS over own tracks kept.\n",
                   kKept_m, kKept_mps, kLastFrames);
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c)
            if (plan_.conditions[c].base) out << paper_tables(c);
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c) out << condition_table(c);
        out << claims();
        return out.str();
    }

    [[nodiscard]] std::string csv() const {
        std::ostringstream out;
        out << "condition,clutter_density,detection_probability,spacing,gate,unresolved,filter,target,metric,"
               "value,low,"
               "high\n";
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c) {
            const StudyCondition& s = plan_.conditions[c].seen;
            for (std::size_t f = 0; f < filters_.size(); ++f) {
                const std::string head = print("\"%s\",%g,%g,%g,%g,%d,%s,", plan_.conditions[c].label.c_str(),
                                               s.clutter_density, s.detection_probability, s.spacing, s.gate,
                                               s.merging ? 1 : 0, filters_[f].name.c_str());
                for (const auto& [name, e] : summary(scores_.of[c][f]))
                    out << head << print("all,%s,%.6g,%.6g,%.6g\n", name.c_str(), e.value, e.low, e.high);
                const Runs& all = scores_.of[c][f];
                for (std::size_t t = 0; t < all[0].track.size(); ++t) {
                    const auto target = [&](const char* metric, double value) {
                        out << head << print("%zu,%s,%.6g,,\n", t + 1, metric, value);
                    };
                    const auto kept = kept_errors(all, t, &StudyTrackResult::range_estimate);
                    target("own_lost_percent",
                           100 - 100 * static_cast<double>(kept.size()) / static_cast<double>(all.size()));
                    for (const Quantity& q : kQuantities) {
                        const auto errors = kept_errors(all, t, q.error);
                        std::string name = q.name;
                        std::replace(name.begin(), name.end(), ' ', '_');
                        target((name + "_rms").c_str(), rms(errors));
                        target((name + "_median").c_str(), median_of(errors));
                    }
                }
            }
        }
        return out.str();
    }

    [[nodiscard]] nlohmann::json json() const {
        nlohmann::json out;
        out["study"] = kName;
        out["runs"] = scores_.of[0][0].size();
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c) {
            nlohmann::json condition;
            condition["condition"] = plan_.conditions[c].label;
            for (std::size_t f = 0; f < filters_.size(); ++f)
                for (const auto& [name, e] : summary(scores_.of[c][f]))
                    condition["filters"][filters_[f].name][name] = {e.value, e.low, e.high};
            out["conditions"].push_back(condition);
        }
        out["claims"] = claims_json_;
        return out;
    }

    [[nodiscard]] const Runs& runs(std::size_t condition, const std::string& filter) const {
        return scores_.of[condition][index_.at(filter)];
    }

  private:
    static std::vector<std::pair<std::string, Estimate>> summary(const Runs& runs) {
        const auto errors = [&](Error error) {
            std::vector<double> all;
            for (std::size_t t = 0; t < runs[0].track.size(); ++t)
                for (const double v : kept_errors(runs, t, error)) all.push_back(v);
            return all;
        };
        const auto point = [](double v) { return Estimate{v, std::nan(""), std::nan("")}; };
        return {
            {"lost_percent", over_runs(runs, lost)},
            {"own_lost_percent", over_runs(runs, own_lost)},
            {"coalescence_percent", over_runs(runs, [](const RunScore& r) { return 100 * r.coalescence; })},
            {"identity_switches", over_runs(runs, [](const RunScore& r) { return r.switches; })},
            {"gospa_m", over_runs(runs, [](const RunScore& r) { return r.gospa; })},
            {"ospa_m", over_runs(runs, [](const RunScore& r) { return r.ospa; })},
            {"p_correct", over_runs(runs,
                                    [](const RunScore& r) {
                                        return over_tracks(
                                            r, [](const StudyTrackResult& t) { return t.correct; });
                                    })},
            {"range_rms_m", point(rms(errors(&StudyTrackResult::range_estimate)))},
            {"rate_rms_mps", point(rms(errors(&StudyTrackResult::rate_estimate)))},
            {"range_median_m", point(median_of(errors(&StudyTrackResult::range_estimate)))},
            {"rate_median_mps", point(median_of(errors(&StudyTrackResult::rate_estimate)))}};
    }

    [[nodiscard]] std::string paper_tables(std::size_t c) const {
        std::ostringstream out;
        const auto table = [&](const std::string& title, std::size_t first, bool median) {
            out << '\n' << title << '\n' << print("%-15s", "");
            const std::size_t targets = scores_.of[c][0][0].track.size();
            for (std::size_t q = first; q < first + 2; ++q)
                for (std::size_t t = 0; t < targets; ++t)
                    out << print("%9s", print("%s %zu", q == first ? "range" : "rate", t + 1).c_str());
            out << '\n';
            for (std::size_t f = 0; f < filters_.size(); ++f) {
                out << print("%-15s", filters_[f].name.c_str());
                for (std::size_t q = first; q < first + 2; ++q) {
                    for (std::size_t t = 0; t < targets; ++t) {
                        const auto kept = kept_errors(scores_.of[c][f], t, kQuantities[q].error);
                        if (2 * kept.size() < scores_.of[c][f].size()) {
                            out << print("%9s", "-");
                        } else {
                            out << print("%9.3f", median ? median_of(kept) : rms(kept));
                        }
                    }
                }
                out << '\n';
            }
        };
        const std::string where = " (" + plan_.conditions[c].label + "; - : lost in most runs)";
        table("Table 1. RMS estimation error, m and m/s" + where, 0, false);
        table("Table 1, median over the runs" + where, 0, true);
        table("Table 2. RMS prediction error, m and m/s" + where, 2, false);
        return out.str();
    }

    [[nodiscard]] std::string condition_table(std::size_t c) const {
        std::ostringstream out;
        const StudyCondition& s = plan_.conditions[c].seen;
        out << print("\n%s  (clutter %g a frame per m (m/s), PD %g, spacing %g, gate %g)\n",
                     plan_.conditions[c].label.c_str(), s.clutter_density, s.detection_probability, s.spacing,
                     s.gate)
            << print("%-15s%15s%15s%10s%10s%15s%8s%9s%9s%8s\n", "", "lost %", "own lost %", "merged %",
                     "switches", "GOSPA m", "OSPA m", "range m", "rate m/s", "P(corr)");
        for (std::size_t f = 0; f < filters_.size(); ++f) {
            std::map<std::string, Estimate> s_of;
            for (const auto& [name, e] : summary(scores_.of[c][f])) s_of[name] = e;
            const auto with_interval = [](const Estimate& e, const char* format) {
                return print(format, e.value, e.high - e.value);
            };
            out << print("%-15s%15s%15s%10.1f%10.2f%15s%8.2f%9.3f%9.3f%8.3f\n", filters_[f].name.c_str(),
                         with_interval(s_of["lost_percent"], "%.1f +-%.1f").c_str(),
                         with_interval(s_of["own_lost_percent"], "%.1f +-%.1f").c_str(),
                         s_of["coalescence_percent"].value, s_of["identity_switches"].value,
                         with_interval(s_of["gospa_m"], "%.2f +-%.2f").c_str(), s_of["ospa_m"].value,
                         s_of["range_rms_m"].value, s_of["rate_rms_mps"].value, s_of["p_correct"].value);
        }
        return out.str();
    }

    std::string claims() {
        std::ostringstream out;
        out << "\nClaim: NN, PDA and JPDA lose or merge close targets (lost % / own track lost % / merged % "
               "of the "
               "frames)\n";
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c) {
            out << print("  %-32s", plan_.conditions[c].label.c_str());
            for (const char* name : {"nn", "pda", "jpda", "ospda(4)", "osjpda(6)", "ospda"}) {
                const Runs& r = runs(c, name);
                out << print("  %s %.1f/%.1f/%.1f", name, over_runs(r, lost).value,
                             over_runs(r, own_lost).value,
                             over_runs(r, [](const RunScore& x) { return 100 * x.coalescence; }).value);
            }
            out << '\n';
        }
        out << improvement_claim("pda", "ospda(4)", 18) << improvement_claim("jpda", "osjpda(6)", 19)
            << improvement_claim("pda", "ospda", 18) << improvement_claim("jpda", "ospda", 0);

        out << "\nThe radar's OSPDA: at most half of PDA's losses, and at most 2 points more than exact "
               "JPDA\n"
            << print("  %-32s%14s%14s%14s%26s%26s\n", "", "PDA lost %", "JPDA lost %", "OSPDA lost %",
                     "fewer than PDA, points", "fewer than JPDA, points");
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c) {
            const double pda = over_runs(runs(c, "pda"), lost).value;
            const double jpda = over_runs(runs(c, "jpda"), lost).value;
            const double ospda = over_runs(runs(c, "ospda"), lost).value;
            const Estimate to_pda = fewer_lost(runs(c, "pda"), runs(c, "ospda"));
            const Estimate to_jpda = fewer_lost(runs(c, "jpda"), runs(c, "ospda"));
            const bool halved = 2 * ospda <= pda;
            const bool near = to_jpda.value >= -2;
            out << print("  %-32s%14.1f%14.1f%14.1f%26s%26s  %s, %s\n", plan_.conditions[c].label.c_str(),
                         pda, jpda, ospda,
                         print("%.1f (%.1f .. %.1f)", to_pda.value, to_pda.low, to_pda.high).c_str(),
                         print("%.1f (%.1f .. %.1f)", to_jpda.value, to_jpda.low, to_jpda.high).c_str(),
                         halved ? "halved" : "NOT halved", near ? "near JPDA" : "NOT near JPDA");
            claims_json_["default"].push_back({{"condition", plan_.conditions[c].label},
                                               {"pda_lost_percent", pda},
                                               {"jpda_lost_percent", jpda},
                                               {"ospda_lost_percent", ospda},
                                               {"halved", halved},
                                               {"within_2_points_of_jpda", near}});
        }
        return out.str();
    }

    std::string improvement_claim(const std::string& from, const std::string& to, double claimed) {
        std::ostringstream out;
        out << print(
            "\nClaim: %s at least %g %% more accurate than %s (%% less RMS error on tracks both kept; loss "
            "in "
            "points)\n  %-32s",
            to.c_str(), claimed, from.c_str(), "");
        for (std::size_t q = 0; q < kEstimates; ++q) out << print("%22s", kQuantities[q].name);
        out << print("%14s%22s\n", "both kept %", "fewer lost");
        for (std::size_t c = 0; c < plan_.conditions.size(); ++c) {
            const Runs& a = runs(c, from);
            const Runs& b = runs(c, to);
            out << print("  %-32s", plan_.conditions[c].label.c_str());
            std::size_t above = 0;
            std::size_t below = 0;
            nlohmann::json entry{{"condition", plan_.conditions[c].label}};
            for (std::size_t i = 0; i < kQuantities.size(); ++i) {
                const Quantity& q = kQuantities[i];
                const Estimate e = improvement(a, b, q.error);
                entry[q.name] = {100 * e.value, 100 * e.low, 100 * e.high};
                if (i >= kEstimates) continue;  // predictions tell the same
                above += 100 * e.low >= claimed ? 1U : 0U;
                below += 100 * e.high < claimed ? 1U : 0U;
                out << print("%22s",
                             print("%.0f (%.0f .. %.0f)", 100 * e.value, 100 * e.low, 100 * e.high).c_str());
            }
            double both = 0;
            for (std::size_t r = 0; r < a.size(); ++r)
                for (std::size_t t = 0; t < a[r].track.size(); ++t)
                    both += a[r].track[t].own > 0 && b[r].track[t].own > 0 ? 1 : 0;
            both *= 100 / static_cast<double>(a.size() * a[0].track.size());
            const Estimate fewer = fewer_lost(a, b);
            const char* verdict = above == kEstimates   ? "holds"
                                  : below == kEstimates ? "does not hold"
                                                        : "in part";
            out << print("%14.0f%22s  %s\n", both,
                         print("%.1f (%.1f .. %.1f)", fewer.value, fewer.low, fewer.high).c_str(), verdict);
            entry["fewer_lost"] = {fewer.value, fewer.low, fewer.high};
            entry["verdict"] = verdict;
            claims_json_[to + " over " + from].push_back(entry);
        }
        return out.str();
    }

    const Plan& plan_;
    const std::vector<StudyFilter>& filters_;
    const Scores& scores_;
    std::map<std::string, std::size_t> index_;
    nlohmann::json claims_json_;
};

/// Microseconds of one association of 4 tracks, each with the same 7 measurements in its gate.
template <class S>
double association_us(const StudyFilter& filter) {
    tracking::OrderStatisticsConfig<S> order;
    order.alpha = tracking::constant<S>(static_cast<std::int64_t>(filter.order.alpha));
    order.precedence = filter.order.precedence;
    order.missed = filter.order.missed;
    order.reduced = filter.order.reduced;
    order.reduction = filter.order.reduction;
    order.covariance = filter.order.covariance;
    std::vector<tracking::AssociationRow<S>> rows(4);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        rows[t].log_missed = tracking::constant<S>(-23, 10);
        rows[t].count = 7;
        for (std::size_t j = 0; j < 7; ++j) {
            rows[t].item[j].measurement = static_cast<std::uint16_t>(j);
            rows[t].item[j].log_ratio = tracking::constant<S>(static_cast<int>((3 * t + 5 * j) % 11) - 4);
        }
    }
    const auto work = std::make_unique<tracking::JpdaWorkspace<S>>();
    return best_of(20, [&] {
        constexpr int kRepeats = 20;
        const double before = cpu_ms();
        for (int i = 0; i < kRepeats; ++i) tracking::associate<S>(rows, filter.associator, order, *work);
        return 1e3 * (cpu_ms() - before) / kRepeats;
    });
}

}  // namespace

double lost(const RunScore& run) {
    return over_tracks(run, [](const StudyTrackResult& t) { return 100 * (1 - t.found); });
}
double own_lost(const RunScore& run) {
    return over_tracks(run, [](const StudyTrackResult& t) { return 100 * (1 - t.own); });
}

Tables make_tables(const Plan& plan, const std::vector<StudyFilter>& filters, const Scores& scores) {
    Report report(plan, filters, scores);
    Tables tables;
    tables.text = report.text();  // first: it works out the claims
    tables.csv = report.csv();
    tables.json = report.json();
    return tables;
}

std::string cost_table(const std::vector<StudyFilter>& filters) {
    std::string out =
        "Table 3. Association of 4 targets and 7 measurements, microseconds on this machine (best of 20)\n";
    out += print("%-15s%12s%14s\n", "", "double", "fixed point");
    for (const char* name : {"nn", "pda", "ospda(4)", "jpda", "osjpda(6)", "ospda", "osjpda"})
        for (const StudyFilter& f : filters)
            if (f.name == name)
                out += print("%-15s%12.2f%14.2f\n", name, association_us<double>(f),
                             association_us<dsp::Real>(f));
    return out;
}

}  // namespace sim::lee2000
