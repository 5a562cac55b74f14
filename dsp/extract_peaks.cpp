#include "dsp/extract_peaks.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdlib>
#include <span>
#include <utility>

#include "dsp/fixed_math.hpp"
#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"
#include "dsp/window_response.hpp"

namespace dsp {

namespace {

/// body(0) .. body(kTimes - 1), written out.
template <std::size_t kTimes, class Body>
void for_each_index(Body body) {
    [&body]<std::size_t... kIndex>(std::index_sequence<kIndex...>) {
        (body(kIndex), ...);
    }
    (std::make_index_sequence<kTimes>{});
}

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

/// Merges two descending lists, neither of them empty, into one.
void merge(const Candidate* a, const Candidate* a_end, const Candidate* b, const Candidate* b_end,
           Candidate* to) {
    Candidate from_a = *a;
    Candidate from_b = *b;
    for (;;) {
        if (from_a > from_b) {
            *to++ = from_a;
            if (++a == a_end) break;
            from_a = *a;
        } else {
            *to++ = from_b;
            if (++b == b_end) break;
            from_b = *b;
        }
    }
    while (a != a_end) *to++ = *a++;
    while (b != b_end) *to++ = *b++;
}

/// Sorts four neighbours, descending.
void sort_four(Candidate* list) {
    const auto order = [](Candidate& larger, Candidate& smaller) {
        const Candidate least = std::min(larger, smaller);
        larger = std::max(larger, smaller);
        smaller = least;
    };
    std::array<Candidate, 4> x{list[0], list[1], list[2], list[3]};
    order(x[0], x[1]);
    order(x[2], x[3]);
    order(x[0], x[2]);
    order(x[1], x[3]);
    order(x[1], x[2]);
    for (std::size_t i = 0; i < x.size(); ++i) list[i] = x[i];
}

/// Descending, by merging runs of four, eight and so on. Zeros follow the last one up to the next multiple of
/// four. Returns where the result is: there or in `other`.
[[gnu::noinline]] const CandidateList& sort(CandidateList& list, CandidateList& other, std::size_t count) {
    count = (count + 3) & ~std::size_t{3};
    for (std::size_t i = 0; i < count; i += 4) sort_four(&list[i]);
    CandidateList* from = &list;
    CandidateList* to = &other;
    for (std::size_t run = 4; run < count; run *= 2) {
        for (std::size_t begin = 0; begin < count; begin += 2 * run) {
            const Candidate* a = from->data() + begin;
            const Candidate* end = from->data() + std::min(begin + 2 * run, count);
            if (begin + run < count) {
                merge(a, a + run, a + run, end, to->data() + begin);
            } else {
                std::copy(a, end, to->data() + begin);
            }
        }
        std::swap(from, to);
    }
    return *from;
}

/// Fills `list` with the strongest candidates. Returns how many; counts the rest.
[[gnu::noinline]] std::size_t collect(const PowerMap& map, const CellMask& peaks, CandidateList& list,
                                      int& rest) {
    std::size_t count = 0;
    for (int r = 0; r < kRangeCells; ++r) {
        const std::uint64_t row = peaks.row[static_cast<std::size_t>(r)];
        for (int half = 0; half < kDopplerCells; half += 32) {
            for (auto bits = static_cast<std::uint32_t>(row >> half); bits != 0; bits &= bits - 1) {
                const int d = half + std::countr_zero(bits);
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
    }
    for (std::size_t end = count; end % 4 != 0; ++end) list[end] = 0;
    return count;
}

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
[[gnu::noinline]] std::int32_t scaled_up(std::int32_t v, int up) {
    if (up > 28) up = 28;
    const std::int32_t most = (1 << 28) >> up;
    return std::clamp(v, -most, most) * (1 << up);
}

/// What the rows around a peak have in common.
struct Alignment {
    /// Takes the phase off the cells, so that a lone target is real and positive in the peak cell.
    packed::Pair rotation;
    std::array<packed::Pair, kTaps> weight;  ///< along Doppler
    int exponent;                            ///< of the peak's row
};

/// In the unit of the peak's row, times |rotation| / 16. `exponent`: of this row, at most 31 away.
[[gnu::always_inline]] inline RowSums sum_row(const Complex16* cells, int exponent,
                                              const Alignment& alignment) {
    RowSums sums{0, 0};
    for_each_index<kTaps>([&](std::size_t j) {
        const std::int32_t aligned = packed::dot(packed::load(&cells[j].re), alignment.rotation);
        sums.amplitude = packed::scale_add_0(aligned, alignment.weight[j], sums.amplitude);
        sums.offset = packed::scale_add_1(aligned, alignment.weight[j], sums.offset);
    });
    const int down = alignment.exponent - exponent;
    if (down >= 0) return {sums.amplitude >> down, sums.offset >> down};
    // Another, far stronger target's row.
    return {scaled_up(sums.amplitude, -down), scaled_up(sums.offset, -down)};
}

using PatchSums = std::array<RowSums, kTaps>;

/// Of rows that are not all there or not in one piece: Doppler is cyclic, those below cell 0 are the other
/// half of a real signal's spectrum, X[-r, -d] = conj X[r, d], and those above the last one are not kept:
/// zero.
[[gnu::noinline]] PatchSums sum_copied_rows(const Spectrum& spectrum, const Cell& peak,
                                            const Alignment& alignment) {
    PatchSums sums;
    int range = peak.range - kReach;
    for (RowSums& row_sums : sums) {
        row_sums = {};
        if (range < kRangeCells) {
            const auto row = static_cast<std::size_t>(std::abs(range));
            const int first = (range < 0 ? -peak.doppler : peak.doppler) - kReach;
            std::array<Complex16, kTaps> copy;
            const Complex16* cells = copy.data();
            if (range < 0 || static_cast<unsigned>(first) > kDopplerCells - kTaps) {
                for (std::size_t j = 0; j < kTaps; ++j) {
                    copy[j] = spectrum.row[row][(static_cast<std::size_t>(first) + j) & (kDopplerCells - 1)];
                }
                if (range < 0) {
                    std::ranges::reverse(copy);
                    for (Complex16& x : copy) x.im = static_cast<std::int16_t>(saturate16(-x.im));
                }
            } else {
                cells = &spectrum.row[row][static_cast<std::size_t>(first)];
            }
            row_sums = sum_row(cells, spectrum.row_exponent[row], alignment);
        }
        ++range;
    }
    return sums;
}

/// Both responses: of the windows along range and along Doppler.
struct Responses {
    const WindowResponse& range;
    const WindowResponse& doppler;
};

/// Which maxima are no targets but sidelobes of others. Remembers the targets by range cell: away from a
/// target's rows its sidelobes are so weak that most pairs need no look.
class Sidelobes {
  public:
    Sidelobes(const Responses& response, const PeakConfig& config, const CandidateList& list)
        : range_(response.range.sidelobe.data()),
          doppler_(response.doppler.sidelobe.data()),
          list_(list.data()),
          margin_(log2_from_cdb(config.sidelobe_margin_cdb)),
          dynamic_range_(log2_from_cdb(config.dynamic_range_cdb)) {}

    /// Whether sidelobes of the targets explain `peak`, no neighbour of theirs and not stronger than any peak
    /// before. What is far below the strongest target is never believed.
    [[nodiscard]] bool explain(const Cell& peak) {
        if (occupied_ == 0) return false;
        if (peak.power < strongest_ - dynamic_range_) return true;
        while (peak.power < enough_) widen();
        constexpr std::uint32_t kAll = ~std::uint32_t{0};
        const std::uint32_t rows = occupied_ & kAll << std::max(peak.range - reach_, 0) &
                                   kAll >> std::max(kRangeCells - 1 - peak.range - reach_, 0);
        if (rows == 0) return false;
        const std::int32_t over_margin = peak.power - margin_;
        if (explain(peak.range, peak.doppler, over_margin, rows)) return true;
        // The other half of a real signal's spectrum, at -range, is no nearer.
        const bool mirrored_near = peak.range + std::countr_zero(rows) <= reach_ ||
                                   peak.range - std::countl_zero(rows) >= kRangeCells + 1 - reach_;
        return mirrored_near && explain(-peak.range, -peak.doppler, over_margin, rows);
    }
    /// list[index] is a target.
    void add(std::size_t index) {
        const Cell target = unpack(list_[index]);
        if (occupied_ == 0) {
            strongest_ = target.power;
            widen();
        }
        occupied_ |= std::uint32_t{1} << target.range;
        std::uint8_t& last = last_[static_cast<std::size_t>(target.range)];
        const auto link = static_cast<std::uint8_t>(kRangeCells + index);
        next_[last] = link;
        next_[link] = 0;
        last = link;
    }

  private:
    /// Targets in these `rows` explain a peak at this place, if they are stronger by what their window's
    /// response is below one.
    [[nodiscard, gnu::noinline]] bool explain(int range, int doppler, std::int32_t over_margin,
                                              std::uint32_t rows) const {
        const std::int16_t* const doppler_response = doppler_;
        const auto distance = [](int cells) { return static_cast<std::size_t>(cells) & (kWindowLength - 1); };
        for (; rows != 0; rows &= rows - 1) {
            const int row = std::countr_zero(rows);
            const std::int32_t in_row = range_[distance(row - range)];
            std::size_t link = next_[static_cast<std::size_t>(row)];
            do {
                const Cell target = unpack(list_[link - kRangeCells]);
                const std::int32_t excess = over_margin - target.power;
                if (excess >= in_row) break;  // those that follow are weaker still
                if (excess < in_row + doppler_response[distance(target.doppler - doppler)]) return true;
                link = next_[link];
            } while (link != 0);
        }
        return false;
    }

    /// Beyond reach_ the response is less than a peak of power enough_ over the strongest target. (Where it
    /// rises again, by one step: see WindowResponse::sidelobe.)
    void widen() {
        ++reach_;
        enough_ = reach_ == kRangeCells
                      ? 0
                      : std::max(range_[reach_ + 1], range_[reach_ + 2]) + strongest_ + margin_;
    }

    static_assert(kRangeCells + kMaxCandidates < 256 && kRangeCells == 32);
    static constexpr auto kRows = [] {
        std::array<std::uint8_t, kRangeCells> rows{};
        for (std::size_t r = 0; r < kRangeCells; ++r) rows[r] = static_cast<std::uint8_t>(r);
        return rows;
    }();
    const std::int16_t* range_;  ///< WindowResponse::sidelobe
    const std::int16_t* doppler_;
    const Candidate* list_;
    std::int32_t margin_;  ///< log2 of power, Q6.10, as the others
    std::int32_t dynamic_range_;
    std::int32_t strongest_ = 0;
    std::uint32_t occupied_ = 0;  ///< rows with targets, bit r
    int reach_ = 0;               ///< cells
    std::int32_t enough_ = 0;
    // The targets of each row as a list, strongest first. Links: r is the row itself, kRangeCells + i is
    // list[i].
    std::array<std::uint8_t, kRangeCells + kMaxCandidates> next_;  ///< 0: none
    std::array<std::uint8_t, kRangeCells> last_ = kRows;
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

[[gnu::noinline]] Place locate(const Spectrum& spectrum, const PowerMap& map, const Cell& peak,
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

    const auto row = static_cast<std::size_t>(peak.range);
    const packed::Pair top = packed::load(&spectrum.row[row][static_cast<std::size_t>(peak.doppler)].re);
    // With 14 bits, so that no sum of two products overflows.
    const int bits = packed::magnitude_bits(packed::spread(top));
    Alignment alignment;
    alignment.rotation =
        packed::pack_low(packed::lane0(top) * (1 << 14) >> bits, packed::lane1(top) * (1 << 14) >> bits);
    alignment.exponent = spectrum.row_exponent[row];
    const WindowResponse::Lobe& range_lobe = response.range.lobe[static_cast<std::size_t>(range.grid)];
    const WindowResponse::Lobe& doppler_lobe = response.doppler.lobe[static_cast<std::size_t>(doppler.grid)];
    const WindowResponse::Weight* w = &doppler_lobe.weight[doppler.mirrored ? kTaps - 1 : 0];
    for_each_index<kTaps>([&](std::size_t j) {
        alignment.weight[j] = packed::load(&w->amplitude);
        w += doppler.mirrored ? -1 : 1;
    });
    PatchSums rows;
    if (static_cast<unsigned>(peak.range - kReach) < kRangeCells - 2 * kReach &&
        static_cast<unsigned>(peak.doppler - kReach) < kDopplerCells - 2 * kReach) {
        const Complex16* cells = &spectrum.row[row - kReach][static_cast<std::size_t>(peak.doppler) - kReach];
        const std::int16_t* exponents = &spectrum.row_exponent[row - kReach];
        rows = [&]<std::size_t... kIndex>(std::index_sequence<kIndex...>) {
            return PatchSums{sum_row(cells + kIndex * kDopplerCells, exponents[kIndex], alignment)...};
        }
        (std::make_index_sequence<kTaps>{});
    } else {
        const auto& w5 = alignment.weight;  // one by one: so alignment itself stays in registers
        rows = sum_copied_rows(spectrum, peak,
                               {alignment.rotation, {w5[0], w5[1], w5[2], w5[3], w5[4]}, alignment.exponent});
    }

    std::int32_t amplitude = 0;
    std::int32_t range_sum = 0;
    std::int32_t doppler_sum = 0;
    w = &range_lobe.weight[range.mirrored ? kTaps - 1 : 0];
    for_each_index<kTaps>([&](std::size_t i) {
        const packed::Pair pair = packed::load(&w->amplitude);
        amplitude = packed::scale_add_0(rows[i].amplitude, pair, amplitude);
        range_sum = packed::scale_add_1(rows[i].amplitude, pair, range_sum);
        doppler_sum = packed::scale_add_0(rows[i].offset, pair, doppler_sum);
        w += range.mirrored ? -1 : 1;
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
    const std::int32_t lobe =
        2 * (peak.power - log2_amplitude + (14 - 8 - bits - 2 * alignment.exponent) * kLogOne) -
        (2 * WindowResponse::kWeightBits + 1) * kLogOne;
    place.range_variance = lobe + range_lobe.offset_variance + doppler_lobe.amplitude_variance;
    place.doppler_variance = lobe + doppler_lobe.offset_variance + range_lobe.amplitude_variance;
    if (!has_range_above) place.range_variance += 3 * kLogOne;  // one cell of the four, and a table's step
    return place;
}

/// From cells to the units of a detection.
class Axis {
  public:
    /// `model_variance`: cells^2.
    Axis(Real cell, Real model_variance) : cell_(cell) {
        const Real square = cell * cell;
        model_variance_ = square * model_variance;
        log2_square_ =
            std::min<std::int32_t>(log2_q10(static_cast<std::uint32_t>(square.raw())) - 30 * kLogOne, 0);
    }
    [[nodiscard]] Real position(std::int32_t cells_q15) const {
        return cell_ * Real::from_raw(cells_q15 * (1 << (Real::fraction_bits - 15)));
    }
    /// Of noise, whose log2 in cells^2 is given, Q6.10, at most 256, and the model.
    [[nodiscard]] Real variance(std::int32_t log2_noise) const {
        const std::uint32_t noise_q30 = exp2_q30(std::min<std::int32_t>(log2_noise, 0) + log2_square_);
        return Real::from_raw(saturated_sum(static_cast<std::int32_t>(noise_q30), model_variance_.raw()));
    }

  private:
    Real cell_;
    Real model_variance_;
    std::int32_t log2_square_;  ///< of a cell, over 2^8, Q6.10: at most 0
};

/// log2 of power, Q6.10, 0..63, in decibels: 10 log10(2) / 2^10 each.
Real decibels(std::int32_t log2_power) {
    constexpr std::uint32_t kStepQ17 = 1'616'142'483;  // of Real
    return Real::from_raw(static_cast<std::int32_t>(
        detail::high_product(static_cast<std::uint32_t>(log2_power) << 15, kStepQ17)));
}

}  // namespace

void extract_peaks(const Spectrum& spectrum, const PowerMap& map, const CellMask& peaks, const OsCfar& cfar,
                   WindowKind range_window, WindowKind doppler_window, const PeakConfig& config,
                   const CellScale& scale, DetectionList& detections) {
    const Responses responses{window_response(range_window), window_response(doppler_window)};
    const std::int32_t min_snr = log2_from_cdb(config.min_snr_cdb);
    const bool none_too_weak = min_snr <= cfar.least_snr();
    // 32 bits suffice for half a cell; no quotient lies half way between two numbers.
    const Real model_error = Real::from_raw(static_cast<std::int32_t>(
        ((static_cast<std::uint32_t>(config.model_error_mcell) << Real::fraction_bits) + 500) / 1000));
    const Real model_variance = model_error * model_error;
    const Axis range_axis(scale.range_cell_m, model_variance);
    const Axis rate_axis(scale.rate_cell_mps, model_variance);
    const Real coupling2 = scale.coupling_s * scale.coupling_s;
    detections.count = 0;
    detections.dropped = 0;
    CandidateList memory;
    CandidateList more_memory;
    const std::size_t candidates = collect(map, peaks, memory, detections.dropped);
    const CandidateList& list = sort(memory, more_memory, candidates);
    Sidelobes sidelobes(responses, config, list);
    for (std::size_t c = 0; c < candidates; ++c) {
        const Cell peak = unpack(list[c]);
        if (sidelobes.explain(peak)) continue;
        sidelobes.add(c);
        if (detections.count == kMaxDetections && none_too_weak) {
            ++detections.dropped;
            continue;
        }

        const std::int32_t snr = peak.power - cfar.noise(map, peak.range, peak.doppler);
        if (snr < min_snr) continue;
        if (detections.count == kMaxDetections) {
            ++detections.dropped;
            continue;
        }
        const Place place = locate(spectrum, map, peak, responses);
        // Doppler cells 32..63 are closing; between cell 31 and 32 the position wraps from 32 to -32.
        std::int32_t doppler_q15 = peak.doppler * (1 << 15) + place.doppler_q15;
        if (doppler_q15 >= kDopplerCells / 2 * (1 << 15)) doppler_q15 -= kDopplerCells * (1 << 15);
        const std::int32_t range_q15 = peak.range * (1 << 15) + place.range_q15;
        Detection& detection = detections.item[static_cast<std::size_t>(detections.count++)];
        const Real rate = rate_axis.position(doppler_q15);
        const Real rate_variance = rate_axis.variance(place.doppler_variance - snr);
        detection.range_m = range_axis.position(range_q15) + scale.range_offset_m - scale.coupling_s * rate;
        detection.range_rate_mps = rate;
        detection.range_variance_m2 =
            range_axis.variance(place.range_variance - snr) + coupling2 * rate_variance;
        detection.rate_variance_m2ps2 = rate_variance;
        detection.snr_db = decibels(snr);
        detection.range_cell = static_cast<std::uint8_t>(peak.range);
        detection.doppler_cell = static_cast<std::uint8_t>(peak.doppler);
    }
}

}  // namespace dsp
