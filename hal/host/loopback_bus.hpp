/// A CAN bus inside the process: what one port sends, all others receive, at once and in order.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <vector>

#include "hal/contract/can_port.hpp"

namespace hal {

struct LoopbackConfig {
    /// Frames a port holds until receive() takes them; later ones are lost and counted in receive_overflow.
    /// More rides through a slower reader; a list of 16 objects is 36 frames.
    std::size_t receive_queue = 512;

    constexpr bool valid() const { return receive_queue >= 1; }
};
static_assert(LoopbackConfig{}.valid());

/// Not thread safe: all ports belong to one thread.
class LoopbackBus {
  public:
    class Port final : public CanPort {
      public:
        /// Frames longer than 8 bytes or with more than 11 bits of identifier are dropped, as no controller
        /// could send them. On a bus that is down every frame is.
        bool send(const can::Frame& frame) override;
        bool receive(can::Frame& frame) override;
        void begin_cycle() override {}
        CanState state() override;
        CanCounters counters() override { return counters_; }

      private:
        friend class LoopbackBus;
        explicit Port(LoopbackBus& bus) : bus_(bus) {}

        LoopbackBus& bus_;
        std::deque<can::Frame> received_;
        CanCounters counters_;
    };

    explicit LoopbackBus(const LoopbackConfig& config = {}) : config_(config) {}
    LoopbackBus(const LoopbackBus&) = delete;
    LoopbackBus& operator=(const LoopbackBus&) = delete;

    /// A new node on the bus; lives as long as the bus.
    Port& add_port();
    /// The cable pulled and plugged: while down nothing is sent.
    void set_up(bool up) { up_ = up; }

  private:
    LoopbackConfig config_;
    std::vector<std::unique_ptr<Port>> ports_;
    bool up_ = true;
};

}  // namespace hal
