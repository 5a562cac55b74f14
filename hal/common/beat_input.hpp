/// The beat source of a board: the ring the front end's DMA fills, which a serial line can fill in its place.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#include "hal/common/beat_link.hpp"
#include "hal/common/frame_ring.hpp"
#include "hal/contract/beat_source.hpp"

namespace hal {

/// One end of a serial line: `read` gives the next byte, 0 to 255, or -1 when none waits.
template <class T>
concept ByteInput = requires(T input) {
    { input.read() } -> std::same_as<int>;
};

/// `Input` and `Timer` are the board's concrete classes: their calls are direct, so that no virtual function
/// of an image calls another one and its call graph provably has no cycle.
template <ByteInput Input, class Timer>
class BeatInput final : public BeatSource {
  public:
    BeatInput(RingMemory& memory, Input& input, Timer& timer, std::uint32_t period_us)
        : ring_(memory), input_(input), timer_(timer), period_us_(period_us) {}

    /// Waits until a twentieth of a period before the period ends, so that a cycle without a frame is over in
    /// time; the periods follow each other from the first call on. `invalid`: nothing but broken packets,
    /// torn frames or stale stamps; what was torn is in `frame`.
    BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        const std::uint64_t now_us = timer_.now_us();
        if (period_end_us_ == 0 || period_end_us_ > now_us + period_us_) period_end_us_ = now_us;
        while (period_end_us_ <= now_us) period_end_us_ += period_us_;
        const std::uint64_t deadline_us = period_end_us_ - period_us_ / 20;
        const std::uint32_t broken_before = broken_;
        bool taken = false;
        do {
            poll();
            taken = ring_.take(frame, sequence) == RingResult::taken;
            if (!taken) timer_.pause();
        } while (!taken && timer_.now_us() < deadline_us);
        broken_ = count_broken();
        if (taken) return BeatResult::ok;
        return broken_ != broken_before ? BeatResult::invalid : BeatResult::missing;
    }

    /// Empties the serial line as far as the next complete frame. To be called at least once every 64 bytes,
    /// 0.6 ms, while frames may come in that way: see ReceivingClock.
    void poll() {
        for (std::size_t i = 0; i < kBeatPacketBytes; ++i) {
            const int byte = input_.read();
            if (byte < 0) return;
            if (!link_.push(static_cast<std::uint8_t>(byte), ring_.open())) continue;
            if (!ring_.close(link_.sequence())) ++unstampable_;
            return;
        }
    }

    [[nodiscard]] const RingCounters& ring_counters() const { return ring_.counters(); }
    [[nodiscard]] const BeatLinkCounters& link_counters() const { return link_.counters(); }

  private:
    [[nodiscard]] std::uint32_t count_broken() const {
        return link_.counters().crc_errors + ring_.counters().torn + ring_.counters().stale + unstampable_;
    }

    FrameRing ring_;
    BeatLinkReceiver link_;
    Input& input_;
    Timer& timer_;
    std::uint32_t period_us_;
    std::uint64_t period_end_us_ = 0;
    std::uint32_t unstampable_ = 0;
    std::uint32_t broken_ = 0;  ///< count_broken() as the last cycle left it
};

}  // namespace hal
