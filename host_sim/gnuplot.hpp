/// Pictures, drawn by the gnuplot program.
#pragma once

#include <filesystem>
#include <string>

namespace sim {

/// Throws InputError, with the remedy, when gnuplot is not installed.
void require_gnuplot();

/// Draws `<directory>/<name>.png`. The commands run in the directory and are kept there as `<name>.gp`;
/// terminal and output are set before them. Returns the picture's path. Throws InputError when gnuplot fails.
std::filesystem::path run_gnuplot(const std::filesystem::path& directory, const std::string& name,
                                  const std::string& commands, int width = 1200, int height = 800);

}  // namespace sim
