/// What every study takes and writes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "host_sim/study_runner.hpp"
#include "host_sim/study_statistics.hpp"

namespace sim {

struct StudyOptions {
    std::size_t runs = 0;           ///< of each condition
    std::size_t calibration = 200;  ///< more runs of each, of studies that set thresholds by some
    std::uint64_t seed = 1;
    bool pictures = true;
    std::filesystem::path scenarios;  ///< of studies that read some; empty: the shipped ones
    StudyRunOptions run;
};

/// printf into a string, at most 1023 characters; without values the text as it is.
template <class... Values>
std::string print(const char* format, Values... values) {
    if constexpr (sizeof...(values) == 0) {
        return format;
    } else {
        std::array<char, 1024> text{};
        std::snprintf(text.data(), text.size(), format, values...);
        return text.data();
    }
}

/// What a 95 % interval says of "it is above zero", and of "it is zero".
const char* verdict_above(const Estimate& e);
const char* verdict_equal(const Estimate& e);

/// One line of a study's claims: label, value with its interval, verdict.
std::string claim_line(const std::string& label, int width, const Estimate& e, const char* unit,
                       const char* verdict);
/// The same for JSON, under "value" and "verdict"; the label is put under `key`.
nlohmann::json claim_json(const char* key, const std::string& label, const Estimate& e, const char* verdict);

/// Processor time of this thread.
double cpu_ms();
/// The least that `measure`, a time in ms, returns of `most` calls; of long ones as many as begin within 0.1
/// s.
template <class Measure>
double best_of(int most, Measure measure) {
    const double start = cpu_ms();
    double best = measure();
    for (int i = 1; i < most && cpu_ms() - start < 100; ++i) best = std::min(best, measure());
    return best;
}

/// Throws InputError when the file cannot be written.
void write_text(const std::filesystem::path& file, const std::string& text);

}  // namespace sim
