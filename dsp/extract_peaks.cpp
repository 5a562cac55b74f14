#include "dsp/extract_peaks.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdlib>

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

/// Fills `list` with the strongest candidates in descending order. Returns how many; counts the rest.
int collect(const PowerMap& map, const CellMask& peaks, CandidateList& list, int& rest) {
    const auto stronger = [](Candidate a, Candidate b) { return a > b; };
    auto end = list.begin();  // a heap, the weakest on top
    for (int r = 0; r < kRangeCells; ++r) {
        const auto row = static_cast<std::size_t>(r);
        for (std::uint64_t bits = peaks.row[row]; bits != 0; bits &= bits - 1) {
            const int d = std::countr_zero(bits);
            const Candidate candidate = pack({r, d, map.at(r, d)});
            if (end == list.end()) {
                ++rest;
                if (candidate < list.front()) continue;
                std::pop_heap(list.begin(), end--, stronger);
            }
            *end++ = candidate;
            std::push_heap(list.begin(), end, stronger);
        }
    }
    std::sort_heap(list.begin(), end, stronger);
    return static_cast<int>(end - list.begin());
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

/// The cells around a peak with the peak's phase and the lobe's alternating sign taken off: a lone target is
/// real and positive there, the peak cell at least 2^13 and below 2^14, rounded down to one. What is more
/// than twice that saturates; it is another target's. Mirrored along an axis where the target lies on the
/// lower side of the peak cell, so that offsets are positive.
struct Patch {
    static constexpr int kUnitBits = 14;
    alignas(4) std::array<Taps, kTaps> along_doppler{};  ///< [range cell]
    alignas(4) std::array<Taps, kTaps> along_range{};    ///< [Doppler cell], the same cells
    std::int32_t log2_unit = 0;                          ///< of the peak cell, Q6.10
};

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
    packed::Pair turn = packed::pack(re, im);
    packed::Pair turn_and_change_sign = packed::pack(-re, -im);
    const int range_step = mirror_range ? -1 : 1;
    const int doppler_step = mirror_doppler ? -1 : 1;
    int range = peak.range - range_step * kReach;
    for (std::size_t i = 0; i < kTaps; ++i, range += range_step) {
        // A real signal's spectrum below cell 0: X[-r, -d] = conj X[r, d]. Above the last row it is not kept.
        const bool below = range < 0;
        const auto row = static_cast<std::size_t>(below ? -range : range);
        if (row < kRangeCells) {
            const int row_down = down + spectrum.row_exponent[peak_row] - spectrum.row_exponent[row];
            const int shift_down = std::clamp(row_down, 0, 31);
            const int shift_up = std::clamp(-row_down, 0, 15);  // a row with another, far stronger target
            const Complex16* cells = spectrum.row[row].data();
            int column = below ? -peak.doppler + doppler_step * kReach : peak.doppler - doppler_step * kReach;
            const int column_step = below ? -doppler_step : doppler_step;
            const auto place = [&](std::size_t j, packed::Pair rotation) {
                const packed::Pair x =
                    packed::load(&cells[static_cast<std::size_t>(column) & (kDopplerCells - 1)].re);
                const std::int32_t aligned = packed::dot(x, rotation, 0) >> shift_down;
                const auto cell =
                    static_cast<std::int16_t>(packed::clamp(packed::clamp(aligned) * (1 << shift_up)));
                patch.along_doppler[i][j] = cell;
                patch.along_range[j][i] = cell;
                column += column_step;
            };
            const auto conjugate = [below](packed::Pair x) {
                return below ? packed::pack(packed::lane0(x), -packed::lane1(x)) : x;
            };
            const packed::Pair even = conjugate(turn);
            const packed::Pair odd = conjugate(turn_and_change_sign);
            static_assert(kTaps == 5);
            place(0, even);
            place(1, odd);
            place(2, even);
            place(3, odd);
            place(4, even);
        }
        std::swap(turn, turn_and_change_sign);
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

    [[nodiscard]] std::int32_t amplitude(const Taps& taps) const {
        return weigh(taps, response_.amplitude[index()]);
    }
    /// Guess plus sum g s / A, the quotient within 2^-15, at most kFarthestQ15 either way. `amplitude`: A.
    [[nodiscard]] std::int32_t refined_q15(const Taps& taps, std::int32_t amplitude) const {
        if (amplitude <= 0) return 0;
        const std::int32_t offset = weigh(taps, response_.offset[index()]);
        std::int32_t step = 1 << 15;
        if (offset <= -amplitude) {
            step = -step;
        } else if (offset < amplitude) {
            const int up = std::countl_zero(static_cast<std::uint32_t>(amplitude)) - 1;
            step = (offset * (1 << up)) / (amplitude * (1 << up) >> 15);
        }
        return std::clamp(index_ * kStepQ15 + step, -kFarthestQ15, kFarthestQ15);
    }
    [[nodiscard]] std::int32_t refined_q15(const Taps& taps) const {
        return refined_q15(taps, amplitude(taps));
    }
    /// The amplitudes of five lines of cells.
    [[nodiscard]] Taps profile(const std::array<Taps, kTaps>& lines) const {
        Taps out{};
        constexpr int kBits = WindowResponse::kWeightBits;
        for (std::size_t i = 0; i < kTaps; ++i) {
            out[i] = saturate16((amplitude(lines[i]) + (1 << (kBits - 1))) >> kBits);
        }
        return out;
    }
    [[nodiscard]] std::uint32_t amplitude_variance() const { return response_.amplitude_variance[index()]; }
    [[nodiscard]] std::uint32_t offset_variance() const { return response_.offset_variance[index()]; }

  private:
    static constexpr std::int32_t kStepQ15 = (1 << 15) / WindowResponse::kGridPerCell;
    /// A peak of one target lies within half a cell of the largest cell; noise moves it a little further.
    static constexpr std::int32_t kFarthestQ15 = (3 << 15) / 4;
    [[nodiscard]] std::size_t index() const { return static_cast<std::size_t>(index_); }
    const WindowResponse& response_;
    std::int32_t index_;
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

Place locate(const Spectrum& spectrum, const PowerMap& map, const Cell& peak,
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
            place.range_q15 = Guess(range_response, place.range_q15).refined_q15(patch.along_range[kReach]);
        }
    }
    const Guess range(range_response, place.range_q15);
    const Guess doppler(doppler_response, place.doppler_q15);
    const Taps doppler_profile = range.profile(patch.along_range);
    const std::int32_t peak_amplitude = doppler.amplitude(doppler_profile);
    place.doppler_q15 = doppler.refined_q15(doppler_profile, peak_amplitude);
    if (has_range_above) place.range_q15 = range.refined_q15(doppler.profile(patch.along_doppler));
    if (mirror_range) place.range_q15 = -place.range_q15;
    if (mirror_doppler) place.doppler_q15 = -place.doppler_q15;
    // Noise adds (g'Cg)(a'Ca) / 2A^2 to the offset, A the lobe's amplitude and not that of the peak cell.
    const auto log2 = [](std::uint32_t v) { return log2_q10(std::max<std::uint32_t>(v, 1)); };
    const std::int32_t amplitude =
        log2(static_cast<std::uint32_t>(std::max(peak_amplitude, std::int32_t{1}))) -
        WindowResponse::kWeightBits * kLogOne;
    const std::int32_t lobe =
        2 * (patch.log2_unit - amplitude) - (2 * WindowResponse::kWeightBits + 1) * kLogOne;
    place.range_variance = lobe + log2(range.offset_variance()) + log2(doppler.amplitude_variance());
    place.doppler_variance = lobe + log2(doppler.offset_variance()) + log2(range.amplitude_variance());
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
    const std::int32_t margin = log2_from_cdb(config.sidelobe_margin_cdb);
    const std::int32_t min_snr = log2_from_cdb(config.min_snr_cdb);
    const std::int32_t dynamic_range = log2_from_cdb(config.dynamic_range_cdb);
    // The spectrum is cyclic: distances 0..32.
    const auto fold = [](int distance) {
        const int turn = distance & (kWindowLength - 1);
        return static_cast<std::size_t>(std::min(turn, kWindowLength - turn));
    };
    // Whether sidelobes of this response, log2, explain `peak` beside `target`.
    const auto explains = [&](const Cell& target, const Cell& peak, std::int32_t response) {
        return peak.power < target.power + std::max(response + margin, -dynamic_range);
    };
    const auto is_sidelobe = [&](const Cell& peak, const Cell& target) {
        const std::int32_t range = range_response.sidelobe[fold(target.range - peak.range)];
        // A real signal's other half: the spectrum at -range, -Doppler.
        const std::int32_t range_mirrored = range_response.sidelobe[fold(target.range + peak.range)];
        // What is too weak at the same Doppler shift is weaker at any other: nearly all pairs end here.
        if (!explains(target, peak, std::max(range, range_mirrored))) return false;
        return explains(
            target, peak,
            std::max(range + doppler_response.sidelobe[fold(target.doppler - peak.doppler)],
                     range_mirrored + doppler_response.sidelobe[fold(target.doppler + peak.doppler)]));
    };
    const Real model_error = Real::ratio(config.model_error_mcell, 1000);
    const Real model_variance = model_error * model_error;
    const Real range_cell2 = scale.range_cell_m * scale.range_cell_m;
    const Real rate_cell2 = scale.rate_cell_mps * scale.rate_cell_mps;
    const Real coupling2 = scale.coupling_s * scale.coupling_s;
    // Candidates are no neighbours, so a sidelobe is at most this (the mirrored spectrum begins at cell 2).
    const std::int32_t strongest_sidelobe =
        std::max(std::max<std::int32_t>(range_response.sidelobe[2], doppler_response.sidelobe[2]) + margin,
                 -dynamic_range);

    detections.count = 0;
    detections.dropped = 0;
    CandidateList list;
    const int candidates = collect(map, peaks, list, detections.dropped);
    int targets = 0;  // the candidates that are no sidelobes move to the front of the list
    for (int c = 0; c < candidates; ++c) {
        const Cell peak = unpack(list[static_cast<std::size_t>(c)]);
        bool sidelobe = false;
        for (int t = 0; t < targets && !sidelobe; ++t) {
            const Cell target = unpack(list[static_cast<std::size_t>(t)]);
            // The rest is weaker still.
            if (peak.power >= target.power + strongest_sidelobe && peak.range >= 2) break;
            sidelobe = is_sidelobe(peak, target);
        }
        if (sidelobe) continue;
        list[static_cast<std::size_t>(targets++)] = pack(peak);

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
