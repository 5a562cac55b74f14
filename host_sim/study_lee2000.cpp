#include "host_sim/study_lee2000.hpp"

#include <cstdio>
#include <fstream>
#include <sstream>

#include "host_sim/gnuplot.hpp"
#include "host_sim/json_fields.hpp"
#include "host_sim/study_lee2000_parts.hpp"

namespace sim {

using namespace lee2000;

namespace {

std::string short_number(double v) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%g", v);
    return text.data();
}

Plan read_plan(const std::filesystem::path& directory, std::uint64_t seed) {
    Plan plan;
    const auto file = directory / (std::string(kName) + ".json");
    const nlohmann::json json = read_json_file(file);
    std::ostringstream configuration;
    configuration << kName << " seed " << seed << ' ' << json.dump();
    const auto add_geometry = [&](const std::string& name) {
        const auto path = directory / (name + ".json");
        configuration << ' ' << read_json_file(path).dump();
        plan.geometries.push_back(read_study_geometry(path));
        return plan.geometries.size() - 1;
    };
    const auto refuse = [&](const std::string& reason) { throw InputError(file.string() + ": " + reason); };
    const auto short_name_of = [&](std::size_t geometry) {
        const std::string& name = plan.geometries[geometry].name;
        const std::string prefix = std::string(kName) + "-";
        return name.starts_with(prefix) ? name.substr(prefix.size()) : name;
    };
    const auto add_condition = [&](std::size_t g, const std::string& what, const StudyCondition& seen,
                                   bool base) {
        const auto within = [](double v, double low, double high) { return v >= low && v <= high; };
        if (!within(seen.clutter_density, 0, 1)) refuse("clutter_density must be 0 .. 1");
        if (!within(seen.detection_probability, 0.01, 1)) refuse("detection_probability must be 0.01 .. 1");
        if (!within(seen.spacing, 0.01, 100)) refuse("spacing must be 0.01 .. 100");
        if (!within(seen.gate, 0.1, 100)) refuse("gate must be 0.1 .. 100");
        plan.conditions.push_back({short_name_of(g) + ", " + what, g, seen, base});
    };
    if (!json.is_object()) refuse("must be an object");
    for (const auto& [key, value] : json.items())
        if (key != "description" && key != "geometries" && key != "clutter_density" && key != "sweeps" &&
            key != "unresolved")
            refuse("unknown field \"" + key +
                   "\"; known: description, geometries, clutter_density, sweeps, unresolved");
    try {
        const auto densities = json.at("clutter_density").get<std::vector<double>>();
        const StudyCondition middle;
        for (const auto& name : json.at("geometries")) {
            const std::size_t g = add_geometry(name.get<std::string>());
            for (const double density : densities) {
                StudyCondition seen = middle;
                seen.clutter_density = density;
                const bool base = density == middle.clutter_density;
                if (base && g == 0) plan.pictured = plan.conditions.size();
                add_condition(g, "clutter " + short_number(density), seen, base);
            }
            for (const auto& [axis, values] : json.at("sweeps").items()) {
                for (const double value : values.get<std::vector<double>>()) {
                    StudyCondition seen = middle;
                    if (axis == "clutter_density") {
                        seen.clutter_density = value;
                    } else if (axis == "detection_probability") {
                        seen.detection_probability = value;
                    } else if (axis == "spacing") {
                        seen.spacing = value;
                    } else if (axis == "gate") {
                        seen.gate = value;
                    } else {
                        throw InputError(file.string() + ": sweeps: no axis \"" + axis +
                                         "\"; known: clutter_density, detection_probability, spacing, gate");
                    }
                    const std::string short_name = axis == "clutter_density"         ? "clutter"
                                                   : axis == "detection_probability" ? "PD"
                                                                                     : axis;
                    add_condition(g, short_name + " " + short_number(value), seen, false);
                }
            }
        }
        const auto& unresolved = json.at("unresolved");
        const std::size_t g = add_geometry(unresolved.at("geometry").get<std::string>());
        for (const double density : unresolved.at("clutter_density").get<std::vector<double>>()) {
            StudyCondition seen = middle;
            seen.merging = true;
            seen.clutter_density = density;
            add_condition(g, "clutter " + short_number(density), seen, false);
        }
    } catch (const nlohmann::json::exception& e) {
        throw InputError(file.string() + ": " + e.what());
    }
    for (const StudyFilter& f : lee2000_filters()) configuration << ' ' << f.name;
    plan.configuration = configuration.str();
    return plan;
}

constexpr std::size_t kTrackValues = 7;

void encode(const StudyResult& result, std::vector<double>& out) {
    for (const StudyTrackResult& t : result.track)
        out.insert(out.end(), {t.found, t.own, t.range_estimate, t.rate_estimate, t.range_prediction,
                               t.rate_prediction, t.correct});
    out.insert(out.end(), {result.coalescence, result.switches, result.gospa, result.ospa});
}

RunScore decode(const double*& in, std::size_t targets) {
    RunScore score;
    for (std::size_t t = 0; t < targets; ++t, in += kTrackValues)
        score.track.push_back({in[0], in[1], in[2], in[3], in[4], in[5], in[6]});
    score.coalescence = *in++;
    score.switches = *in++;
    score.gospa = *in++;
    score.ospa = *in++;
    return score;
}

std::vector<double> run_unit(const Plan& plan, const std::vector<StudyFilter>& filters, std::uint64_t seed,
                             std::size_t unit) {
    // Runs outside, conditions inside: more runs later are added at the end.
    const std::size_t c = unit % plan.conditions.size();
    const Condition& condition = plan.conditions[c];
    const StudyGeometry& geometry = plan.geometries[condition.geometry];
    // The conditions of one geometry share their random numbers, so that a sweep compares like with like.
    const StudyRun run =
        simulate_study_run(geometry, condition.seen, seed, condition.geometry, unit / plan.conditions.size());
    std::vector<double> values;
    for (const StudyFilter& filter : filters) {
        const StudyResult result = run_study_filter<double>(filter, geometry, condition.seen, run);
        encode(result, values);
        if (c != plan.pictured || !is_drawn(filter.name)) continue;
        for (const auto& target : result.correct_at)
            values.insert(values.end(), target.begin(), target.end());
    }
    return values;
}

Scores collect(const Plan& plan, const std::vector<StudyFilter>& filters,
               const std::vector<std::vector<double>>& units) {
    Scores scores;
    scores.of.assign(plan.conditions.size(), std::vector<std::vector<RunScore>>(filters.size()));
    for (std::size_t u = 0; u < units.size(); ++u) {
        const std::size_t c = u % plan.conditions.size();
        const std::size_t targets = plan.geometries[plan.conditions[c].geometry].targets.size();
        const double* in = units[u].data();
        std::size_t drawn = 0;
        for (const StudyFilter& f : filters) drawn += c == plan.pictured && is_drawn(f.name) ? 1U : 0U;
        const std::size_t plain = filters.size() * (targets * kTrackValues + 4);
        const std::size_t frames = drawn == 0 ? 0 : (units[u].size() - plain) / (drawn * targets);
        for (std::size_t f = 0; f < filters.size(); ++f) {
            scores.of[c][f].push_back(decode(in, targets));
            if (c != plan.pictured || !is_drawn(filters[f].name)) continue;
            auto& sums = scores.correct_at[filters[f].name];
            sums.resize(targets, std::vector<double>(frames));
            for (auto& target : sums)
                for (double& sum : target) sum += *in++;
        }
    }
    return scores;
}

}  // namespace

