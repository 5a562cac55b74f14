/// Tables of numbers with named columns.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "host_sim/json_fields.hpp"

namespace sim {

/// Rows with the named columns in the order asked for, whatever their order in the file; other columns are
/// not looked at. Throws InputError with file and line for a missing column, a row of another length, or a
/// value that is not a finite number, and for a file without rows.
std::vector<std::vector<double>> read_csv(const std::filesystem::path& file,
                                          std::initializer_list<std::string_view> columns);

/// Throws InputError when a column's value is negative or falls from one row to the next.
void require_ascending(const std::filesystem::path& file, const std::vector<std::vector<double>>& rows,
                       std::size_t column, std::string_view name);

}  // namespace sim
