#include "dsp/extract_peaks.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdlib>
#include <span>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"
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

/// Five neighbouring cells along an axis, and a zero.
using Taps = std::array<std::int16_t, kTaps + 1>;

/// sum_i w_i s_i, Q12 times the cells' unit.
std::int32_t weigh(const Taps& cells, const WindowResponse::Weights& weights) {
    static_assert(kTaps == 5);
    std::int32_t sum = packed::dot(packed::load(&cells[0]), packed::load(&weights[0]), 0);
    sum = packed::dot(packed::load(&cells[2]), packed::load(&weights[2]), sum);
    return packed::dot(packed::load(&cells[4]), packed::load(&weights[4]), sum);
}

/// Both sums of a lobe.
struct Estimate {
    std::int32_t amplitude;
    std::int32_t offset;
};
Estimate weigh(const Taps& cells, const WindowResponse::Lobe& lobe) {
    static_assert(sizeof lobe == 6 * sizeof(packed::Pair));
    packed::Pair a0 = 0;
    packed::Pair a2 = 0;
    packed::Pair a4 = 0;
    packed::Pair g0 = 0;
    packed::Pair g2 = 0;
    packed::Pair g4 = 0;
    packed::load_pair(&lobe.amplitude[0], a0, a2);
    packed::load_pair(&lobe.amplitude[4], a4, g0);
    packed::load_pair(&lobe.offset[2], g2, g4);
    const packed::Pair s0 = packed::load(&cells[0]);
    const packed::Pair s2 = packed::load(&cells[2]);
    const packed::Pair s4 = packed::load(&cells[4]);
    return {packed::dot(s4, a4, packed::dot(s2, a2, packed::dot(s0, a0, 0))),
            packed::dot(s4, g4, packed::dot(s2, g2, packed::dot(s0, g0, 0)))};
}

/// The cells around a peak with the peak's phase and the lobe's alternating sign taken off: a lone target is
/// real and positive there, the peak cell at least 2^13 and below 2^14, rounded down to one. What is more
/// than twice that saturates; it is another target's. Mirrored along an axis where the target lies on the
/// lower side of the peak cell, so that offsets are positive.
struct Patch {
    static constexpr int kUnitBits = 14;
    alignas(4) std::array<Taps, kTaps> along_doppler;  ///< [range cell]
    alignas(4) Taps along_range;                       ///< through the peak cell
    std::int32_t log2_unit;                            ///< of the peak cell, Q6.10
};

using Columns = std::array<std::size_t, kTaps>;

/// Five cells of a row: the real parts of those with even and with odd index times the conjugates of two
/// rotations, over 2^down, to `taps`.
inline void align_row(const Complex16* cells, const Columns& columns, packed::Pair even, packed::Pair odd,
                      int down, Taps& taps) {
    static_assert(kTaps == 5);
    const auto aligned = [&](std::size_t j, packed::Pair rotation) {
        return saturate16(packed::dot(packed::load(&cells[columns[j]].re), rotation, 0) >> down);
    };
    packed::store(&taps[0], packed::pack_low(aligned(0, even), aligned(1, odd)));
    packed::store(&taps[2], packed::pack_low(aligned(2, even), aligned(3, odd)));
    packed::store(&taps[4], packed::pack_low(aligned(4, even), 0));
}

/// The same for a row below cell 0, above the last one, or with another, far stronger target: down < 0.
[[gnu::noinline]] void align_other_row(const Spectrum& spectrum, int range, Columns columns,
                                       packed::Pair even, packed::Pair odd, int down, Taps& taps) {
    taps = {};
    if (range >= kRangeCells) return;  // not kept
    if (range < 0) {                   // a real signal's spectrum: X[-r, -d] = conj X[r, d]
        for (std::size_t& column : columns) column = (kDopplerCells - column) & (kDopplerCells - 1);
        even = packed::pack(packed::lane0(even), -packed::lane1(even));
        odd = packed::pack(packed::lane0(odd), -packed::lane1(odd));
    }
    align_row(spectrum.row[static_cast<std::size_t>(std::abs(range))].data(), columns, even, odd,
              std::clamp(down, 0, 31), taps);
    const int up = std::clamp(-down, 0, 15);
    for (std::int16_t& tap : taps) tap = static_cast<std::int16_t>(saturate16(tap * (1 << up)));
}

