#include "dsp/extract_peaks.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdlib>
#include <span>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"
#include "dsp/unrolled.hpp"
#include "dsp/window_response.hpp"

namespace dsp {

namespace {

constexpr int kReach = WindowResponse::kReach;
constexpr int kTaps = WindowResponse::kTaps;

/// A local maximum, ordered by power, then by place, so that the order of equals is defined.
/// Bits 31..16 log-power, 10..6 range cell, 5..0 Doppler cell.
using Candidate = std::uint32_t;
using CandidateList = std::array<Candidate, kMaxCandidates>;

struct Cell {
    int range;
    int doppler;
    std::int32_t power;
};

constexpr Candidate pack(const Cell& cell) {
    return static_cast<std::uint32_t>(cell.power) << 16 |
           static_cast<std::uint32_t>(cell.range << 6 | cell.doppler);
}

constexpr Cell unpack(Candidate candidate) {
    return {static_cast<int>(candidate >> 6 & 31U), static_cast<int>(candidate & 63U),
            static_cast<std::int32_t>(candidate >> 16)};
}

/// Lets the candidate at `place` of a heap, the weakest on top, sink below the weaker ones.
[[gnu::noinline]] void sink(CandidateList& heap, std::size_t place) {
    const Candidate candidate = heap[place];
    for (std::size_t child = 2 * place + 1; child < heap.size(); child = 2 * place + 1) {
        if (child + 1 < heap.size() && heap[child + 1] < heap[child]) ++child;
        if (candidate <= heap[child]) break;
        heap[place] = heap[child];
        place = child;
    }
    heap[place] = candidate;
}

/// Descending, by the method of Shell (1959) with the distances of Ciura (2001).
void sort(std::span<Candidate> list) {
    for (const std::size_t distance : {57U, 23U, 10U, 4U, 1U}) {
        for (std::size_t next = distance; next < list.size(); ++next) {
            const Candidate candidate = list[next];
            std::size_t place = next;
            for (; place >= distance && list[place - distance] < candidate; place -= distance) {
                list[place] = list[place - distance];
            }
            list[place] = candidate;
        }
    }
}

/// Fills `list` with the strongest candidates in descending order. Returns how many; counts the rest.
[[gnu::noinline]] std::size_t collect(const PowerMap& map, const CellMask& peaks, CandidateList& list,
                                      int& rest) {
    std::size_t count = 0;
    for (int r = 0; r < kRangeCells; ++r) {
        for (std::uint64_t bits = peaks.row[static_cast<std::size_t>(r)]; bits != 0; bits &= bits - 1) {
            const int d = std::countr_zero(bits);
            const Candidate candidate = pack({r, d, map.at(r, d)});
            if (count < list.size()) {
                list[count++] = candidate;
                continue;
            }
            if (rest++ == 0) {
                for (std::size_t place = count / 2; place > 0; --place) sink(list, place - 1);
            }
            if (candidate < list[0]) continue;
            list[0] = candidate;
            sink(list, 0);
        }
    }
    sort({list.data(), count});
    return count;
}

/// Where the five by five cells around a peak are: a row's in order, the next row `stride` cells further.
struct Patch {
    const Complex16* cell;
    std::size_t stride;
    const std::int16_t* exponent;  ///< of the rows
};

/// A target's offset along an axis, roughly: towards higher cells unless mirrored.
struct Guess {
    int grid;  ///< steps of WindowResponse
    bool mirrored;
};

/// By the power of the peak over that of a neighbour: the offset towards it, grid steps, also negative.
int offset_towards(const WindowResponse& response, std::int32_t ratio) {
    const auto i = std::min<std::int32_t>(ratio >> WindowResponse::kRatioBits, WindowResponse::kRatios - 1);
    return response.offset_by_ratio[static_cast<std::size_t>(i)];
}

/// Towards the larger neighbour.
Guess guess(const WindowResponse& response, std::int32_t power, std::int32_t below, std::int32_t above) {
    return {std::max(offset_towards(response, power - std::max(below, above)), 0), below > above};
}

/// Sums over a row of cells with a guess's weights for Doppler: of amplitudes and of offsets.
struct RowSums {
    std::int32_t amplitude;
    std::int32_t offset;
};

/// v 2^up, clamped to +-2^28; `up` at least 0.
std::int32_t scaled_up(std::int32_t v, int up) {
    if (up > 28) up = 28;
    const std::int32_t most = (1 << 28) >> up;
    return std::clamp(v, -most, most) * (1 << up);
}

/// `rotation`: takes the phase off the cells, so that a lone target is real and positive in the peak cell.
/// The sums are in the unit of a row with exponent `exponent`, times |rotation| / 16.
void sum_rows(const Patch& patch, int exponent, packed::Pair rotation,
              const std::array<packed::Pair, kTaps>& weight, std::array<RowSums, kTaps>& sums) {
    const Complex16* cells = patch.cell;
    const std::int16_t* row_exponent = patch.exponent;
    for (RowSums& row : sums) {
        const auto aligned = [cells, rotation](std::size_t j) {
            return packed::dot(packed::load(&cells[j].re), rotation);
        };
        const std::int32_t first = aligned(0);
        std::int32_t amplitude = packed::scale_0(first, weight[0]);
        std::int32_t offset = packed::scale_1(first, weight[0]);
        unrolled<kTaps - 1, 1, kTaps - 1>([&](std::size_t i) {
            const std::int32_t cell = aligned(i + 1);
            amplitude = packed::scale_add_0(cell, weight[i + 1], amplitude);
            offset = packed::scale_add_1(cell, weight[i + 1], offset);
        });
        const int down = exponent - *row_exponent++;
        if (down >= 0) {
            row.amplitude = amplitude >> std::min(down, 31);
            row.offset = offset >> std::min(down, 31);
        } else {  // another, far stronger target's
            row.amplitude = scaled_up(amplitude, -down);
            row.offset = scaled_up(offset, -down);
        }
        cells += patch.stride;
    }
}

/// Which maxima are no targets but sidelobes of others. Remembers the targets by range cell: away from a
/// target's rows its sidelobes are so weak that most pairs need no look.
class Sidelobes {
  public:
    Sidelobes(const WindowResponse& range, const WindowResponse& doppler, const PeakConfig& config,
              const CandidateList& list)
        : range_(range),
          doppler_(doppler),
          list_(list),
          margin_(log2_from_cdb(config.sidelobe_margin_cdb)),
          dynamic_range_(log2_from_cdb(config.dynamic_range_cdb)) {}

