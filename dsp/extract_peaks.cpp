#include "dsp/extract_peaks.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"

namespace dsp {

namespace {

constexpr auto stronger = [](Candidate a, Candidate b) { return a > b; };

/// Offset of the maximum from the centre cell in Q15, from log-powers: for a Hann window and a lone tone
/// 2 (R - L) / (L + 2 C + R) of the magnitudes is exact.
std::int32_t hann_offset_q15(std::int32_t left, std::int32_t centre, std::int32_t right) {
    const auto l = static_cast<std::int32_t>(exp2_q15((std::min(left, centre) - centre) / 2));
    const auto r = static_cast<std::int32_t>(exp2_q15((std::min(right, centre) - centre) / 2));
    return round_divide<std::int32_t>((r - l) * (1 << 14), (l + r + (2 << 15)) >> 2);
}

}  // namespace

void extract_peaks(const PowerMap& map, const CellMask& peaks, const OsCfar& cfar, WindowKind range_window,
                   WindowKind doppler_window, const PeakConfig& config, const CellScale& scale,
                   CandidateList& scratch, DetectionList& detections) {
    (void)range_window;
    (void)doppler_window;
    detections.count = 0;
    detections.dropped = 0;
    int count = 0;
    for (int r = 0; r < kRangeCells; ++r) {
        for (std::uint64_t rest = peaks.row[static_cast<std::size_t>(r)]; rest != 0; rest &= rest - 1) {
            const int d = std::countr_zero(rest);
            const std::uint32_t power = map.cell[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)];
            const Candidate candidate = power << 16 | static_cast<std::uint32_t>(r << 6 | d);
            if (count < kMaxCandidates) {
                scratch[static_cast<std::size_t>(count++)] = candidate;
                std::push_heap(scratch.begin(), scratch.begin() + count, stronger);
            } else {
                ++detections.dropped;
                if (candidate > scratch[0]) {
                    std::pop_heap(scratch.begin(), scratch.end(), stronger);
                    scratch[kMaxCandidates - 1] = candidate;
                    std::push_heap(scratch.begin(), scratch.end(), stronger);
                }
            }
        }
    }
    std::sort_heap(scratch.begin(), scratch.begin() + count, stronger);
    for (int i = 0; i < count; ++i) {
        const Candidate candidate = scratch[static_cast<std::size_t>(i)];
        const int r = static_cast<int>(candidate >> 6 & 31U);
        const int d = static_cast<int>(candidate & 63U);
        const auto power = static_cast<std::int32_t>(candidate >> 16);
        const std::int32_t snr = power - cfar.noise(map, r, d);
        const Real snr_db = Real::ratio(snr * 30103LL, kLogOne * 10000LL);
        if (snr_db < Real::ratio(config.min_snr_cdb, 100)) continue;
        if (detections.count == kMaxDetections) {
            ++detections.dropped;
            continue;
        }
        const auto at = [&map](int rr, int dd) -> std::int32_t {
            return map.cell[static_cast<std::size_t>(rr)][static_cast<std::size_t>(dd & 63)];
        };
        const std::int32_t doppler_offset = hann_offset_q15(at(r, d - 1), power, at(r, d + 1));
        const std::int32_t range_offset =
            hann_offset_q15(r > 0 ? at(r - 1, d) : 0, power, r + 1 < kRangeCells ? at(r + 1, d) : 0);
        const int signed_doppler = d < kDopplerCells / 2 ? d : d - kDopplerCells;
        Detection detection;
        detection.range_rate_mps =
            scale.rate_cell_mps * Real::from_raw((signed_doppler * 32768 + doppler_offset) * (1 << 7));
        detection.range_m = scale.range_cell_m * Real::from_raw((r * 32768 + range_offset) * (1 << 7)) +
                            scale.range_offset_m - scale.coupling_s * detection.range_rate_mps;
        const Real cells2 = Real::ratio(1, 2000);
        detection.range_variance_m2 = scale.range_cell_m * scale.range_cell_m * cells2;
        detection.rate_variance_m2ps2 = scale.rate_cell_mps * scale.rate_cell_mps * cells2;
        detection.snr_db = snr_db;
        detection.range_cell = static_cast<std::uint8_t>(r);
        detection.doppler_cell = static_cast<std::uint8_t>(d);
        detections.item[static_cast<std::size_t>(detections.count++)] = detection;
    }
}

}  // namespace dsp
