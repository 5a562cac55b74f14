#include "host_sim/csv.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>

namespace sim {

namespace {

std::vector<std::string_view> split(std::string_view line) {
    constexpr std::string_view kBlank = " \t\r";  // some writers put line ends into the middle of a row
    std::vector<std::string_view> cells;
    for (;;) {
        const auto comma = line.find(',');
        auto cell = line.substr(0, comma);
        cell.remove_prefix(std::min(cell.find_first_not_of(kBlank), cell.size()));
        cell.remove_suffix(cell.size() - 1 - cell.find_last_not_of(kBlank));
        cells.push_back(cell);
        if (comma == std::string_view::npos) return cells;
        line.remove_prefix(comma + 1);
    }
}

[[noreturn]] void fail(const std::filesystem::path& file, std::size_t line, const std::string& reason) {
    throw InputError(file.string() + ":" + std::to_string(line) + ": " + reason);
}

}  // namespace

std::vector<std::vector<double>> read_csv(const std::filesystem::path& file,
                                          std::initializer_list<std::string_view> columns) {
    std::ifstream in(file);
    if (!in || std::filesystem::is_directory(file)) throw InputError(file.string() + ": cannot be read");
    std::string line;
    if (!std::getline(in, line)) throw InputError(file.string() + ": is empty");
    const std::string header = line;
    const auto names = split(header);
    std::vector<std::size_t> where;
    for (const auto column : columns) {
        const auto it = std::find(names.begin(), names.end(), column);
        if (it == names.end()) fail(file, 1, "no column named " + std::string(column));
        where.push_back(static_cast<std::size_t>(it - names.begin()));
    }
    std::vector<std::vector<double>> rows;
    for (std::size_t number = 2; std::getline(in, line); ++number) {
        if (line.empty() || line == "\r") continue;
        const auto cells = split(line);
        if (cells.size() != names.size())
            fail(file, number,
                 std::to_string(cells.size()) + " values, the header has " + std::to_string(names.size()));
        auto& row = rows.emplace_back();
        for (const auto index : where) {
            const auto cell = cells[index];
            double value = 0;
            const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
            if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value))
                fail(file, number,
                     std::string(names[index]) + ": not a finite number: \"" + std::string(cell) + "\"");
            row.push_back(value);
        }
    }
    if (rows.empty()) throw InputError(file.string() + ": no rows below the header");
    return rows;
}

void require_ascending(const std::filesystem::path& file, const std::vector<std::vector<double>>& rows,
                       std::size_t column, std::string_view name) {
    double last = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const double value = rows[i][column];
        if (value < 0) fail(file, i + 2, std::string(name) + ": is negative");
        if (value < last) fail(file, i + 2, std::string(name) + ": is less than in the row before");
        last = value;
    }
}

}  // namespace sim
