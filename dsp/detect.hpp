/// The whole signal processing of a frame: beat samples to detections.
#pragma once

#include <cstdint>

#include "dsp/beat_frame.hpp"
#include "dsp/detection.hpp"
#include "dsp/extract_peaks.hpp"
#include "dsp/frame_quality.hpp"
#include "dsp/os_cfar.hpp"
#include "dsp/range_doppler.hpp"
#include "dsp/waveform.hpp"
#include "dsp/window.hpp"

namespace dsp {

struct DspConfig {
    WindowKind range_window = WindowKind::hann;
    WindowKind doppler_window = WindowKind::hann;
    CfarConfig cfar;
    PeakConfig peaks;
    std::int16_t adc_full_scale = 2047;  ///< largest converter code, 1..32767; for frame_quality

    constexpr bool operator==(const DspConfig&) const = default;
    [[nodiscard]] constexpr bool valid() const {
        return range_window <= WindowKind::blackman && doppler_window <= WindowKind::blackman &&
               cfar.valid() && peaks.valid() && adc_full_scale > 0;
    }
};
static_assert(DspConfig{}.valid());

/// All memory the signal processing needs besides the frame, about 13 KiB: `map`,
/// `spectrum` and `noise_level` are those of the frame after detect().
struct Workspace {
    Spectrum spectrum;
    PowerMap map;
    std::uint16_t noise_level = 0;  ///< see noise_level()
    OsCfar cfar{CfarConfig{}};      ///< rebuilt when the configuration changes
};
static_assert(sizeof(Workspace) <= 14 * 1024);

/// Runs the stages in order. `config.valid()` must hold; a changed configuration takes effect at once.
/// Never fails: a dead frame gives no detections (frame_quality tells it from an empty road). `levels`: of
/// this frame, by inspect().
void detect(const BeatFrame& frame, const DcLevels& levels, const DspConfig& config, const CellScale& scale,
            Workspace& workspace, DetectionList& detections);

/// The same for a frame whose quality nobody asks for.
void detect(const BeatFrame& frame, const DspConfig& config, const CellScale& scale, Workspace& workspace,
            DetectionList& detections);

}  // namespace dsp