void run_lee2000(const StudyOptions& options, const StudyRanks& ranks) {
    const Plan plan =
        read_plan(options.scenarios.empty() ? study_directory() : options.scenarios, options.seed);
    const std::vector<StudyFilter> filters = lee2000_filters();
    if (options.pictures && ranks.self().rank == 0) require_gnuplot();

    StudyWork work;
    work.name = kName;
    work.configuration = plan.configuration;
    work.units = options.runs * plan.conditions.size();
    work.run = [&](std::size_t unit) { return run_unit(plan, filters, options.seed, unit); };
    const std::vector<std::vector<double>> units = run_study_units(work, options.run, ranks);
    if (ranks.self().rank != 0) return;

    const Scores scores = collect(plan, filters, units);
    const auto& directory = options.run.directory;
    const Tables tables = make_tables(plan, filters, scores);
    const std::string cost = cost_table(filters);
    std::printf("%s\n%s", tables.text.c_str(), cost.c_str());
    write_text(directory / "lee2000.txt", tables.text);
    write_text(directory / "lee2000_cost.txt", cost);
    write_text(directory / "lee2000.csv", tables.csv);
    write_text(directory / "lee2000.json", tables.json.dump(1) + "\n");
    if (options.pictures) draw_pictures(directory, plan, filters, scores, options.seed);
    std::printf("\nTables, CSV, JSON and pictures are in %s\n", directory.c_str());
}

}  // namespace sim
