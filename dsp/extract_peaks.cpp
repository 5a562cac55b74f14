#include "dsp/extract_peaks.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdlib>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/window_response.hpp"

namespace dsp {

namespace {

constexpr int kReach = WindowResponse::kReach;
constexpr int kTaps = WindowResponse::kTaps;

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

/// The cells around a peak with the peak's phase and the lobe's alternating sign taken off: a lone target is
/// real and positive there, the peak cell about 2^kUnitBits.
struct Patch {
    static constexpr int kUnitBits = 20;
    std::array<std::array<std::int32_t, kTaps>, kTaps> cell;  ///< [range][Doppler]
    std::int32_t unit;                                        ///< the peak cell exactly
};

Patch align(const Spectrum& spectrum, const Cell& peak) {
    const auto peak_row = static_cast<std::size_t>(peak.range);
    const Complex16 top = spectrum.row[peak_row][static_cast<std::size_t>(peak.doppler)];
    const std::int64_t power = std::int64_t{top.re} * top.re + std::int64_t{top.im} * top.im;
    const int down = static_cast<int>(std::bit_width(static_cast<std::uint64_t>(power))) - Patch::kUnitBits;
    const auto scale = [](std::int64_t v, int shift) {
        return saturate32(shift >= 0 ? round_shift(v, shift) : v * (std::int64_t{1} << std::min(-shift, 30)));
    };
    Patch patch{};
    patch.unit = scale(power, down);
    for (int i = 0; i < kTaps; ++i) {
        const int range = peak.range + i - kReach;
        // A real signal's spectrum below cell 0: X[-r, -d] = conj X[r, d]. Above the last row it is not kept.
        const bool mirrored = range < 0;
        if (range >= kRangeCells) continue;
        const auto row = static_cast<std::size_t>(mirrored ? -range : range);
        const int row_down = down + spectrum.row_exponent[peak_row] - spectrum.row_exponent[row];
        for (int j = 0; j < kTaps; ++j) {
            const int doppler = peak.doppler + j - kReach;
            const Complex16 x =
                spectrum
                    .row[row][static_cast<std::size_t>(mirrored ? -doppler : doppler) & (kDopplerCells - 1)];
            const std::int64_t aligned =
                std::int64_t{x.re} * top.re + std::int64_t{x.im} * (mirrored ? -top.im : top.im);
            patch.cell[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] =
                scale(((i + j) & 1) != 0 ? -aligned : aligned, row_down);
        }
    }
    return patch;
}

/// A WindowResponse's weights for a guess of either sign.
class Guess {
  public:
    Guess(const WindowResponse& response, std::int32_t offset_q15)
        : response_(response), mirrored_(offset_q15 < 0) {
        const std::int32_t steps = round_shift(std::abs(offset_q15) * WindowResponse::kGridPerCell, 15);
        index_ = std::min<std::int32_t>(steps, WindowResponse::kGrid - 1);
    }
    [[nodiscard]] std::int32_t amplitude(int tap) const { return response_.amplitude[index()][at(tap)]; }
    [[nodiscard]] std::int32_t offset(int tap) const {
        const std::int32_t weight = response_.offset[index()][at(tap)];
        return mirrored_ ? -weight : weight;
    }
    [[nodiscard]] std::int32_t value_q15() const {
        const std::int32_t value = index_ * ((1 << 15) / WindowResponse::kGridPerCell);
        return mirrored_ ? -value : value;
    }
    [[nodiscard]] std::uint32_t amplitude_variance() const { return response_.amplitude_variance[index()]; }
    [[nodiscard]] std::uint32_t offset_variance() const { return response_.offset_variance[index()]; }

