#include "dsp/os_cfar.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <type_traits>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"

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

constexpr std::size_t kDopplerMask = kDopplerCells - 1;

/// Calls `visit(log_power)` for the reference cells along Doppler.
template <class Visit>
void for_each_doppler_reference(const PowerMap& map, const CfarConfig& config, int r, int d, Visit visit) {
    const std::uint16_t* row = map.cell[static_cast<std::size_t>(r)].data();
    const int first = config.doppler_guard + 1;
    const int reach = config.doppler_guard + config.spacing * config.doppler_reference;
    const auto inside = [&]<int kSpacing>(std::integral_constant<int, kSpacing>) {
        const std::uint16_t* right = row + d + first;
        const std::uint16_t* left = row + d - first;
        for (int i = config.doppler_reference; i > 0; --i) {
            visit(*right);
            visit(*left);
            right += kSpacing;
            left -= kSpacing;
        }
    };
    if (d < reach || d + reach >= kDopplerCells) {
        auto right = static_cast<std::size_t>(d + first);
        auto left = static_cast<std::size_t>(d - first);
        const auto step = static_cast<std::size_t>(config.spacing);
        for (int i = config.doppler_reference; i > 0; --i) {
            visit(row[right & kDopplerMask]);
            visit(row[left & kDopplerMask]);
            right += step;
            left -= step;
        }
    } else if (config.spacing == 2) {
        inside(std::integral_constant<int, 2>{});
    } else {
        inside(std::integral_constant<int, 1>{});
    }
}

/// And along range, in order of distance, both sides in turn; a side that has ended leaves its share to the
/// other, so N is the same everywhere.
template <class Visit>
void for_each_range_reference(const PowerMap& map, const CfarConfig& config, int r, int d, Visit visit) {
    int remaining = 2 * config.range_reference;
    const int reach = config.range_guard + config.spacing * config.range_reference;
    if (r - reach >= config.first_range_cell && r + reach < kRangeCells) {
        const std::uint16_t* row = map.cell[static_cast<std::size_t>(r)].data() + d;
        const std::ptrdiff_t step = std::ptrdiff_t{kDopplerCells} * config.spacing;
        const std::uint16_t* above = row + std::ptrdiff_t{kDopplerCells} * (config.range_guard + 1);
        const std::uint16_t* below = row - std::ptrdiff_t{kDopplerCells} * (config.range_guard + 1);
        for (int i = config.range_reference; i > 0; --i) {
            visit(*above);
            visit(*below);
            above += step;
            below -= step;
        }
        return;
    }
    for (int distance = config.range_guard + 1; remaining > 0; distance += config.spacing) {
        if (r + distance < kRangeCells) {
            --remaining;
            visit(map.at(r + distance, d));
        }
        if (remaining > 0 && r - distance >= config.first_range_cell) {
            --remaining;
            visit(map.at(r - distance, d));
        }
    }
}

/// One bit a cell of a row: those with even and with odd Doppler index, cells 2i and 2i+1 at bit 31-i. So a
/// word of packed compares shifts in at the low end, and a count of leading zeros finds the cell.
struct RowBits {
    std::uint32_t even = 0;
    std::uint32_t odd = 0;
};

struct RowCompares {
    RowBits rises;   ///< not below the cell to its left, cyclic; cell 0: above it
    RowBits filled;  ///< at least `level`
    RowBits high;    ///< at least `top`
};

