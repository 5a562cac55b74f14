#include "host_sim/study_output.hpp"

#include <fstream>

#include "host_sim/json_fields.hpp"

namespace sim {

void write_text(const std::filesystem::path& file, const std::string& text) {
    std::ofstream out(file);
    if (!(out << text).flush()) throw InputError(file.string() + ": cannot be written");
}

}  // namespace sim
