/// Instructions by stage. The linker (--wrap) puts measuring functions around the firmware's own, which stay
/// as they are.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace target {

enum class Stage : std::uint8_t {
    input_check,  ///< dead, stuck, clipped frames; noise level
    range_fft,    ///< with DC removal and window
    doppler_fft,
    window_power,  ///< Doppler window, log power: range-Doppler transform less the two above
    cfar,          ///< local maxima and OS-CFAR
    peaks,
    association,
    filter,  ///< prediction, gates, update, track life: tracker less association
    warning,
    can,   ///< from the first frame sent to the last: encoding, protection, driver
    rest,  ///< receiving, health, glue
    count_
};
inline constexpr std::size_t kStages = static_cast<std::size_t>(Stage::count_);
inline constexpr std::array<std::string_view, kStages> kStageNames{
    "input check", "range fft", "doppler fft", "window and power", "cfar", "peaks", "association", "filter",
    "warning",     "can",       "rest"};

/// Of one cycle.
extern std::array<std::uint32_t, kStages> stage_instructions;

inline std::uint32_t& instructions_of(Stage stage) {
    return stage_instructions[static_cast<std::size_t>(stage)];
}

/// Measures what the wrappers themselves take, which is left out of every stage from then on. Uses
/// stage_instructions.
void calibrate_stages();

/// What the wrappers took since the last call: part of the whole, but of no stage.
std::uint32_t take_wrapper_instructions();

}  // namespace target
