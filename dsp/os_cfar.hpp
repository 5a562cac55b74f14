/// Ordered-statistic constant-false-alarm-rate detection on the logarithmic map (Rohling 1983).
#pragma once

#include <array>
#include <cstdint>

#include "dsp/range_doppler.hpp"

namespace dsp {

/// A set of map cells: bit d of row[r] is range cell r, Doppler cell d.
struct CellMask {
    std::array<std::uint64_t, kRangeCells> row{};
    [[nodiscard]] constexpr bool test(int r, int d) const {
        return ((row[static_cast<std::size_t>(r)] >> d) & 1U) != 0;
    }
    constexpr void set(int r, int d) { row[static_cast<std::size_t>(r)] |= std::uint64_t{1} << d; }
};

/// The reference cells form a cross around the cell under test: arms along Doppler (cyclic) and short ones
/// along range. Along range alone a ridge of stationary clutter (one Doppler column) or cars at one velocity
/// mask each other, along Doppler alone cars at one range do. With a cross they reach only the arm they lie
/// on, and a rank below the usual 3N/4 tolerates that arm lost; it costs 0.3 dB. Measured with four cars in
/// one row 15 dB apart, five in one column 20 dB apart, and a car 4 cells beside a ridge: this default finds
/// the weak one always, N = 16, k = 12 along Doppler never in the row and in 85 % beside the ridge.
struct CfarConfig {
    std::int16_t doppler_guard = 2;      ///< cells left out on each side, 0..8: half the main lobe
    std::int16_t doppler_reference = 8;  ///< reference cells on each side, 0..16
    std::int16_t range_guard = 2;        ///< as above, 0..8
    std::int16_t range_reference =
        2;  ///< 0..8; at the ends of the map the missing ones come from the other side
    /// Distance of reference cells from one another, 1..2. Neighbours of a windowed spectrum are correlated
    /// (Hann: 0.44 in power); at every second cell they are as good as independent, as the threshold assumes.
    std::int16_t spacing = 2;
    std::int16_t rank = 12;  ///< k of the k-th smallest of all N; higher: less loss, masks sooner. 1..N
    std::int16_t first_range_cell = 2;       ///< cells below it hold leakage: neither tested nor used. 0..8
    std::int32_t false_alarm_ppb = 100'000;  ///< design Pfa of a cell in 1e-9, 1'000..100'000'000
    std::int16_t offset_cdb = 0;             ///< added to the threshold, hundredths of a decibel, -300..2000

    constexpr bool operator==(const CfarConfig&) const = default;
    [[nodiscard]] constexpr int reference_cells() const { return 2 * (doppler_reference + range_reference); }
    [[nodiscard]] constexpr bool valid() const {
        return doppler_guard >= 0 && doppler_guard <= 8 && doppler_reference >= 0 &&
               doppler_reference <= 16 && range_guard >= 0 && range_guard <= 8 && range_reference >= 0 &&
               range_reference <= 8 && spacing >= 1 && spacing <= 2 && reference_cells() >= 1 && rank >= 1 &&
               rank <= reference_cells() && first_range_cell >= 0 && first_range_cell <= 8 &&
               2 * (doppler_guard + spacing * doppler_reference) < kDopplerCells &&
               range_guard + spacing * 2 * range_reference <= (kRangeCells - first_range_cell) / 2 &&
               false_alarm_ppb >= 1'000 && false_alarm_ppb <= 100'000'000 && offset_cdb >= -300 &&
               offset_cdb <= 2000;
    }
};
static_assert(CfarConfig{}.valid());

inline constexpr int kMaxRangeReference = 8;  ///< on each side
inline constexpr int kMaxReferenceCells = 2 * (16 + kMaxRangeReference);

/// log2 of the threshold factor alpha, Q6.10: the solution of prod_{i<k} (N-i)/(N-i+alpha) = Pfa for
/// exponentially distributed power (square-law cells), by bisection in integers. Error below one step.
/// For start-up: some 10^5 instructions.
std::int32_t os_cfar_alpha(int cells, int rank, std::int32_t false_alarm_ppb);

/// log2 of mean noise power over the expected k-th smallest of N exponential cells, Q6.10:
/// -log2 sum_{i<k} 1/(N-i).
std::int32_t os_cfar_noise_offset(int cells, int rank);

/// The detector for one configuration, its threshold derived once.
class OsCfar {
  public:
    /// `config.valid()` must hold.
    explicit OsCfar(const CfarConfig& config);
    [[nodiscard]] const CfarConfig& config() const { return config_; }
    /// log2 alpha with the offset, Q6.10.
    [[nodiscard]] std::int32_t threshold() const { return threshold_; }

    /// x > alpha X_(k), exactly, without sorting: in logarithms x - log2 alpha > X_(k), which holds if and
    /// only if at least k reference cells are smaller than x - log2 alpha.
    [[nodiscard]] bool detects(const PowerMap& map, int range_cell, int doppler_cell) const;

    /// The k-th smallest reference cell scaled to the mean noise power, log2 Q6.10; not below 0. Some 280
    /// instructions for the default window, independent of the cells' values; 50 more for another rank, 80
    /// for another window with up to 20 reference cells; for more cells, 5 each in 16 rounds.
    [[nodiscard]] std::int32_t noise(const PowerMap& map, int range_cell, int doppler_cell) const;

    /// No cell that detects() finds is less than this over its noise(): log2, Q6.10.
    [[nodiscard]] std::int32_t least_snr() const {
        return threshold_ - (noise_offset_ > 0 ? noise_offset_ : 0);
    }

  private:
    CfarConfig config_;
    std::int32_t threshold_;
    std::int32_t noise_offset_;
};

/// The cells over threshold (OsCfar::detects) that are larger than their eight neighbours (Doppler cyclic),
/// whatever `level` is. The row below first_range_cell is a neighbour too: the flank of the leakage is no
/// maximum. Of equal neighbours the one later in memory is larger, so a plateau gives one maximum. Rows below
/// first_range_cell have none.
///
/// Fast because most cells of noise need no look at their neighbours or reference cells: compares of upper
/// bytes, four cells in a word, give those that are at least `level`; where enough reference cells are,
/// counted for 32 cells at once, nothing that is less than the threshold over `level` can be a target. The
/// few others are compared with their neighbours, and maxima with their reference cells; where a row has
/// many, its cells are compared with the rows beside it two at once, and several maxima share the copy of the
/// row that lays their reference cells side by side.
/// `level`: log2 power, Q6.10, rounded down to a quarter octave; best about one octave below the median of
/// the map. Windows with less than eight reference cells on each side along Doppler do without. Cost: about 8
/// instructions a cell of noise, at most some 40 (see `toolchains/target_report.py`); more for windows other
/// than eight reference cells on each side along Doppler and two along range, with a spacing of 2.
void cfar_peaks(const PowerMap& map, const OsCfar& cfar, std::uint16_t level, CellMask& peaks);

}  // namespace dsp
