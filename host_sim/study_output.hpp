/// What every study takes and writes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>

#include "host_sim/study_runner.hpp"

namespace sim {

struct StudyOptions {
    std::size_t runs = 0;  ///< of each condition
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

/// Throws InputError when the file cannot be written.
void write_text(const std::filesystem::path& file, const std::string& text);

}  // namespace sim