/// The cell before the row in memory is read too, and does not matter.
RowCompares compare_row(const std::uint16_t* row, std::uint16_t level, std::uint16_t top) {
    const packed::Pair levels = packed::both(level);
    const packed::Pair tops = packed::both(top);
    std::array<packed::Pair, 2> rises{};  // of each half of the row: even cells in the high lane
    std::array<packed::Pair, 2> filled{};
    std::array<packed::Pair, 2> high{};
    for (std::size_t half = 0; half < 2; ++half) {
        packed::Pair rise = 0;
        packed::Pair fill = 0;
        packed::Pair over = 0;
        const std::uint16_t* cell = row + half * kDopplerCells / 2;
        const auto next = [&](const std::uint16_t* at) {
            const packed::Pair now = packed::load(at);
            rise = rise << 1 | packed::at_least(now, packed::load(at - 1));
            fill = fill << 1 | packed::at_least(now, levels);
            over = over << 1 | packed::at_least(now, tops);
        };
        for (int i = 0; i < kDopplerCells / 2; i += 8) {
            next(cell + i);
            next(cell + i + 2);
            next(cell + i + 4);
            next(cell + i + 6);
        }
        rises[half] = rise;
        filled[half] = fill;
        high[half] = over;
    }
    const auto join = [](const std::array<packed::Pair, 2>& halves) {
        return RowBits{halves[0] << 16 | (halves[1] & 0xFFFFU), (halves[0] & 0xFFFF'0000U) | halves[1] >> 16};
    };
    RowCompares result{join(rises), join(filled), join(high)};
    constexpr std::uint32_t kCell0 = std::uint32_t{1} << 31;
    result.rises.even =
        row[0] > row[kDopplerCells - 1] ? result.rises.even | kCell0 : result.rises.even & ~kCell0;
    return result;
}

std::array<std::uint16_t, 2 + kDopplerCells> copy_with_a_cell_before(
    const std::array<std::uint16_t, kDopplerCells>& row) {
    std::array<std::uint16_t, 2 + kDopplerCells> copy{};
    std::ranges::copy(row, copy.begin() + 2);
    return copy;
}

/// For every bit: whether at least `least` of 16 bits are set, those at `right`..`right`+7 places after it
/// and at `left`..`left`+7 before it, cyclic. Counted for all 32 at once: word j holds binary digit j of
/// every count. `complement`: the binary digits of 32 - least, each as all ones or zero.
using Digits = std::array<std::uint32_t, 5>;
std::uint32_t many_set(std::uint32_t bits, int right, int left, const Digits& complement) {
    const auto carry = [](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        return (a & b) | ((a ^ b) & c);
    };
    // Two, four, then eight neighbours, this one first.
    const std::uint32_t next = std::rotl(bits, 1);
    const std::uint32_t p0 = bits ^ next;
    const std::uint32_t p1 = bits & next;
    const std::uint32_t a0 = std::rotl(p0, 2);
    const std::uint32_t a1 = std::rotl(p1, 2);
    const std::uint32_t q0 = p0 ^ a0;
    const std::uint32_t q1 = p1 ^ a1 ^ (p0 & a0);
    const std::uint32_t q2 = carry(p1, a1, p0 & a0);
    const std::uint32_t b0 = std::rotl(q0, 4);
    const std::uint32_t b1 = std::rotl(q1, 4);
    const std::uint32_t b2 = std::rotl(q2, 4);
    const std::uint32_t c1 = q0 & b0;
    const std::uint32_t c2 = carry(q1, b1, c1);
    const std::array<std::uint32_t, 4> eight{q0 ^ b0, q1 ^ b1 ^ c1, q2 ^ b2 ^ c2, carry(q2, b2, c2)};
    // Eight on the right plus eight on the left, plus 32 - least: the last carry is the answer.
    const int apart = right + left + 7;
    std::uint32_t sum_carry = 0;
    std::uint32_t answer = 0;
    for (std::size_t j = 0; j < 4; ++j) {
        const std::uint32_t other = std::rotr(eight[j], apart);
        const std::uint32_t either = eight[j] ^ other;
        answer = carry(either ^ sum_carry, complement[j], answer);
        sum_carry = (eight[j] & other) | (either & sum_carry);
    }
    return std::rotl(carry(sum_carry, complement[4], answer), right);
}

/// The cells of a row that `level` alone rules out: so many of their reference cells are at least `level`
/// that nothing up to `level` over the threshold is detected. Looks at eight cells along Doppler on each
/// side, every second one.
///
/// `first`: distance of the first reference cell. Of a cell's neighbours at an odd distance the index is of
/// the other kind, even or odd.
RowBits ruled_out(const RowBits& filled, int first, const Digits& complement) {
    if (first % 2 == 0) {
        return {many_set(filled.even, first / 2, first / 2, complement),
                many_set(filled.odd, first / 2, first / 2, complement)};
    }
    return {many_set(filled.odd, first / 2, first / 2 + 1, complement),
            many_set(filled.even, first / 2 + 1, first / 2, complement)};
}

/// Larger than its neighbours in the rows above and below. Of equals the one later in memory is larger.
bool tops_its_column(const PowerMap& map, int r, int d) {
    const std::uint16_t x = map.at(r, d);
    if (r > 0 && (map.at(r - 1, d) > x || map.at(r - 1, d - 1) > x || map.at(r - 1, d + 1) > x)) return false;
    return r + 1 >= kRangeCells ||
           (map.at(r + 1, d) < x && map.at(r + 1, d - 1) < x && map.at(r + 1, d + 1) < x);
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
    // Counts without a branch: a compare of unknown outcome costs more than what an early end would save,
    // since few cells of noise come here.
    std::int32_t below = 0;
    const auto count = [limit, &below](std::int32_t reference) {
        below += static_cast<std::int32_t>(static_cast<std::uint32_t>(reference - limit) >> 31);
    };
    for_each_doppler_reference(map, config_, range_cell, doppler_cell, count);
    if (below + 2 * config_.range_reference < config_.rank) return false;
    for_each_range_reference(map, config_, range_cell, doppler_cell, count);
    return below >= config_.rank;
}

std::int32_t OsCfar::noise(const PowerMap& map, int range_cell, int doppler_cell) const {
    std::array<std::uint16_t, kMaxReferenceCells> reference;
    std::size_t count = 0;
    const auto take = [&](std::uint16_t x) { reference[count++] = x; };
    for_each_doppler_reference(map, config_, range_cell, doppler_cell, take);
    for_each_range_reference(map, config_, range_cell, doppler_cell, take);
    // Hoare's selection: parts the cells about a pivot until the pivot's place is the one asked for.
    const auto wanted = static_cast<std::ptrdiff_t>(config_.rank - 1);
    std::ptrdiff_t low = 0;
    std::ptrdiff_t high = static_cast<std::ptrdiff_t>(count) - 1;
    const auto at = [&reference](std::ptrdiff_t i) -> std::uint16_t& {
        return reference[static_cast<std::size_t>(i)];
    };
    while (low < high) {
        const std::uint16_t pivot = at(wanted);
        std::ptrdiff_t i = low;
        std::ptrdiff_t j = high;
        while (i <= j) {
            while (at(i) < pivot) ++i;
            while (at(j) > pivot) --j;
            if (i <= j) std::swap(at(i++), at(j--));
        }
        if (j < wanted) low = i;
        if (wanted < i) high = j;
    }
    return std::max<std::int32_t>(at(wanted) + noise_offset_, 0);
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

void cfar_peaks(const PowerMap& map, const OsCfar& cfar, std::uint16_t level, CellMask& peaks) {
    peaks = CellMask{};
    const CfarConfig& config = cfar.config();
    // What is at least `top` is tested whatever its neighbours say: its limit is above `level`.
    const std::int32_t top = std::max<std::int32_t>(level + cfar.threshold() + 1, 0);
    const auto top16 = static_cast<std::uint16_t>(std::min<std::int32_t>(top, 0xFFFF));
    const int least = config.reference_cells() - config.rank + 1;
    const bool enough = (config.doppler_reference - 1) * config.spacing >= 14 && least <= 16;
    Digits complement{};
    for (std::size_t j = 0; j < complement.size(); ++j) {
        complement[j] = 0U - ((32U - static_cast<std::uint32_t>(least)) >> j & 1U);
    }
    for (int r = config.first_range_cell; r < kRangeCells; ++r) {
        const RowCompares row =
            r == 0 ? compare_row(copy_with_a_cell_before(map.cell[0]).data() + 2, level, top16)
                   : compare_row(map.cell[static_cast<std::size_t>(r)].data(), level, top16);
        const RowBits out = enough ? ruled_out(row.filled, config.doppler_guard + 1, complement) : RowBits{};
        const auto test = [&](std::uint32_t rest, int odd) {
            while (rest != 0) {
                const int i = std::countl_zero(rest);
                rest &= ~(std::uint32_t{0x8000'0000} >> i);
                const int d = 2 * i + odd;
                if (tops_its_column(map, r, d) && cfar.detects(map, r, d)) peaks.set(r, d);
            }
        };
        // A maximum of its row rises from the left, and the next cell does not.
        test(row.rises.even & ~row.rises.odd & (~out.even | row.high.even), 0);
        test(row.rises.odd & ~std::rotl(row.rises.even, 1) & (~out.odd | row.high.odd), 1);
    }
}

}  // namespace dsp