    /// Whether sidelobes of the targets explain `peak`, no neighbour of theirs and not stronger than any peak
    /// before. What is far below the strongest target is never believed.
    [[nodiscard, gnu::noinline]] bool explain(const Cell& peak) {
        if (occupied_ == 0) return false;
        if (peak.power < strongest_ - dynamic_range_) return true;
        const std::int32_t over_margin = peak.power - margin_;
        const std::int16_t* range_response = range_.sidelobe.data();
        const std::int16_t* doppler_response = doppler_.sidelobe.data();
        const auto distance = [](int cells) { return static_cast<std::size_t>(cells) & (kWindowLength - 1); };
        // Beyond reach_ the response is less than this peak over the strongest target. (Where it rises again,
        // by one step: see WindowResponse::sidelobe.) The spectrum at -range, a real signal's other half, is
        // no nearer.
        while (reach_ < kRangeCells &&
               std::max(range_response[reach_ + 1], range_response[reach_ + 2]) > over_margin - strongest_) {
            ++reach_;
        }
        constexpr std::uint32_t kAll = ~std::uint32_t{0};
        std::uint32_t rows = occupied_ & kAll << std::max(peak.range - reach_, 0) &
                             kAll >> std::max(kRangeCells - 1 - peak.range - reach_, 0);
        for (; rows != 0; rows &= rows - 1) {
            const int row = std::countr_zero(rows);
            const std::int32_t range = range_response[distance(row - peak.range)];
            const std::int32_t range_mirrored = range_response[row + peak.range];
            for (std::size_t i = last_[static_cast<std::size_t>(row)]; i != 0; i = previous_[i - 1]) {
                const Cell target = unpack(list_[i - 1]);
                const std::int32_t excess = over_margin - target.power;
                if (excess >= range && excess >= range_mirrored) continue;
                if (excess < range + doppler_response[distance(target.doppler - peak.doppler)] ||
                    excess < range_mirrored + doppler_response[distance(target.doppler + peak.doppler)]) {
                    return true;
                }
            }
        }
        return false;
    }
    /// list[index] is a target.
    void add(std::size_t index) {
        const Cell target = unpack(list_[index]);
        if (occupied_ == 0) strongest_ = target.power;
        occupied_ |= std::uint32_t{1} << target.range;
        std::uint8_t& last = last_[static_cast<std::size_t>(target.range)];
        previous_[index] = last;
        last = static_cast<std::uint8_t>(index + 1);
    }

