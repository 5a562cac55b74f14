/// Where beat frames come from: a DMA ring, a serial link, a simulator, a recording.
#pragma once

#include <cstdint>

#include "dsp/beat_frame.hpp"

namespace hal {

enum class BeatResult : std::uint8_t {
    ok,       ///< frame written
    missing,  ///< no new frame within the period; frame untouched
    invalid,  ///< a frame came but was short, stale or corrupt; `frame` holds nothing of use
    ended,    ///< a recording or a scenario is over; there will be no more frames
};

class BeatSource {
  public:
    /// Waits at most until the end of the period for the next frame. Never returns the same frame twice.
    /// `sequence` counts the frames the front end took, so a gap tells how many were lost.
    virtual BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) = 0;

  protected:
    ~BeatSource() = default;
};

}  // namespace hal
