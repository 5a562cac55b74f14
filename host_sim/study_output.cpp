#include "host_sim/study_output.hpp"

#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host_sim/json_fields.hpp"

namespace sim {

const char* verdict_above(const Estimate& e) {
    return e.low > 0 ? "holds" : (e.high < 0 ? "does not hold" : "not decided");
}
const char* verdict_equal(const Estimate& e) {
    return e.low <= 0 && e.high >= 0 ? "holds" : "does not hold";
}

std::string claim_line(const std::string& label, int width, const Estimate& e, const char* unit,
                       const char* verdict) {
    return print("  %-*s %+7.2f %s (%+.2f .. %+.2f)  %s\n", width, label.c_str(), e.value, unit, e.low,
                 e.high, verdict);
}
nlohmann::json claim_json(const char* key, const std::string& label, const Estimate& e, const char* verdict) {
    return {{key, label}, {"value", {e.value, e.low, e.high}}, {"verdict", verdict}};
}

double cpu_ms() {
    std::timespec t{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

void write_text(const std::filesystem::path& file, const std::string& text) {
    std::ofstream out(file);
    if (!(out << text).flush()) throw InputError(file.string() + ": cannot be written");
}

}  // namespace sim
