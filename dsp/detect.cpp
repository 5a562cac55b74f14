#include "dsp/detect.hpp"

namespace dsp {

void detect(const BeatFrame& frame, const DspConfig& config, const CellScale& scale, Workspace& workspace,
            DetectionList& detections) {
    if (!(workspace.cfar.config() == config.cfar)) workspace.cfar = OsCfar(config.cfar);
    range_doppler(frame, config.range_window, config.doppler_window, workspace.spectrum, workspace.map);
    CellMask maxima;
    local_maxima(workspace.map, config.cfar.first_range_cell, maxima);
    os_cfar(workspace.map, workspace.cfar, maxima, workspace.peaks);
    extract_peaks(workspace.spectrum, workspace.map, workspace.peaks, workspace.cfar, config.range_window,
                  config.doppler_window, config.peaks, scale, workspace.candidates, detections);
}

}  // namespace dsp