  private:
    [[nodiscard]] std::size_t index() const { return static_cast<std::size_t>(index_); }
    [[nodiscard]] std::size_t at(int tap) const {
        return static_cast<std::size_t>(mirrored_ ? kTaps - 1 - tap : tap);
    }
    const WindowResponse& response_;
    bool mirrored_;
    std::int32_t index_;
};

/// Weighted sums of a patch: across one axis with the amplitude weights of `across`, then along the other.
struct Sums {
    std::int64_t offset = 0;
    std::int64_t amplitude = 0;
};

template <class At>
Sums weigh(const Guess& along, const Guess& across, At cell) {
    Sums sums;
    for (int i = 0; i < kTaps; ++i) {
        std::int64_t profile = 0;
        for (int j = 0; j < kTaps; ++j) profile += std::int64_t{across.amplitude(j)} * cell(i, j);
        profile = round_shift(profile, WindowResponse::kWeightBits);
        sums.offset += profile * along.offset(i);
        sums.amplitude += profile * along.amplitude(i);
    }
    sums.amplitude = round_shift(sums.amplitude, WindowResponse::kWeightBits);
    sums.offset = round_shift(sums.offset, WindowResponse::kWeightBits);
    return sums;
}

/// Place and quality of a peak between the cells.
struct Place {
    std::int32_t range_q15 = 0;  ///< offset from the peak cell, cells
    std::int32_t doppler_q15 = 0;
    std::int32_t range_variance = 0;  ///< log2 of cells^2 for a peak cell at the level of the noise, Q6.10
    std::int32_t doppler_variance = 0;
};

/// A peak of one target lies within half a cell of the largest cell; noise moves it a little further.
constexpr std::int32_t kFarthestQ15 = (3 << 15) / 4;

std::int32_t refine(const Guess& guess, const Sums& sums) {
    if (sums.amplitude <= 0) return 0;
    const std::int64_t step = round_divide<std::int64_t>(sums.offset * (1 << 15), sums.amplitude);
    return static_cast<std::int32_t>(
        std::clamp<std::int64_t>(guess.value_q15() + step, -kFarthestQ15, kFarthestQ15));
}

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
    const Patch patch = align(spectrum, peak);
    const auto along_range = [&patch](int i, int j) {
        return patch.cell[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    };
    const auto along_doppler = [&patch](int i, int j) {
        return patch.cell[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)];
    };
    const bool has_range_above = peak.range + kReach < kRangeCells;
    Place place;
    if (!has_range_above) {
        const std::int32_t below = map.at(peak.range - 1, peak.doppler);
        place.range_q15 = offset_from_below(range_response, below - peak.power);
    }
    // Each round's error is the square of the one before; the grid limits it to 1/32 cell from the second on.
    constexpr int kRounds = 3;
    std::int64_t amplitude = 0;
    for (int round = 0; round < kRounds; ++round) {
        const Guess range(range_response, place.range_q15);
        const Guess doppler(doppler_response, place.doppler_q15);
        const Sums sums = weigh(doppler, range, along_doppler);
        amplitude = sums.amplitude;
        place.doppler_q15 = refine(doppler, sums);
        if (has_range_above) place.range_q15 = refine(range, weigh(range, doppler, along_range));
    }
    // Noise adds (g'Cg)(a'Ca) / 2A^2 to the offset, A the lobe's amplitude and not that of the peak cell.
    const Guess range(range_response, place.range_q15);
    const Guess doppler(doppler_response, place.doppler_q15);
    const auto log2 = [](std::int64_t v) {
        return log2_q10(static_cast<std::uint32_t>(std::clamp<std::int64_t>(v, 1, 1LL << 31)));
    };
    const std::int32_t lobe =
        2 * (log2(patch.unit) - log2(amplitude)) - (2 * WindowResponse::kWeightBits + 1) * kLogOne;
    place.range_variance = lobe + log2(range.offset_variance()) + log2(doppler.amplitude_variance());
    place.doppler_variance = lobe + log2(doppler.offset_variance()) + log2(range.amplitude_variance());
    if (!has_range_above) place.range_variance += 3 * kLogOne;  // one cell of the four, and a table's step
    return place;
}

/// A standard deviation of 1/n cells that is there without noise, and the noise's part, as cells^2.
Real variance_cells(std::int32_t log2_variance, Real model_error) {
    const std::uint32_t noise = exp2_q30(std::min<std::int32_t>(log2_variance, 0));
    return Real::from_raw(static_cast<std::int32_t>(noise >> (30 - Real::fraction_bits))) +
           model_error * model_error;
}

}  // namespace

void extract_peaks(const Spectrum& spectrum, const PowerMap& map, const CellMask& peaks, const OsCfar& cfar,
                   WindowKind range_window, WindowKind doppler_window, const PeakConfig& config,
                   const CellScale& scale, CandidateList& scratch, DetectionList& detections) {
    const WindowResponse& range_response = window_response(range_window);
    const WindowResponse& doppler_response = window_response(doppler_window);
    const std::int32_t margin = log2_from_cdb(config.sidelobe_margin_cdb);
    const std::int32_t min_snr = log2_from_cdb(config.min_snr_cdb);
    const std::int32_t dynamic_range = log2_from_cdb(config.dynamic_range_cdb);
    const auto response_to = [&](int range_distance, int doppler_distance) {
        const auto fold = [](int distance) {  // to 0..32, the spectrum being cyclic
            const int turn = distance & (kWindowLength - 1);
            return static_cast<std::size_t>(std::min(turn, kWindowLength - turn));
        };
        return std::int32_t{range_response.sidelobe[fold(range_distance)]} +
               doppler_response.sidelobe[fold(doppler_distance)];
    };
    const Real model_error = Real::ratio(config.model_error_mcell, 1000);

    detections.count = 0;
    detections.dropped = 0;
    const int candidates = collect(map, peaks, scratch, detections.dropped);
    int targets = 0;  // the candidates that are no sidelobes move to the front of the list
    for (int c = 0; c < candidates; ++c) {
        const Cell peak = unpack(scratch[static_cast<std::size_t>(c)]);
        bool sidelobe = false;
        for (int t = 0; t < targets && !sidelobe; ++t) {
            const Cell target = unpack(scratch[static_cast<std::size_t>(t)]);
            const std::int32_t sidelobes =
                std::max(response_to(target.range - peak.range, target.doppler - peak.doppler),
                         // A real signal's other half: the spectrum at -range, -Doppler.
                         response_to(target.range + peak.range, target.doppler + peak.doppler));
            sidelobe = peak.power < target.power + std::max(sidelobes + margin, -dynamic_range);
        }
        if (sidelobe) continue;
        scratch[static_cast<std::size_t>(targets++)] = pack(peak);

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
        detection.rate_variance_m2ps2 = scale.rate_cell_mps * scale.rate_cell_mps *
                                        variance_cells(place.doppler_variance - snr, model_error);
        detection.range_variance_m2 = scale.range_cell_m * scale.range_cell_m *
                                          variance_cells(place.range_variance - snr, model_error) +
                                      scale.coupling_s * scale.coupling_s * detection.rate_variance_m2ps2;
        detection.snr_db = Real::ratio(snr * std::int64_t{301'030}, std::int64_t{100'000} * kLogOne);
        detection.range_cell = static_cast<std::uint8_t>(peak.range);
        detection.doppler_cell = static_cast<std::uint8_t>(peak.doppler);
    }
}

}  // namespace dsp
