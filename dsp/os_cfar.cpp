#include "dsp/os_cfar.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <span>
#include <utility>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"
#include "dsp/unrolled.hpp"

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
constexpr int kHalf = kDopplerCells / 2;
using MapRow = std::array<std::uint16_t, kDopplerCells>;

/// Calls `visit(right, left)` with the log-powers of the reference cells along Doppler, nearest first.
template <class Visit>
void for_each_doppler_reference(const PowerMap& map, const CfarConfig& config, int r, int d, Visit visit) {
    const std::uint16_t* row = map.cell[static_cast<std::size_t>(r)].data();
    auto right = static_cast<std::size_t>(d + config.doppler_guard + 1);
    auto left = static_cast<std::size_t>(d - config.doppler_guard - 1);
    const auto step = static_cast<std::size_t>(config.spacing);
    for (int i = config.doppler_reference; i > 0; --i) {
        visit(row[right & kDopplerMask], row[left & kDopplerMask]);
        right += step;
        left -= step;
    }
}

/// Calls `visit(cell)` with the addresses of those along range, in order of distance, both sides in turn; a
/// side that has ended leaves its share to the other, so N is the same everywhere.
template <class Visit>
void for_each_range_reference(const PowerMap& map, const CfarConfig& config, int r, int d, Visit visit) {
    const std::uint16_t* cell = map.cell[static_cast<std::size_t>(r)].data() + d;
    int remaining = 2 * config.range_reference;
    for (int distance = config.range_guard + 1; remaining > 0; distance += config.spacing) {
        const std::ptrdiff_t rows = std::ptrdiff_t{kDopplerCells} * distance;
        if (r + distance < kRangeCells) {
            --remaining;
            visit(cell + rows);
        }
        if (remaining > 0 && r - distance >= config.first_range_cell) {
            --remaining;
            visit(cell - rows);
        }
    }
}

/// Whether all range reference cells of this row are there, on both sides.
bool has_range_references(const CfarConfig& config, int r) {
    const int farthest = config.range_guard + 1 + config.spacing * (config.range_reference - 1);
    return r - farthest >= config.first_range_cell && r + farthest < kRangeCells;
}

/// One bit a cell of a row: those with even Doppler index, then those with odd, cells 2i and 2i+1 at bit
/// 31-i. So compares shift in at the low end, and a count of leading zeros finds the cell.
using RowBits = std::array<std::uint32_t, 2>;

