#include "dsp/detect.hpp"

#include <algorithm>

#include "dsp/log2.hpp"

namespace dsp {

void detect(const BeatFrame& frame, const DcLevels& levels, const DspConfig& config, const CellScale& scale,
            Workspace& workspace, DetectionList& detections) {
    if (!(workspace.cfar.config() == config.cfar)) workspace.cfar = OsCfar(config.cfar);
    range_doppler(frame, levels, config.range_window, config.doppler_window, workspace.spectrum,
                  workspace.map);
    workspace.noise_level = noise_level(workspace.map, config.cfar.first_range_cell);
    // Of noise, three quarters of the cells are above this level.
    const std::int32_t level = workspace.noise_level - kLogOne * 5 / 4;
    CellMask peaks;
    cfar_peaks(workspace.map, workspace.cfar, static_cast<std::uint16_t>(std::max<std::int32_t>(level, 0)),
               peaks);
    extract_peaks(workspace.spectrum, workspace.map, peaks, workspace.cfar, config.range_window,
                  config.doppler_window, config.peaks, scale, detections);
}

void detect(const BeatFrame& frame, const DspConfig& config, const CellScale& scale, Workspace& workspace,
            DetectionList& detections) {
    DcLevels levels;
    (void)inspect(frame, config.adc_full_scale, levels);
    detect(frame, levels, config, scale, workspace, detections);
}

}  // namespace dsp
