/// A CAN controller, or what stands for it.
#pragma once

#include <cstdint>

#include "can/frame.hpp"

namespace hal {

enum class CanState : std::uint8_t { active, passive, bus_off, down };

/// Every way a frame can get lost has a counter. They only grow (modulo 2^32).
struct CanCounters {
    std::uint32_t sent = 0;
    std::uint32_t received = 0;
    std::uint32_t dropped = 0;  ///< given to send() but not sent: queue full, bus off, interface down
    std::uint32_t receive_overflow = 0;  ///< lost before receive() was called
    std::uint32_t rejected = 0;  ///< received but not a standard data frame (extended, RTR, error, FD)
    std::uint32_t bus_off = 0;   ///< times the controller went bus off
};

class CanPort {
  public:
    /// Queues a frame; does not wait for the bus longer than a bounded time. False: dropped, and counted.
    virtual bool send(const can::Frame& frame) = 0;
    /// The next received standard data frame. False: none waiting.
    virtual bool receive(can::Frame& frame) = 0;
    /// Called once a cycle before the first send: drives recovery, and discards what is still queued of the
    /// last list so that a consumer always gets the newest one.
    virtual void begin_cycle() = 0;
    virtual CanState state() = 0;
    virtual CanCounters counters() = 0;

  protected:
    ~CanPort() = default;
};

}  // namespace hal