/// Joins the bits of the two halves of a row; the even cells of a half are in the low lane.
constexpr RowBits join(packed::Pair first, packed::Pair second) {
    return {first << 16 | (second & 0xFFFFU), (first & 0xFFFF'0000U) | second >> 16};
}

struct RowCompares {
    RowBits filled;  ///< at least `level`
    RowBits high;    ///< at least `top`
};

/// By the upper bytes of the cells, four of them in a word: `level` and `top` are upper bytes too.
RowCompares compare_row(const MapRow& row, std::uint32_t level, std::uint32_t top) {
    const std::uint32_t levels = level * 0x01010101U;
    const std::uint32_t tops = top * 0x01010101U;
    std::array<packed::Pair, 2> filled{};
    std::array<packed::Pair, 2> high{};
    for (std::size_t half = 0; half < 2; ++half) {
        std::uint32_t fill = 0;
        std::uint32_t over = 0;
        const auto next = [&](packed::Pair left_quarter, packed::Pair right_quarter) {
            const std::uint32_t bytes = packed::high_bytes(left_quarter, right_quarter);
            fill = fill << 1 | packed::bytes_at_least(bytes, levels);
            over = over << 1 | packed::bytes_at_least(bytes, tops);
        };
        const std::uint16_t* cell = row.data() + half * kHalf;
        unrolled<kHalf / 2, 4, 4>([&](std::size_t i) {
            packed::Pair a = 0;
            packed::Pair b = 0;
            packed::Pair c = 0;
            packed::Pair d = 0;
            packed::load_pair(cell + i, a, b);
            packed::load_pair(cell + i + kHalf / 2, c, d);
            next(a, c);
            next(b, d);
        });
        filled[half] = fill;
        high[half] = over;
    }
    return {join(filled[0], filled[1]), join(high[0], high[1])};
}

constexpr std::uint32_t majority(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return (a & b) | ((a ^ b) & c);
}

/// For every bit: whether more than 7 - `more` of 16 bits are set, those at `right`..`right`+7 places after
/// it and at `left`..`left`+7 before it, cyclic; `more` 0..7. Counted for all 32 at once: word j holds binary
/// digit j of every count.
std::uint32_t many_set(std::uint32_t bits, int right, int left, std::uint32_t more) {
    // Two, four, then eight neighbours, this one first.
    const std::uint32_t next = std::rotl(bits, 1);
    const std::uint32_t p0 = bits ^ next;
    const std::uint32_t p1 = bits & next;
    const std::uint32_t a0 = std::rotl(p0, 2);
    const std::uint32_t a1 = std::rotl(p1, 2);
    const std::uint32_t q0 = p0 ^ a0;
    const std::uint32_t q1 = p1 ^ a1 ^ (p0 & a0);
    const std::uint32_t q2 = majority(p1, a1, p0 & a0);
    const std::uint32_t b0 = std::rotl(q0, 4);
    const std::uint32_t b1 = std::rotl(q1, 4);
    const std::uint32_t b2 = std::rotl(q2, 4);
    const std::uint32_t c1 = q0 & b0;
    const std::uint32_t c2 = majority(q1, b1, c1);
    const std::uint32_t s0 = q0 ^ b0;
    const std::uint32_t s1 = q1 ^ b1 ^ c1;
    const std::uint32_t s2 = q2 ^ b2 ^ c2;
    const std::uint32_t s3 = majority(q2, b2, c2);
    const int apart = right + left + 7;
    std::uint32_t l0 = std::rotr(s0, apart);
    std::uint32_t l1 = std::rotr(s1, apart);
    std::uint32_t l2 = std::rotr(s2, apart);
    std::uint32_t l3 = std::rotr(s3, apart);
    if (more != 0) {  // added to the left
        const std::uint32_t m0 = 0U - (more & 1U);
        const std::uint32_t m1 = 0U - (more >> 1 & 1U);
        const std::uint32_t m2 = 0U - (more >> 2 & 1U);
        const std::uint32_t d1 = l0 & m0;
        const std::uint32_t d2 = majority(l1, m1, d1);
        l3 |= majority(l2, m2, d2);
        l2 ^= m2 ^ d2;
        l1 ^= m1 ^ d1;
        l0 ^= m0;
    }
    // More than seven: a digit of eight, or a carry into it.
    return std::rotl(s3 | l3 | majority(s2, l2, majority(s1, l1, s0 & l0)), right);
}

/// The cells of a row that `level` alone does not rule out. So many reference cells of the others are at
/// least `level` that nothing up to `level` over the threshold is detected. Looks at eight cells along
/// Doppler on each side, every second one.
///
/// `first`: distance of the first reference cell. Of a cell's neighbours at an odd distance the index is of
/// the other kind, even or odd. `more`: see many_set().
RowBits not_ruled_out(const RowBits& filled, int first, std::uint32_t more) {
    if (first % 2 == 0) {
        return {many_set(~filled[0], first / 2, first / 2, more),
                many_set(~filled[1], first / 2, first / 2, more)};
    }
    return {many_set(~filled[1], first / 2, first / 2 + 1, more),
            many_set(~filled[0], first / 2 + 1, first / 2, more)};
}

/// The neighbours of a row's cells. Of equals the one later in memory is larger.
class Neighbours {
  public:
    /// A row that is missing is replaced by the one on the other side, which demands no less.
    Neighbours(const PowerMap& map, int r)
        : row_(map.cell[static_cast<std::size_t>(r)]),
          lower_(map.cell[static_cast<std::size_t>(r > 0 ? r - 1 : r + 1)]),
          upper_(map.cell[static_cast<std::size_t>(r + 1 < kRangeCells ? r + 1 : r - 1)]),
          least_(r + 1 < kRangeCells ? 1 : 0) {}
    [[nodiscard]] bool tops_its_row(int d) const {
        const std::uint16_t x = row_[static_cast<std::size_t>(d)];
        const std::uint16_t left = row_[left_of(d)];
        const std::uint16_t right = row_[right_of(d)];
        return x >= left && x >= right && (x > right || d == kDopplerCells - 1) && (x > left || d != 0);
    }
    [[nodiscard]] bool tops_its_columns(int d) const {
        const auto middle = static_cast<std::size_t>(d);
        const std::size_t left = left_of(d);
        const std::size_t right = right_of(d);
        const std::int32_t lower = row_[middle];
        const std::int32_t upper = lower - least_;
        return lower >= lower_[middle] && upper >= upper_[middle] && lower >= lower_[left] &&
               lower >= lower_[right] && upper >= upper_[left] && upper >= upper_[right];
    }

  private:
    static std::size_t left_of(int d) { return static_cast<std::size_t>(d - 1) & kDopplerMask; }
    static std::size_t right_of(int d) { return static_cast<std::size_t>(d + 1) & kDopplerMask; }
    const MapRow& row_;
    const MapRow& lower_;
    const MapRow& upper_;
    std::int32_t least_;  ///< over those in the upper row
};

/// A row of the map, even and odd cells apart and repeated to both sides, -32 <= d < 96: every second cell is
/// the next in memory.
class ParityRow {
  public:
    explicit ParityRow(const MapRow& row) {
        const auto split = [&row, this](std::size_t i, std::size_t at, std::size_t again) {
            packed::Pair a = 0;
            packed::Pair b = 0;
            packed::Pair c = 0;
            packed::Pair d = 0;
            packed::load_pair(row.data() + 2 * i, a, b);
            packed::load_pair(row.data() + 2 * i + 4, c, d);
            const auto lane = [](packed::Pair x) { return static_cast<std::int32_t>(x); };
            const auto store = [&](std::size_t side, packed::Pair first, packed::Pair second) {
                packed::store_pair(&side_[side][at], first, second);
                packed::store_pair(&side_[side][again], first, second);
            };
            store(0, packed::pack_low(lane(a), lane(b)), packed::pack_low(lane(c), lane(d)));
            store(1, packed::pack_high(lane(a), lane(b)), packed::pack_high(lane(c), lane(d)));
        };
        constexpr std::size_t kQuarter = kHalf / 2;
        unrolled<kQuarter, 4, 2>([&](std::size_t i) {
            split(i, kQuarter + i, 3 * kQuarter + i);
            split(kQuarter + i, 2 * kQuarter + i, i);
        });
    }
    [[nodiscard]] const std::uint16_t* cell(int d) const {
        return side_[static_cast<std::size_t>(d & 1)].data() + (kHalf / 2 + (d >> 1));
    }

  private:
    alignas(4) std::array<std::array<std::uint16_t, std::size_t{2} * kHalf>, 2> side_;
};

/// The cells that are larger than their neighbours in the row.
RowBits maxima(const MapRow& row) {
    packed::Pair before = packed::load(&row[kDopplerCells - 2]);
    std::array<packed::Pair, 2> bits{};
    for (std::size_t half = 0; half < 2; ++half) {
        packed::Pair rise = 0;
        unrolled<kHalf, 4, 4>([&](std::size_t i) {
            packed::Pair a = 0;
            packed::Pair b = 0;
            packed::load_pair(row.data() + half * kHalf + i, a, b);
            rise = rise << 1 | packed::at_least(a, before >> 16 | a << 16);
            rise = rise << 1 | packed::at_least(b, a >> 16 | b << 16);
            before = b;
        });
        bits[half] = rise;
    }
    // Not below the one to their left; cell 0: above it.
    RowBits rises = join(bits[0], bits[1]);
    if (row[0] == row[kDopplerCells - 1]) rises[0] &= ~(std::uint32_t{1} << 31);
    // And the next one does not rise.
    return {rises[0] & ~rises[1], rises[1] & ~std::rotl(rises[0], 1)};
}

/// Compares the cells of a row with those above, below and at the corners, two at once.
class ColumnCompare {
  public:
    /// `below`, `above`: of the two cells before the first ones and of the first ones themselves, which come
    /// from the end of the row: Doppler is cyclic.
    ColumnCompare(const std::uint16_t* below, const std::uint16_t* above, packed::Pair cells)
        : before_(most(packed::load(below), packed::load(above))),
          here_(most(packed::load(below + 2), packed::load(above + 2))),
          here_swapped_(packed::swap(here_)),
          cells_(cells) {}
    /// The two cells after those given last: a comparison is one step late.
    [[gnu::always_inline]] void next(packed::Pair below, packed::Pair above, packed::Pair cells) {
        const packed::Pair after = most(below, above);
        const packed::Pair after_swapped = packed::swap(after);
        // The neighbours of both cells together: one before, one after.
        packed::Pair outer =
            packed::pack_high(static_cast<std::int32_t>(before_), static_cast<std::int32_t>(after_swapped));
        packed::Pair inner = here_;
        packed::Pair largest = here_swapped_;
        packed::order(inner, largest);
        packed::order(outer, largest);
        tops_ = tops_ << 1 | packed::at_least(packed::floored_sub(cells_, kOnes), largest);
        before_ = here_;
        here_ = after;
        here_swapped_ = after_swapped;
        cells_ = cells;
    }
    /// A bit in each lane for every step since the last call, at most 16, the last one lowest. Cells that are
    /// zero may pass.
    packed::Pair take_tops() { return std::exchange(tops_, 0); }

  private:
    static constexpr packed::Pair kOnes = 0x00010001U;
    /// What a cell less one must be at least: the one above it and the one below it less one.
    static packed::Pair most(packed::Pair below, packed::Pair above) {
        packed::Pair less = packed::floored_sub(below, kOnes);
        packed::order(less, above);
        return above;
    }
    packed::Pair before_;
    packed::Pair here_;
    packed::Pair here_swapped_;
    packed::Pair cells_;
    packed::Pair tops_ = 0;
};

/// The cells that are larger than those above and below and at the four corners, and perhaps some that are
/// zero. For rows that have one on either side.
[[gnu::noinline]] RowBits column_maxima(const PowerMap& map, std::size_t r) {
    const std::uint16_t* row = map.cell[r].data();
    constexpr std::ptrdiff_t kRow = kDopplerCells;
    constexpr std::ptrdiff_t kLast = kDopplerCells - 2;
    ColumnCompare compare(row - kRow + kLast - 2, row + kRow + kLast - 2, packed::load(row + kLast));
    std::array<packed::Pair, 2> tops{};
    for (packed::Pair& half : tops) {
        for (const std::uint16_t* const end = row + kHalf; row != end; row += 4) {
            std::array<packed::Pair, 2> below;
            std::array<packed::Pair, 2> above;
            std::array<packed::Pair, 2> cells;
            packed::load_pair(row - kRow, below[0], below[1]);
            packed::load_pair(row + kRow, above[0], above[1]);
            packed::load_pair(row, cells[0], cells[1]);
            compare.next(below[0], above[0], cells[0]);
            compare.next(below[1], above[1], cells[1]);
        }
        half = compare.take_tops();
    }
    // The last two cells came first.
    const RowBits bits = join(tops[0], tops[1]);
    return {std::rotl(bits[0], 1), std::rotl(bits[1], 1)};
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
    for_each_doppler_reference(map, config_, range_cell, doppler_cell,
                               [&count](std::uint16_t right, std::uint16_t left) {
                                   count(right);
                                   count(left);
                               });
    if (below + 2 * config_.range_reference < config_.rank) return false;
    for_each_range_reference(map, config_, range_cell, doppler_cell,
                             [&count](const std::uint16_t* cell) { count(*cell); });
    return below >= config_.rank;
}

namespace {

constexpr int kUnrolled = 8;  ///< reference cells on a side along Doppler, and along range
constexpr int kUnrolledRange = 2;

constexpr int kPairsSorted = 10;  ///< of reference cells, as many as the default configuration has

struct Exchange {
    std::uint8_t low;
    std::uint8_t high;
};

/// Sorts kPairsSorted numbers with the fewest exchanges possible (Waksman 1969).
constexpr std::array<Exchange, 29> kNetwork{{{0, 8}, {1, 9}, {2, 7}, {3, 5}, {4, 6}, {0, 2}, {1, 4}, {5, 8},
                                             {7, 9}, {0, 3}, {2, 4}, {5, 7}, {6, 9}, {0, 1}, {3, 6}, {8, 9},
                                             {1, 5}, {2, 3}, {4, 8}, {6, 7}, {1, 2}, {3, 5}, {4, 6}, {7, 8},
                                             {2, 3}, {4, 5}, {6, 7}, {3, 4}, {5, 6}}};
/// What sorts zeros and ones sorts everything (Knuth).
constexpr bool sorts() {
    for (unsigned numbers = 0; numbers < 1U << kPairsSorted; ++numbers) {
        unsigned bits = numbers;
        for (const Exchange& exchange : kNetwork) {
            const unsigned change = (bits >> exchange.low & ~(bits >> exchange.high)) & 1U;
            bits ^= change << exchange.low | change << exchange.high;
        }
        const unsigned zeros = ~bits & ((1U << kPairsSorted) - 1);
        if ((zeros & (zeros + 1)) != 0) return false;
    }
    return true;
}
static_assert(sorts());

/// Two lists in two lanes, ascending, after a zero.
using SortedPairs = std::array<packed::Pair, 1 + kPairsSorted>;

/// Every other one of twice kPairsSorted numbers and the rest.
template <std::size_t... kLane, std::size_t... kIndex>
SortedPairs sort_in_lanes(const std::uint16_t* numbers, std::index_sequence<kLane...> /*lanes*/,
                          std::index_sequence<kIndex...> /*exchanges*/) {
    SortedPairs lanes{0, packed::load(numbers + 2 * kLane)...};
    (packed::order(lanes[1 + kNetwork[kIndex].low], lanes[1 + kNetwork[kIndex].high]), ...);
    return lanes;
}

/// Lowers `least`, lane by lane, to the larger of the last of i smallest in one list and the last of j
/// smallest in the other.
void lower(packed::Pair& least, packed::Pair i_smallest, packed::Pair j_smallest) {
    packed::Pair larger = packed::swap(j_smallest);
    packed::order(i_smallest, larger);
    packed::order(least, larger);
}

// The rank-th smallest in both lists: of i smallest of one and rank - i of the other the larger; the right i
// gives the least. The rank of the default configuration is known early enough to do without memory.

packed::Pair merge(const SortedPairs& sorted, int rank) {
    packed::Pair least = packed::both(0xFFFF);
    const packed::Pair* last = &sorted[static_cast<std::size_t>(std::min(rank, kPairsSorted))];
    const packed::Pair* first = &sorted[static_cast<std::size_t>(std::max(rank - kPairsSorted, 0))];
    for (; first <= last; ++first, --last) lower(least, *first, *last);
    return least;
}
constexpr std::size_t kUsualRank = CfarConfig{}.rank;
template <std::size_t... kIndex>
packed::Pair merge_at_usual_rank(const SortedPairs& sorted, std::index_sequence<kIndex...> /*half*/) {
    packed::Pair least = packed::both(0xFFFF);
    (lower(least, sorted[kUsualRank - kPairsSorted + kIndex], sorted[kPairsSorted - kIndex]), ...);
    return least;
}

/// The rank-th smallest of twice kPairsSorted numbers.
std::uint16_t select_by_sorting(const std::uint16_t* numbers, int rank) {
    const SortedPairs sorted = sort_in_lanes(numbers, std::make_index_sequence<kPairsSorted>{},
                                             std::make_index_sequence<kNetwork.size()>{});
    packed::Pair least = 0;
    if (rank == kUsualRank) {
        least = merge_at_usual_rank(sorted, std::make_index_sequence<kPairsSorted - kUsualRank / 2 + 1>{});
    } else {
        const SortedPairs in_memory = sorted;
        least = merge(in_memory, rank);
    }
    return static_cast<std::uint16_t>(std::min(least & 0xFFFFU, least >> 16));
}

/// The same of any even number of them: the largest one that is above fewer than `rank`, bit by bit.
std::uint16_t select_by_counting(std::span<const std::uint16_t> numbers, int rank) {
    const auto most = numbers.size() - static_cast<std::size_t>(rank);
    std::uint32_t selected = 0;
    for (std::uint32_t bit = 0x8000; bit != 0; bit /= 2) {
        packed::Pair not_below = 0;
        const packed::Pair tried = packed::both(static_cast<std::uint16_t>(selected | bit));
        for (std::size_t i = 0; i < numbers.size(); i += 2) {
            not_below += packed::at_least(packed::load(&numbers[i]), tried);
        }
        if ((not_below & 0xFFFFU) + (not_below >> 16) > most) selected |= bit;
    }
    return static_cast<std::uint16_t>(selected);
}

/// Copies the reference cells along Doppler of any number and spacing. Returns the end of the copy.
[[gnu::noinline]] std::uint16_t* copy_doppler_references(const PowerMap& map, const CfarConfig& config, int r,
                                                         int d, std::uint16_t* end) {
    for_each_doppler_reference(map, config, r, d, [&end](std::uint16_t right, std::uint16_t left) {
        packed::store(end, packed::pack_low(right, left));
        end += 2;
    });
    return end;
}
/// Those along range at the ends of the map.
[[gnu::noinline]] std::uint16_t* copy_range_references(const PowerMap& map, const CfarConfig& config, int r,
                                                       int d, std::uint16_t* end) {
    for_each_range_reference(map, config, r, d,
                             [&end](const std::uint16_t* reference) { *end++ = *reference; });
    return end;
}

}  // namespace

std::int32_t OsCfar::noise(const PowerMap& map, int range_cell, int doppler_cell) const {
    alignas(4) std::array<std::uint16_t, kMaxReferenceCells> cells;
    std::uint16_t* end = cells.data();
    const std::uint16_t* row = map.cell[static_cast<std::size_t>(range_cell)].data();
    if (config_.doppler_reference == kUnrolled && config_.spacing == 2) {
        const auto nearest = static_cast<std::size_t>(config_.doppler_guard) + 1;
        const std::size_t right = static_cast<std::size_t>(doppler_cell) + nearest;
        const std::size_t left = static_cast<std::size_t>(doppler_cell) - nearest;
        const auto pair = [=](std::size_t i) {
            return packed::pack_low(row[(right + i) & kDopplerMask], row[(left - i) & kDopplerMask]);
        };
        [=]<std::size_t... kIndex>(std::index_sequence<kIndex...>) {
            (packed::store_pair(end + 4 * kIndex, pair(4 * kIndex), pair(4 * kIndex + 2)), ...);
        }
        (std::make_index_sequence<kUnrolled / 2>{});
        end += 2 * kUnrolled;
    } else {
        end = copy_doppler_references(map, config_, range_cell, doppler_cell, end);
    }
    const std::uint16_t* cell = row + doppler_cell;
    if (has_range_references(config_, range_cell)) {
        std::ptrdiff_t rows = std::ptrdiff_t{kDopplerCells} * (config_.range_guard + 1);
        const std::ptrdiff_t step = std::ptrdiff_t{kDopplerCells} * config_.spacing;
        for (int i = config_.range_reference; i > 0; --i) {
            packed::store(end, packed::pack_low(cell[rows], cell[-rows]));
            end += 2;
            rows += step;
        }
    } else {
        end = copy_range_references(map, config_, range_cell, doppler_cell, end);
    }
    std::int32_t selected = 0;
    if (end - cells.data() <= 2 * kPairsSorted) {
        std::fill(end, cells.data() + 2 * kPairsSorted, std::uint16_t{0xFFFF});
        selected = select_by_sorting(cells.data(), config_.rank);
    } else {
        selected = select_by_counting({cells.data(), end}, config_.rank);
    }
    return std::max<std::int32_t>(selected + noise_offset_, 0);
}

namespace {

/// Takes the first cell out of one half of a RowBits. Returns its index within the half.
int take_first(std::uint32_t& bits) {
    const int i = std::countl_zero(bits);
    bits &= ~(std::uint32_t{0x8000'0000} >> i);
    return i;
}

/// Whether at most kMost bits are set.
template <std::size_t kMost>
bool few(std::uint32_t bits) {
    unrolled<kMost, 1, kMost>([&bits](std::size_t) { bits &= bits - 1; });
    return bits == 0;
}

/// How many bits are set. (The compiler calls a function for it.)
constexpr std::uint32_t count_set(std::uint32_t bits) {
    bits -= bits >> 1 & 0x5555'5555U;
    bits = (bits & 0x3333'3333U) + (bits >> 2 & 0x3333'3333U);
    return ((bits + (bits >> 4)) & 0x0F0F'0F0FU) * 0x0101'0101U >> 24;
}
static_assert(count_set(~0U) == 32 && count_set(0) == 0 && count_set(0x8000'0701U) == 5);

/// The bits of a row as in CellMask.
std::uint64_t in_order(const RowBits& bits) {
    const auto spread = [](std::uint32_t x) {  // bits 15..0 to bits 30, 28, .. 0
        x = (x | x << 8) & 0x00FF'00FFU;
        x = (x | x << 4) & 0x0F0F'0F0FU;
        x = (x | x << 2) & 0x3333'3333U;
        return (x | x << 1) & 0x5555'5555U;
    };
    const std::uint32_t even = packed::reverse_bits(bits[0]);
    const std::uint32_t odd = packed::reverse_bits(bits[1]);
    const std::uint32_t low = spread(even & 0xFFFFU) | spread(odd & 0xFFFFU) << 1;
    const std::uint32_t high = spread(even >> 16) | spread(odd >> 16) << 1;
    return low | std::uint64_t{high} << 32;
}

/// What the cells under test of a row have in common.
struct RowTest {
    packed::Pair threshold;  ///< in both lanes
    packed::Pair most;       ///< in both lanes: reference cells not below the limit, of a target
    std::array<const std::uint16_t*, std::size_t{2} * kUnrolledRange> range_reference;  ///< of the first cell
};

/// Counts, lane by lane, the reference cells that are not below a limit.
class Count {
  public:
    /// The limit of `cells`; nothing is below a limit of zero.
    Count(packed::Pair cells, packed::Pair threshold) : limit_(packed::floored_sub(cells, threshold)) {}
    void add(packed::Pair references) { not_below_ += packed::at_least(references, limit_); }
    [[nodiscard]] packed::Pair not_below() const { return not_below_; }

  private:
    packed::Pair limit_;
    packed::Pair not_below_ = 0;
};

/// Those `candidates` of the even or the odd cells that are over threshold. `cells`: the cells that the bits
/// stand for; `right`, `left`: the nearest reference cells of the first on either side.
[[gnu::noinline]] std::uint32_t over_threshold(std::uint32_t candidates, const std::uint16_t* cells,
                                               const std::uint16_t* right, const std::uint16_t* left,
                                               const RowTest& test) {
    static_assert(kUnrolled == 8 && kUnrolledRange == 2);
    const std::uint16_t* const row0 = test.range_reference[0];
    const std::uint16_t* const row1 = test.range_reference[1];
    const std::uint16_t* const row2 = test.range_reference[2];
    const std::uint16_t* const row3 = test.range_reference[3];
    std::uint32_t hits = candidates;
    while (candidates != 0) {
        const int i = take_first(candidates);
        Count count(packed::both(cells[i]), test.threshold);
        const std::uint16_t* reference = right + i;
        count.add(packed::load(reference));
        count.add(packed::load(reference + 2));
        count.add(packed::load(reference + 4));
        count.add(packed::load(reference + 6));
        reference = left + i;
        count.add(packed::load(reference - 1));
        count.add(packed::load(reference - 3));
        count.add(packed::load(reference - 5));
        count.add(packed::load(reference - 7));
        count.add(packed::pack_low(row0[2 * i], row1[2 * i]));
        count.add(packed::pack_low(row2[2 * i], row3[2 * i]));
        const packed::Pair sum = count.not_below() + (count.not_below() << 16);
        if (sum >> 16 > test.most >> 16) hits ^= std::uint32_t{0x8000'0000} >> i;
    }
    return hits;
}

/// The same for four neighbours where the first one's bit is set in `groups`: those that are over threshold,
/// candidates or not. Two are tested at once, each against one reference cell, and share what they load.
[[gnu::noinline]] std::uint32_t fours_over_threshold(std::uint32_t groups, const std::uint16_t* cells,
                                                     const std::uint16_t* right, const std::uint16_t* left,
                                                     const RowTest& test) {
    std::uint32_t hits = 0;
    while (groups != 0) {
        const int i = take_first(groups);
        Count first(packed::load(cells + i), test.threshold);
        Count second(packed::load(cells + i + 2), test.threshold);
        const auto add_to_both = [&](packed::Pair references) __attribute__((always_inline)) {
            first.add(references);
            second.add(references);
        };
        // Reference cell k of the second pair is reference cell k + 2 of the first.
        static_assert(kUnrolled == 8);
        for (const std::uint16_t* reference : {right + i, left + i - (kUnrolled - 1)}) {
            first.add(packed::load(reference));
            first.add(packed::load(reference + 1));
            add_to_both(packed::load(reference + 2));
            add_to_both(packed::load(reference + 3));
            add_to_both(packed::load(reference + 4));
            add_to_both(packed::load(reference + 5));
            add_to_both(packed::load(reference + 6));
            add_to_both(packed::load(reference + 7));
            second.add(packed::load(reference + 8));
            second.add(packed::load(reference + 9));
        }
        for (const std::uint16_t* row : test.range_reference) {
            const std::uint16_t* reference = row + 2 * i;
            first.add(packed::pack_low(reference[0], reference[2]));
            second.add(packed::pack_low(reference[4], reference[6]));
        }
        const packed::Pair pass0 = packed::at_least(test.most, first.not_below());
        const packed::Pair pass1 = packed::at_least(test.most, second.not_below());
        const std::uint32_t bits = (pass0 << 3 | pass0 >> 14 | pass1 << 1 | pass1 >> 16) & 0xFU;
        hits |= bits << (28 - i);
    }
    return hits;
}

/// The first bit of every four of which three or all are set.
constexpr std::uint32_t mostly_set(std::uint32_t bits) {
    const std::uint32_t both = bits & bits << 1;
    const std::uint32_t either = bits | bits << 1;
    return ((both & either << 2) | (either & both << 2)) & 0x8888'8888U;
}
static_assert(mostly_set(0x0137'F7BDU) == 0x0000'8888U + 0x0008'0000U);

/// Those of several `candidates` in a row that are over threshold, as CellMask::row: the reference cells of
/// one, laid side by side, are compared two at once. For a spacing of 2, kUnrolled reference cells on each
/// side along Doppler, kUnrolledRange along range, and a threshold of 0..65535.
[[gnu::noinline]] std::uint64_t several_over_threshold(const PowerMap& map, const OsCfar& cfar, int r,
                                                       const RowBits& candidates) {
    const CfarConfig& config = cfar.config();
    RowTest test;
    test.threshold = packed::both(static_cast<std::uint16_t>(cfar.threshold()));
    test.most = packed::both(static_cast<std::uint16_t>(config.reference_cells() - config.rank));
    const std::uint16_t** end = test.range_reference.data();
    if (has_range_references(config, r)) {
        const std::uint16_t* cell = map.cell[static_cast<std::size_t>(r)].data();
        std::ptrdiff_t rows = std::ptrdiff_t{kDopplerCells} * (config.range_guard + 1);
        for (int i = 0; i < kUnrolledRange; ++i) {
            *end++ = cell + rows;
            *end++ = cell - rows;
            rows += std::ptrdiff_t{kDopplerCells} * config.spacing;
        }
    } else {
        for_each_range_reference(map, config, r, 0, [&end](const std::uint16_t* cell) { *end++ = cell; });
    }
    const ParityRow row(map.cell[static_cast<std::size_t>(r)]);
    const int first = config.doppler_guard + 1;
    const auto hits = [&](std::uint32_t single, int odd) {
        const std::uint16_t* cells = row.cell(odd);
        const std::uint16_t* right = row.cell(odd + first);
        const std::uint16_t* left = row.cell(odd - first);
        const std::uint32_t groups = mostly_set(single);
        std::uint32_t found = 0;
        if (groups != 0) {
            const std::uint32_t in_groups = (groups >> 3) * 15;
            found = fours_over_threshold(groups, cells, right, left, test) & single & in_groups;
            single &= ~in_groups;
        }
        return single == 0 ? found : found | over_threshold(single, cells, right, left, test);
    };
    RowBits bits{};
    if (candidates[0] != 0) bits[0] = hits(candidates[0], 0);
    if (candidates[1] != 0) {
        for (const std::uint16_t*& reference : test.range_reference) ++reference;
        bits[1] = hits(candidates[1], 1);
    }
    return in_order(bits);
}

void keep(RowBits& bits, const RowBits& those) {
    for (std::size_t odd = 0; odd < 2; ++odd) bits[odd] &= those[odd];
}
/// Drops the cells of which `drop(d)` holds.
template <class Drop>
void drop_if(RowBits& bits, Drop drop) {
    for (std::size_t odd = 0; odd < 2; ++odd) {
        for (std::uint32_t rest = bits[odd]; rest != 0;) {
            const int i = take_first(rest);
            if (drop(2 * i + static_cast<int>(odd))) bits[odd] &= ~(std::uint32_t{0x8000'0000} >> i);
        }
    }
}

/// Of so many maxima in a row, to compare all cells with the rows beside it costs as much as to look at each.
constexpr std::uint32_t kManyMaxima = 20;

}  // namespace

void cfar_peaks(const PowerMap& map, const OsCfar& cfar, std::uint16_t level, CellMask& peaks) {
    peaks = CellMask{};
    const CfarConfig& config = cfar.config();
    // What is at least `top` is tested whatever its neighbours say: its limit is above `level`.
    const std::uint32_t level8 = level >> 8;
    const std::int32_t top = static_cast<std::int32_t>(level8 << 8) + cfar.threshold() + 1;
    const auto top8 = static_cast<std::uint32_t>(std::clamp<std::int32_t>(top, 0, 0xFFFF)) >> 8;
    const int least = config.reference_cells() - config.rank + 1;
    const bool enough = (config.doppler_reference - 1) * config.spacing >= 14 && least <= 16;
    const auto more = static_cast<std::uint32_t>(std::max(least - 9, 0));
    const bool regular = config.spacing == 2 && config.doppler_reference == kUnrolled &&
                         config.range_reference == kUnrolledRange && cfar.threshold() >= 0 &&
                         cfar.threshold() <= 0xFFFF;
    for (int r = config.first_range_cell; r < kRangeCells; ++r) {
        const MapRow& row = map.cell[static_cast<std::size_t>(r)];
        RowBits candidates{~std::uint32_t{0}, ~std::uint32_t{0}};
        if (enough) {
            const RowCompares compares = compare_row(row, level8, top8);
            candidates = not_ruled_out(compares.filled, config.doppler_guard + 1, more);
            for (std::size_t odd = 0; odd < 2; ++odd) candidates[odd] |= compares.high[odd];
        }
        // A few are compared with their neighbours one by one, many by comparing the whole row.
        if (few<6>(candidates[0] | candidates[1])) {
            drop_if(candidates, [neighbours = Neighbours(map, r)](int d) {
                return !neighbours.tops_its_row(d) || !neighbours.tops_its_columns(d);
            });
        } else {
            keep(candidates, maxima(row));
            if (count_set(candidates[0] | candidates[1]) > kManyMaxima && r > 0 && r + 1 < kRangeCells) {
                keep(candidates, column_maxima(map, static_cast<std::size_t>(r)));
            } else {
                drop_if(candidates,
                        [neighbours = Neighbours(map, r)](int d) { return !neighbours.tops_its_columns(d); });
            }
        }
        // To lay a row out costs as much as to test two cells without.
        if (regular && !few<2>(candidates[0] | candidates[1])) {
            peaks.row[static_cast<std::size_t>(r)] = several_over_threshold(map, cfar, r, candidates);
            continue;
        }
        for (std::size_t odd = 0; odd < 2; ++odd) {
            while (candidates[odd] != 0) {
                const int d = 2 * take_first(candidates[odd]) + static_cast<int>(odd);
                if (cfar.detects(map, r, d)) peaks.set(r, d);
            }
        }
    }
}

}  // namespace dsp
