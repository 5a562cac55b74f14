/// The chirp sequence the front end transmits, and what a cell of its range-Doppler map means.
#pragma once

#include <cstdint>

#include "dsp/fixed_point.hpp"

namespace dsp {

inline constexpr int kSamples = 64;     ///< real samples a chirp
inline constexpr int kChirps = 64;      ///< chirps a frame
inline constexpr int kRangeCells = 32;  ///< positive half of the range spectrum of a real signal
inline constexpr int kDopplerCells = kChirps;

/// Metres and metres per second of a cell, as the detection stage uses them.
struct CellScale {
    Real range_cell_m;    ///< range of one range cell
    Real range_offset_m;  ///< range of cell 0 (not zero only for band-selected recordings)
    Real rate_cell_mps;   ///< range rate of one Doppler cell
    Real coupling_s;      ///< the range peak of a target at rate v sits at r + coupling * v
};

/// Primary values of a waveform; everything else derives from them. Defaults: Lee and Kim 2000, table 4.
struct Waveform {
    std::int64_t carrier_hz = 77'000'000'000;  ///< centre of the sampled part of the sweep
    std::int64_t bandwidth_hz = 30'000'000;    ///< swept while the kSamples samples are taken, up-sweep
    std::int64_t sample_rate_hz = 2'000'000;   ///< real samples
    std::int64_t chirp_interval_ns = 32'000;   ///< start of a chirp to start of the next
    std::int64_t range_offset_um = 0;          ///< range of cell 0
    std::int32_t period_ms = 100;              ///< start of a frame to start of the next

    static constexpr std::int64_t speed_of_light_mps = 299'792'458;

    /// c / 2B, in micrometres.
    [[nodiscard]] constexpr std::int64_t range_cell_um() const {
        return round_divide<std::int64_t>(speed_of_light_mps * 1'000'000, 2 * bandwidth_hz);
    }
    /// c / (2 f_c * kChirps * chirp interval), in micrometres per second.
    [[nodiscard]] constexpr std::int64_t rate_cell_umps() const {
        const std::int64_t frame_ns = chirp_interval_ns * kChirps;
        const std::int64_t carrier_khz = carrier_hz / 1000;
        return round_divide<std::int64_t>(speed_of_light_mps * 1'000'000,
                                          2 * carrier_khz * frame_ns / 1'000'000);
    }
    /// Time the kSamples samples of a chirp take.
    [[nodiscard]] constexpr std::int64_t sampled_ns() const {
        return std::int64_t{kSamples} * 1'000'000'000 / sample_rate_hz;
    }
    /// f_c * T / B: a Doppler shift 2v/lambda moves the beat frequency, and with it the apparent range, by v
    /// times this. In nanoseconds.
    [[nodiscard]] constexpr std::int64_t coupling_ns() const {
        return round_divide<std::int64_t>(carrier_hz / 1000 * sampled_ns(), bandwidth_hz / 1000);
    }
    [[nodiscard]] constexpr CellScale scale() const {
        return {Real::ratio(range_cell_um(), 1'000'000), Real::ratio(range_offset_um, 1'000'000),
                Real::ratio(rate_cell_umps(), 1'000'000), Real::ratio(coupling_ns(), 1'000'000'000)};
    }
    /// Within what the formats carry and physics allows.
    [[nodiscard]] constexpr bool valid() const {
        return carrier_hz >= 1'000'000'000 && carrier_hz <= 300'000'000'000 && bandwidth_hz >= 1'000'000 &&
               bandwidth_hz <= 10'000'000'000 && sample_rate_hz >= 100'000 && sample_rate_hz <= 100'000'000 &&
               chirp_interval_ns >= sampled_ns() && chirp_interval_ns <= 1'000'000 && range_offset_um >= 0 &&
               range_offset_um <= 100'000'000 && period_ms >= 10 && period_ms <= 1000 &&
               kChirps * chirp_interval_ns <= std::int64_t{period_ms} * 1'000'000 &&
               coupling_ns() < 1'000'000'000;
    }
};

inline constexpr Waveform kDefaultWaveform{};
static_assert(kDefaultWaveform.valid());
static_assert(kDefaultWaveform.range_cell_um() == 4'996'541);  // 4.997 m, 32 cells to 159.9 m
static_assert(kDefaultWaveform.rate_cell_umps() == 950'539);   // 3.42 km/h, +-30.42 m/s
static_assert(kDefaultWaveform.coupling_ns() == 82'133'333);   // 2.46 m at 30 m/s

}  // namespace dsp
