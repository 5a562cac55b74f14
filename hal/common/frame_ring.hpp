/// Two beat frames in memory, filled in turn by the front end's DMA while the processor works on the other
/// one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "dsp/beat_frame.hpp"

namespace hal {

/// One frame as the DMA leaves it. `opened` is written before the first sample and `closed` after the last,
/// both with the frame's stamp: the number of frames taken since power-up, counting from 1; 0 means never
/// written.
struct RingSlot {
    std::uint32_t opened;
    std::uint32_t closed;
    dsp::BeatFrame frame;
};

/// Shared with the front end, which fills one slot while the other is read.
using RingMemory = std::array<RingSlot, 2>;

enum class RingResult : std::uint8_t {
    none,   ///< nothing new
    taken,  ///< the newest complete frame was copied out
    torn,   ///< overrun: the DMA wrote into the frame while it was copied; what was copied is not a frame
    stale,  ///< stamps went back: the front end started anew, or its memory is old; the next newer one is
            ///< taken
};

struct RingCounters {
    std::uint32_t taken = 0;
    std::uint32_t lost = 0;  ///< stamps that were passed over because a newer frame was complete
    std::uint32_t torn = 0;
    std::uint32_t stale = 0;
};

/// The reading end. A slot is looked at only when both stamps agree, and once more after the copy.
class FrameRing {
  public:
    explicit FrameRing(RingMemory& memory) : memory_(memory) {}

    /// Copies the newest complete frame that has not been handed out yet. `frame` is meaningful only for
    /// `taken`. `sequence` is the stamp less one, so that the first frame is 0.
    RingResult take(dsp::BeatFrame& frame, std::uint32_t& sequence);

    // The writing end, for what stands in for a DMA.
    /// Opens the slot that does not hold the last published frame, if it is not open yet, for its samples to
    /// be written.
    dsp::BeatFrame& open();
    /// Closes it. False: no stamp exists for this sequence (2^32 - 1); the slot stays open.
    bool close(std::uint32_t sequence);

    [[nodiscard]] const RingCounters& counters() const { return counters_; }

  private:
    RingMemory& memory_;
    std::array<std::uint32_t, 2> seen_{};  ///< stamp last handled in each slot
    std::uint32_t last_ = 0;               ///< newest stamp handed out
    std::size_t writing_ = 0;              ///< slot that open() gives
    RingCounters counters_;
};

}  // namespace hal