  private:
    static_assert(kMaxCandidates < 256 && kRangeCells == 32);
    const WindowResponse& range_;
    const WindowResponse& doppler_;
    const CandidateList& list_;
    std::int32_t margin_;  ///< log2 of power, Q6.10, as the others
    std::int32_t dynamic_range_;
    std::int32_t strongest_ = 0;
    std::uint32_t occupied_ = 0;                         ///< rows with targets, bit r
    int reach_ = 1;                                      ///< cells
    std::array<std::uint8_t, kRangeCells> last_{};       ///< target of each row, as index + 1 of the list
    std::array<std::uint8_t, kMaxCandidates> previous_;  ///< the one before in its row, 0: none
};

/// Place and quality of a peak between the cells.
struct Place {
    std::int32_t range_q15 = 0;  ///< offset from the peak cell, cells
    std::int32_t doppler_q15 = 0;
    std::int32_t range_variance = 0;  ///< log2 of cells^2 for a peak cell at the level of the noise, Q6.10
    std::int32_t doppler_variance = 0;
};

/// Offsets from a lobe's sums: guess plus sum g s / A, the quotient within 2^-15, at most kFarthestQ15 either
/// way.
class Refinement {
  public:
    explicit Refinement(std::int32_t amplitude)
        : amplitude_(amplitude),
          up_(std::countl_zero(static_cast<std::uint32_t>(amplitude)) - 1),
          divisor_(amplitude * (1 << up_) >> 15) {}
    /// `amplitude` was positive.
    [[nodiscard]] std::int32_t offset_q15(const Guess& guess, std::int32_t sum) const {
        std::int32_t step = 1 << 15;
        if (sum <= -amplitude_) {
            step = -step;
        } else if (sum < amplitude_) {
            step = sum * (1 << up_) / divisor_;
        }
        constexpr std::int32_t kStepQ15 = (1 << 15) / WindowResponse::kGridPerCell;
        /// A peak of one target lies within half a cell of the largest cell; noise moves it a little further.
        constexpr std::int32_t kFarthestQ15 = (3 << 15) / 4;
        const std::int32_t offset = std::clamp(guess.grid * kStepQ15 + step, -kFarthestQ15, kFarthestQ15);
        return guess.mirrored ? -offset : offset;
    }

