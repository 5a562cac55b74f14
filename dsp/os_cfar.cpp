#include "dsp/os_cfar.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"

namespace dsp {

namespace {

/// log2(v / 2^20) in Q20 for v > 0, exact to its last place but one.
std::int64_t log2_q20(std::uint64_t v) {
    const int octave = static_cast<int>(std::bit_width(v)) - 1;
    const auto mantissa = static_cast<std::uint32_t>(octave >= 30 ? v >> (octave - 30) : v << (30 - octave));
    return (std::int64_t{octave} - 20) * (std::int64_t{1} << 20) +
           (detail::log2_fraction_q30(mantissa) >> 10);
}

}  // namespace

std::int32_t os_cfar_alpha(int cells, int rank, std::int32_t false_alarm_ppb) {
    // -log2 Pfa = sum_i log2(1 + alpha/(N-i)); the sum grows with alpha.
    const std::int64_t wanted =
        log2_q20(1'000'000'000ULL << 20) - log2_q20(static_cast<std::uint64_t>(false_alarm_ppb) << 20);
    std::uint64_t low = 0;                        // alpha in Q20
    std::uint64_t high = std::uint64_t{1} << 50;  // 2^30: Pfa 1e-9 with N = k = 1
    while (high - low > 1) {
        const std::uint64_t alpha = low + (high - low) / 2;
        std::int64_t sum = 0;
        for (int i = 0; i < rank; ++i) {
            sum += log2_q20((std::uint64_t{1} << 20) + alpha / static_cast<std::uint64_t>(cells - i));
        }
        (sum < wanted ? low : high) = alpha;
    }
    return static_cast<std::int32_t>(round_shift(log2_q20(high), 20 - kLogBits));
}

std::int32_t os_cfar_noise_offset(int cells, int rank) {
    std::uint64_t sum = 0;  // Q40
    for (int i = 0; i < rank; ++i) sum += (std::uint64_t{1} << 40) / static_cast<std::uint64_t>(cells - i);
    return static_cast<std::int32_t>(
        -round_shift(log2_q20(sum) - 20 * (std::int64_t{1} << 20), 20 - kLogBits));
}

namespace {

/// Calls `visit(log_power)` for the reference cells of a cell until it returns false.
template <class Visit>
void for_each_reference(const PowerMap& map, const CfarConfig& config, int r, int d, Visit visit) {
    for (int i = 0; i < config.doppler_reference; ++i) {
        const int distance = config.doppler_guard + 1 + config.spacing * i;
        if (!visit(map.at(r, d + distance))) return;
        if (!visit(map.at(r, d - distance))) return;
    }
    // Range cells in order of distance, both sides in turn; a side that has ended leaves its share to the
    // other, so N is the same everywhere.
    int remaining = 2 * config.range_reference;
    for (int i = 0; remaining > 0; ++i) {
        const int distance = config.range_guard + 1 + config.spacing * i;
        if (r + distance < kRangeCells) {
            --remaining;
            if (!visit(map.at(r + distance, d))) return;
        }
        if (remaining > 0 && r - distance >= config.first_range_cell) {
            --remaining;
            if (!visit(map.at(r - distance, d))) return;
        }
    }
}

}  // namespace

OsCfar::OsCfar(const CfarConfig& config)
    : config_(config),
      threshold_(os_cfar_alpha(config.reference_cells(), config.rank, config.false_alarm_ppb) +
                 log2_from_cdb(config.offset_cdb)),
      noise_offset_(os_cfar_noise_offset(config.reference_cells(), config.rank)) {}

bool OsCfar::detects(const PowerMap& map, int range_cell, int doppler_cell) const {
    const std::int32_t power = map.at(range_cell, doppler_cell);
    if (power == 0) return false;
    const std::int32_t limit = power - threshold_;
    int may_exceed = config_.reference_cells() - config_.rank;
    for_each_reference(map, config_, range_cell, doppler_cell, [&](std::int32_t reference) {
        may_exceed -= reference >= limit ? 1 : 0;
        return may_exceed >= 0;
    });
    return may_exceed >= 0;
}

std::int32_t OsCfar::noise(const PowerMap& map, int range_cell, int doppler_cell) const {
    std::array<std::uint16_t, kMaxReferenceCells> reference;
    std::size_t count = 0;
    for_each_reference(map, config_, range_cell, doppler_cell, [&](std::uint16_t x) {
        reference[count++] = x;
        return true;
    });
    const auto kth = reference.begin() + config_.rank - 1;
    std::nth_element(reference.begin(), kth, reference.begin() + static_cast<std::ptrdiff_t>(count));
    return std::max<std::int32_t>(*kth + noise_offset_, 0);
}

void local_maxima(const PowerMap& map, int first_range_cell, CellMask& maxima) {
    maxima = CellMask{};
    for (int r = first_range_cell; r < kRangeCells; ++r) {
        for (int d = 0; d < kDopplerCells; ++d) {
            const std::uint16_t x = map.at(r, d);
            // Left is earlier in memory and may be equal, right is later and may not; the ends wrap around.
            if (d == 0 ? map.at(r, d - 1) >= x : map.at(r, d - 1) > x) continue;
            if (d == kDopplerCells - 1 ? map.at(r, d + 1) > x : map.at(r, d + 1) >= x) continue;
            if (r > 0 && (map.at(r - 1, d - 1) > x || map.at(r - 1, d) > x || map.at(r - 1, d + 1) > x))
                continue;
            if (r + 1 < kRangeCells &&
                (map.at(r + 1, d - 1) >= x || map.at(r + 1, d) >= x || map.at(r + 1, d + 1) >= x)) {
                continue;
            }
            maxima.set(r, d);
        }
    }
}

void os_cfar(const PowerMap& map, const OsCfar& cfar, const CellMask& candidates, CellMask& hits) {
    hits = CellMask{};
    for (int r = cfar.config().first_range_cell; r < kRangeCells; ++r) {
        for (std::uint64_t rest = candidates.row[static_cast<std::size_t>(r)]; rest != 0; rest &= rest - 1) {
            const int d = std::countr_zero(rest);
            if (cfar.detects(map, r, d)) hits.set(r, d);
        }
    }
}

}  // namespace dsp
