#include "hal/common/frame_ring.hpp"

#include <atomic>
#include <cstring>

namespace hal {
namespace {

/// Another master writes this memory: one real load, in order with what follows.
std::uint32_t load(const std::uint32_t& stamp) {
    const std::uint32_t value = *static_cast<const volatile std::uint32_t*>(&stamp);
    std::atomic_thread_fence(std::memory_order_acquire);
    return value;
}

void store(std::uint32_t& stamp, std::uint32_t value) {
    std::atomic_thread_fence(std::memory_order_release);
    *static_cast<volatile std::uint32_t*>(&stamp) = value;
    std::atomic_thread_fence(std::memory_order_release);
}

bool newer(std::uint32_t a, std::uint32_t b) {
    const std::uint32_t distance = a - b;
    return distance != 0 && distance < 0x8000'0000U;
}

}  // namespace

RingResult FrameRing::take(dsp::BeatFrame& frame, std::uint32_t& sequence) {
    std::uint32_t stamp = 0;
    std::size_t from = 0;
    for (std::size_t i = 0; i < memory_.size(); ++i) {
        const std::uint32_t closed = load(memory_[i].closed);
        if (closed == 0 || closed == seen_[i] || load(memory_[i].opened) != closed) continue;
        if (stamp == 0 || newer(closed, stamp)) {
            stamp = closed;
            from = i;
        }
    }
    if (stamp == 0) return RingResult::none;

    // memmove: the destination may lie in the ring itself.
    std::memmove(&frame, &memory_[from].frame, sizeof frame);
    std::atomic_thread_fence(std::memory_order_acquire);
    if (load(memory_[from].opened) != stamp || load(memory_[from].closed) != stamp) {
        ++counters_.torn;
        return RingResult::torn;
    }
    // What is in the other slot now is older than what was taken and never of use again.
    for (std::size_t i = 0; i < memory_.size(); ++i) {
        const std::uint32_t closed = load(memory_[i].closed);
        if (i == from || !newer(closed, stamp)) seen_[i] = closed;
    }
    const std::uint32_t previous = last_;
    last_ = stamp;
    if (previous != 0 && !newer(stamp, previous)) {
        ++counters_.stale;
        return RingResult::stale;
    }
    if (previous != 0) counters_.lost += stamp - previous - 1;
    ++counters_.taken;
    sequence = stamp - 1;
    return RingResult::taken;
}

dsp::BeatFrame& FrameRing::open() {
    RingSlot& slot = memory_[writing_];
    if (slot.opened != 0) store(slot.opened, 0);
    return slot.frame;
}

bool FrameRing::close(std::uint32_t sequence) {
    const std::uint32_t stamp = sequence + 1;
    if (stamp == 0) return false;
    RingSlot& slot = memory_[writing_];
    store(slot.opened, stamp);
    store(slot.closed, stamp);
    writing_ = 1 - writing_;
    return true;
}

}  // namespace hal
