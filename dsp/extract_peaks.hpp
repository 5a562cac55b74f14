/// Cells over threshold to detections: one per target, in metres and metres per second, with variances.
#pragma once

#include <array>
#include <cstdint>

#include "dsp/detection.hpp"
#include "dsp/os_cfar.hpp"
#include "dsp/range_doppler.hpp"
#include "dsp/waveform.hpp"
#include "dsp/window.hpp"

namespace dsp {

struct PeakConfig {
    std::int16_t min_snr_cdb = 0;  ///< detections below it are discarded, hundredths of a decibel, 0..4000
    /// A maximum is a sidelobe of a stronger one unless it exceeds the window's sidelobes by this much,
    /// hundredths of a decibel, 0..2000. Higher: fewer ghosts of fluctuating or moving targets, but weak
    /// targets beside strong ones are lost.
    std::int16_t sidelobe_margin_cdb = 500;
    /// Nothing weaker than the strongest cell of the map minus this is believed, hundredths of a decibel,
    /// 3000..9000.
    std::int16_t dynamic_range_cdb = 7500;
    /// Error of the point-target model itself, added to the variances: thousandths of a cell, 0..500. Lower:
    /// the tracker follows strong echoes more closely, but real cars are larger than a point.
    std::int16_t model_error_mcell = 20;

    constexpr bool operator==(const PeakConfig&) const = default;
    [[nodiscard]] constexpr bool valid() const {
        return min_snr_cdb >= 0 && min_snr_cdb <= 4000 && sidelobe_margin_cdb >= 0 &&
               sidelobe_margin_cdb <= 2000 && dynamic_range_cdb >= 3000 && dynamic_range_cdb <= 9000 &&
               model_error_mcell >= 0 && model_error_mcell <= 500;
    }
};
static_assert(PeakConfig{}.valid());

/// Local maxima over threshold that are examined for sidelobes; the weakest of more than these count as
/// dropped.
inline constexpr int kMaxCandidates = 128;

/// Replaces `detections`. `peaks`: local maxima over threshold in `map`, the log-power of `spectrum`.
///
/// Strongest first; a maximum that the sidelobes of stronger ones explain is no target and is not counted.
/// The place between the cells comes from the complex spectrum, five cells along the axis times five across
/// (WindowResponse): the logarithms of the peak's neighbours give a first guess, which selects the weights.
/// The variances come from the same weights and the SNR. The range of a target in the last two range cells
/// rests on the cell below alone and has a larger variance. `spectrum`: exponents of rows at most 31 apart,
/// as range_doppler() leaves them. Cost: about 1,150 instructions a detection, 40 % of them for its place and
/// a quarter for its noise level; besides, at most 30 for each pair of a candidate and a stronger target.
void extract_peaks(const Spectrum& spectrum, const PowerMap& map, const CellMask& peaks, const OsCfar& cfar,
                   WindowKind range_window, WindowKind doppler_window, const PeakConfig& config,
                   const CellScale& scale, DetectionList& detections);

}  // namespace dsp