Patch align(const Spectrum& spectrum, const Cell& peak, bool mirror_range, bool mirror_doppler) {
    const auto peak_row = static_cast<std::size_t>(peak.range);
    const Complex16 top = spectrum.row[peak_row][static_cast<std::size_t>(peak.doppler)];
    // One step less at the very end of the format, so that no sum of two products overflows.
    const auto inside = [](std::int16_t v) { return std::max<std::int32_t>(v, -32767); };
    const std::int32_t re = inside(top.re);
    const std::int32_t im = inside(top.im);
    const auto power = static_cast<std::uint32_t>(re * re + im * im);
    const int down = static_cast<int>(std::bit_width(power)) - Patch::kUnitBits;
    Patch patch;
    patch.log2_unit = log2_q10(power) - down * kLogOne;
    patch.along_range[kTaps] = 0;
    const int range_step = mirror_range ? -1 : 1;
    const int doppler_step = mirror_doppler ? -1 : 1;
    const int exponent = down + spectrum.row_exponent[peak_row];
    const auto column = [&peak, doppler_step](int j) {
        return static_cast<std::size_t>(peak.doppler + j * doppler_step) & (kDopplerCells - 1);
    };
    const Columns columns{column(-2), column(-1), column(0), column(1), column(2)};
    // Cells of even and of odd distance to the peak have opposite signs.
    packed::Pair even = packed::pack(re, im);
    packed::Pair odd = packed::pack(-re, -im);
    int range = peak.range - range_step * kReach;
    for (std::size_t i = 0; i < kTaps; ++i, range += range_step) {
        Taps& taps = patch.along_doppler[i];
        const auto row = static_cast<std::size_t>(std::min(std::abs(range), kRangeCells - 1));
        const int row_down = exponent - spectrum.row_exponent[row];
        if (static_cast<unsigned>(range) < kRangeCells && row_down >= 0) {
            align_row(spectrum.row[row].data(), columns, even, odd, std::min(row_down, 31), taps);
        } else {
            align_other_row(spectrum, range, columns, even, odd, row_down, taps);
        }
        patch.along_range[i] = taps[kReach];
        std::swap(even, odd);
    }
    return patch;
}

/// A WindowResponse's weights for a guess of the offset.
class Guess {
  public:
    Guess(const WindowResponse& response, std::int32_t offset_q15)
        : response_(response),
          index_(std::clamp<std::int32_t>(
              (offset_q15 + kStepQ15 / 2) >> (15 - std::countr_zero(unsigned{WindowResponse::kGridPerCell})),
              0, WindowResponse::kGrid - 1)) {}

    [[nodiscard]] std::int32_t amplitude(const Taps& taps) const { return weigh(taps, lobe().amplitude); }
    /// Guess plus sum g s / A, the quotient within 2^-15, at most kFarthestQ15 either way.
    [[nodiscard]] std::int32_t refined_q15(const Estimate& estimate) const {
        const std::int32_t amplitude = estimate.amplitude;
        if (amplitude <= 0) return 0;
        std::int32_t step = 1 << 15;
        if (estimate.offset <= -amplitude) {
            step = -step;
        } else if (estimate.offset < amplitude) {
            const int up = std::countl_zero(static_cast<std::uint32_t>(amplitude)) - 1;
            step = (estimate.offset * (1 << up)) / (amplitude * (1 << up) >> 15);
        }
        return std::clamp(index_ * kStepQ15 + step, -kFarthestQ15, kFarthestQ15);
    }
    [[nodiscard]] Estimate estimate(const Taps& taps) const { return weigh(taps, lobe()); }
    [[nodiscard]] std::int32_t refined_q15(const Taps& taps) const { return refined_q15(estimate(taps)); }
    /// The amplitudes of five lines of cells.
    [[nodiscard]] Taps profile_of_lines(const std::array<Taps, kTaps>& lines) const {
        return rounded({amplitude(lines[0]), amplitude(lines[1]), amplitude(lines[2]), amplitude(lines[3]),
                        amplitude(lines[4])});
    }
    /// The amplitudes across them.
    [[nodiscard]] Taps profile_across(const std::array<Taps, kTaps>& lines) const {
        std::array<std::int32_t, kTaps> sum{};
        const auto add = [&](std::size_t i, auto multiply_low, auto multiply_high) {
            const packed::Pair weight = packed::load(&lobe().amplitude[i & ~std::size_t{1}]);
            const packed::Pair first = packed::load(&lines[i][0]);
            const packed::Pair second = packed::load(&lines[i][2]);
            sum[0] = multiply_low(first, weight, sum[0]);
            sum[1] = multiply_high(first, weight, sum[1]);
            sum[2] = multiply_low(second, weight, sum[2]);
            sum[3] = multiply_high(second, weight, sum[3]);
            sum[4] = multiply_low(packed::load(&lines[i][4]), weight, sum[4]);
        };
        add(0, packed::multiply_00, packed::multiply_10);
        add(1, packed::multiply_01, packed::multiply_11);
        add(2, packed::multiply_00, packed::multiply_10);
        add(3, packed::multiply_01, packed::multiply_11);
        add(4, packed::multiply_00, packed::multiply_10);
        return rounded(sum);
    }
    /// log2 of the variances in WindowResponse.
    [[nodiscard]] std::int32_t amplitude_variance() const { return response_.amplitude_variance[index()]; }
    [[nodiscard]] std::int32_t offset_variance() const { return response_.offset_variance[index()]; }