  private:
    std::int32_t amplitude_;
    int up_;
    std::int32_t divisor_;
};

/// Both responses: of the windows along range and along Doppler.
struct Responses {
    const WindowResponse& range;
    const WindowResponse& doppler;
};

[[gnu::noinline]] Place locate(const Patch& patch, const PowerMap& map, const Cell& peak,
                               const Responses& response) {
    const bool has_range_above = peak.range + kReach < kRangeCells;
    const std::int32_t below =
        peak.range > 0 ? map.at(peak.range - 1, peak.doppler) : map.at(1, -peak.doppler);
    Guess range{};
    if (has_range_above) {
        range = guess(response.range, peak.power, below, map.at(peak.range + 1, peak.doppler));
    } else {
        const int offset = -offset_towards(response.range, peak.power - below);
        range = {std::abs(offset), offset < 0};
    }
    const Guess doppler = guess(response.doppler, peak.power, map.at(peak.range, peak.doppler - 1),
                                map.at(peak.range, peak.doppler + 1));

    const packed::Pair top = packed::load(&patch.cell[kReach * patch.stride + kReach].re);
    const int exponent = patch.exponent[kReach];
    // With 14 bits, so that no sum of two products overflows.
    const int bits = packed::magnitude_bits(packed::spread(top));
    const packed::Pair rotation =
        packed::pack_low(packed::lane0(top) * (1 << 14) >> bits, packed::lane1(top) * (1 << 14) >> bits);

    const auto weights = [](const WindowResponse& of, const Guess& guess) {
        return &of.weight[static_cast<std::size_t>(guess.grid)][guess.mirrored ? kTaps - 1 : 0];
    };
    const auto next = [](const Guess& guess) { return guess.mirrored ? -1 : 1; };
    std::array<packed::Pair, kTaps> weight;
    const WindowResponse::Weight* w = weights(response.doppler, doppler);
    unrolled<kTaps, 1, kTaps>([&](std::size_t j) {
        weight[j] = packed::load(&w->amplitude);
        w += next(doppler);
    });
    std::array<RowSums, kTaps> rows;
    sum_rows(patch, exponent, rotation, weight, rows);

    std::int32_t amplitude = 0;
    std::int32_t range_sum = 0;
    std::int32_t doppler_sum = 0;
    w = weights(response.range, range);
    unrolled<kTaps, 1, kTaps>([&](std::size_t i) {
        const packed::Pair pair = packed::load(&w->amplitude);
        amplitude = packed::scale_add_0(rows[i].amplitude, pair, amplitude);
        range_sum = packed::scale_add_1(rows[i].amplitude, pair, range_sum);
        doppler_sum = packed::scale_add_0(rows[i].offset, pair, doppler_sum);
        w += next(range);
    });
    Place place;
    if (amplitude > 0) {
        const Refinement refinement(amplitude);
        place.range_q15 = refinement.offset_q15(range, has_range_above ? range_sum : 0);
        place.doppler_q15 = refinement.offset_q15(doppler, doppler_sum);
    }
    // Noise adds (g'Cg)(a'Ca) / 2A^2 to the offset, A the lobe's amplitude and not that of the peak cell:
    // `amplitude` is A |rotation| / 2^8.
    const std::int32_t log2_amplitude =
        log2_q10(static_cast<std::uint32_t>(std::max(amplitude, std::int32_t{1})));
    const std::int32_t lobe = 2 * (peak.power - log2_amplitude + (14 - 8 - bits - 2 * exponent) * kLogOne) -
                              (2 * WindowResponse::kWeightBits + 1) * kLogOne;
    const auto range_grid = static_cast<std::size_t>(range.grid);
    const auto doppler_grid = static_cast<std::size_t>(doppler.grid);
    place.range_variance =
        lobe + response.range.offset_variance[range_grid] + response.doppler.amplitude_variance[doppler_grid];
    place.doppler_variance =
        lobe + response.doppler.offset_variance[doppler_grid] + response.range.amplitude_variance[range_grid];
    if (!has_range_above) place.range_variance += 3 * kLogOne;  // one cell of the four, and a table's step
    return place;
}

/// Where the cells around the peak are not one rectangle in memory: Doppler is cyclic, rows below cell 0 are
/// the other half of a real signal's spectrum, X[-r, -d] = conj X[r, d], and those above the last one are not
/// kept: zero.
[[gnu::noinline]] Place locate_in_copy(const Spectrum& spectrum, const PowerMap& map, const Cell& peak,
                                       const Responses& response) {
    std::array<std::array<Complex16, kTaps>, kTaps> cells;
    std::array<std::int16_t, kTaps> exponents;
    for (int i = -kReach; i <= kReach; ++i) {
        const int range = peak.range + i;
        const auto row = static_cast<std::size_t>(std::min(std::abs(range), kRangeCells - 1));
        const auto to = static_cast<std::size_t>(i + kReach);
        exponents[to] = spectrum.row_exponent[row];
        for (int j = -kReach; j <= kReach; ++j) {
            const int doppler = range < 0 ? -(peak.doppler + j) : peak.doppler + j;
            Complex16 cell = spectrum.row[row][static_cast<std::size_t>(doppler) & (kDopplerCells - 1)];
            if (range < 0) cell.im = static_cast<std::int16_t>(saturate16(-cell.im));
            if (range >= kRangeCells) cell = {};
            cells[to][static_cast<std::size_t>(j + kReach)] = cell;
        }
    }
    return locate({&cells[0][0], kTaps, exponents.data()}, map, peak, response);
}

Place locate(const Spectrum& spectrum, const PowerMap& map, const Cell& peak, const Responses& response) {
    if (static_cast<unsigned>(peak.range - kReach) >= kRangeCells - 2 * kReach ||
        static_cast<unsigned>(peak.doppler - kReach) >= kDopplerCells - 2 * kReach) {
        return locate_in_copy(spectrum, map, peak, response);
    }
    const auto row = static_cast<std::size_t>(peak.range - kReach);
    return locate({&spectrum.row[row][static_cast<std::size_t>(peak.doppler - kReach)], kDopplerCells,
                   &spectrum.row_exponent[row]},
                  map, peak, response);
}

/// Variance from noise, cells^2.
Real noise_cells(std::int32_t log2_variance) {
    const std::uint32_t noise = exp2_q30(std::min<std::int32_t>(log2_variance, 0));
    return Real::from_raw(static_cast<std::int32_t>(noise >> (30 - Real::fraction_bits)));
}

/// log2 of power, Q6.10, in decibels: 10 log10(2) / 2^10 each.
Real decibels(std::int32_t log2_power) {
    constexpr std::int64_t kStepQ32 = 12'929'139'865;  // 10 log10(2) 2^22 / 2^10 with 20 more bits
    return Real::from_raw(static_cast<std::int32_t>(round_shift(log2_power * kStepQ32, 20)));
}

}  // namespace

void extract_peaks(const Spectrum& spectrum, const PowerMap& map, const CellMask& peaks, const OsCfar& cfar,
                   WindowKind range_window, WindowKind doppler_window, const PeakConfig& config,
                   const CellScale& scale, DetectionList& detections) {
    const WindowResponse& range_response = window_response(range_window);
    const WindowResponse& doppler_response = window_response(doppler_window);
    const std::int32_t min_snr = log2_from_cdb(config.min_snr_cdb);
    const Real model_error = Real::ratio(config.model_error_mcell, 1000);
    const Real model_variance = model_error * model_error;
    const Real range_cell2 = scale.range_cell_m * scale.range_cell_m;
    const Real rate_cell2 = scale.rate_cell_mps * scale.rate_cell_mps;
    const Real coupling2 = scale.coupling_s * scale.coupling_s;
    detections.count = 0;
    detections.dropped = 0;
    CandidateList list;
    const std::size_t candidates = collect(map, peaks, list, detections.dropped);
    Sidelobes sidelobes(range_response, doppler_response, config, list);
    for (std::size_t c = 0; c < candidates; ++c) {
        const Cell peak = unpack(list[c]);
        if (sidelobes.explain(peak)) continue;
        sidelobes.add(c);

        const std::int32_t snr = peak.power - cfar.noise(map, peak.range, peak.doppler);
        if (snr < min_snr) continue;
        if (detections.count == kMaxDetections) {
            ++detections.dropped;
            continue;
        }
        const Place place = locate(spectrum, map, peak, {range_response, doppler_response});
        // Doppler cells 32..63 are closing; between cell 31 and 32 the position wraps from 32 to -32.
        std::int32_t doppler_q15 = peak.doppler * (1 << 15) + place.doppler_q15;
        if (doppler_q15 >= kDopplerCells / 2 * (1 << 15)) doppler_q15 -= kDopplerCells * (1 << 15);
        const std::int32_t range_q15 = peak.range * (1 << 15) + place.range_q15;
        constexpr int kToReal = 1 << (Real::fraction_bits - 15);
        Detection& detection = detections.item[static_cast<std::size_t>(detections.count++)];
        detection.range_rate_mps = scale.rate_cell_mps * Real::from_raw(doppler_q15 * kToReal);
        detection.range_m = scale.range_cell_m * Real::from_raw(range_q15 * kToReal) + scale.range_offset_m -
                            scale.coupling_s * detection.range_rate_mps;
        detection.rate_variance_m2ps2 =
            rate_cell2 * (noise_cells(place.doppler_variance - snr) + model_variance);
        detection.range_variance_m2 =
            range_cell2 * (noise_cells(place.range_variance - snr) + model_variance) +
            coupling2 * detection.rate_variance_m2ps2;
        detection.snr_db = decibels(snr);
        detection.range_cell = static_cast<std::uint8_t>(peak.range);
        detection.doppler_cell = static_cast<std::uint8_t>(peak.doppler);
    }
}

}  // namespace dsp