  private:
    static constexpr std::int32_t kStepQ15 = (1 << 15) / WindowResponse::kGridPerCell;
    /// A peak of one target lies within half a cell of the largest cell; noise moves it a little further.
    static constexpr std::int32_t kFarthestQ15 = (3 << 15) / 4;
    [[nodiscard]] const WindowResponse::Lobe& lobe() const { return response_.lobe[index()]; }
    [[nodiscard]] std::size_t index() const { return static_cast<std::size_t>(index_); }
    static Taps rounded(const std::array<std::int32_t, kTaps>& sum) {
        constexpr int kBits = WindowResponse::kWeightBits;
        const auto tap = [&sum](std::size_t i) { return saturate16<kBits>(sum[i] + (1 << (kBits - 1))); };
        Taps taps;
        packed::store(&taps[0], packed::pack_low(tap(0), tap(1)));
        packed::store(&taps[2], packed::pack_low(tap(2), tap(3)));
        packed::store(&taps[4], packed::pack_low(tap(4), 0));
        return taps;
    }
    const WindowResponse& response_;
    std::int32_t index_;
};

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

/// The offset at which the cell below the peak has this much of its power, log2 Q6.10.
std::int32_t offset_from_below(const WindowResponse& response, std::int32_t ratio) {
    constexpr std::int32_t kStepQ15 = (1 << 15) / WindowResponse::kGridPerCell;
    std::size_t i = 0;  // the ratio falls along the table, for a rectangular window up to offset 0
    while (i + 1 < response.below.size() && response.below[i + 1] > ratio &&
           response.below[i + 1] < response.below[i]) {
        ++i;
    }
    return (static_cast<std::int32_t>(i) - WindowResponse::kGridPerCell / 2) * kStepQ15;
}

[[gnu::noinline]] Place locate(const Spectrum& spectrum, const PowerMap& map, const Cell& peak,
                               const WindowResponse& range_response, const WindowResponse& doppler_response) {
    const bool has_range_above = peak.range + kReach < kRangeCells;
    Place place;
    bool mirror_range = false;
    if (has_range_above) {
        mirror_range =
            peak.range > 0 && map.at(peak.range - 1, peak.doppler) > map.at(peak.range + 1, peak.doppler);
    } else {
        const std::int32_t below = map.at(peak.range - 1, peak.doppler);
        place.range_q15 = offset_from_below(range_response, below - peak.power);
        mirror_range = place.range_q15 < 0;
        if (mirror_range) place.range_q15 = -place.range_q15;
    }
    const bool mirror_doppler = map.at(peak.range, peak.doppler - 1) > map.at(peak.range, peak.doppler + 1);
    const Patch patch = align(spectrum, peak, mirror_range, mirror_doppler);
    // Each round's error is the square of the one before; the grid limits it to 1/32 cell from the second on.
    // The first rounds only choose the weights of the last one: the axes through the peak suffice.
    for (int round = 0; round < 2; ++round) {
        place.doppler_q15 =
            Guess(doppler_response, place.doppler_q15).refined_q15(patch.along_doppler[kReach]);
        if (has_range_above) {
            place.range_q15 = Guess(range_response, place.range_q15).refined_q15(patch.along_range);
        }
    }
    const Guess range(range_response, place.range_q15);
    const Guess doppler(doppler_response, place.doppler_q15);
    const Estimate estimate = doppler.estimate(range.profile_across(patch.along_doppler));
    place.doppler_q15 = doppler.refined_q15(estimate);
    if (has_range_above) place.range_q15 = range.refined_q15(doppler.profile_of_lines(patch.along_doppler));
    if (mirror_range) place.range_q15 = -place.range_q15;
    if (mirror_doppler) place.doppler_q15 = -place.doppler_q15;
    // Noise adds (g'Cg)(a'Ca) / 2A^2 to the offset, A the lobe's amplitude and not that of the peak cell.
    const std::int32_t amplitude =
        log2_q10(static_cast<std::uint32_t>(std::max(estimate.amplitude, std::int32_t{1}))) -
        WindowResponse::kWeightBits * kLogOne;
    const std::int32_t lobe =
        2 * (patch.log2_unit - amplitude) - (2 * WindowResponse::kWeightBits + 1) * kLogOne;
    place.range_variance = lobe + range.offset_variance() + doppler.amplitude_variance();
    place.doppler_variance = lobe + doppler.offset_variance() + range.amplitude_variance();
    if (!has_range_above) place.range_variance += 3 * kLogOne;  // one cell of the four, and a table's step
    return place;
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
        const Place place = locate(spectrum, map, peak, range_response, doppler_response);
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
