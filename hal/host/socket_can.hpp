/// A CAN interface of Linux: can0, vcan0, slcan0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "hal/contract/can_port.hpp"
#include "hal/host/opened.hpp"

struct ifreq;
struct msghdr;
struct pollfd;
struct sockaddr;

namespace hal {

/// The system calls under SocketCan, so that its handling of every failure is tested without a kernel that
/// has CAN. As in the manual pages, except that a failure is the negative error number.
class SocketCalls {
  public:
    virtual int socket(int domain, int type, int protocol) = 0;
    virtual int setsockopt(int fd, int level, int name, const void* value, unsigned size) = 0;
    virtual int ioctl(int fd, unsigned long request, ifreq& argument) = 0;
    virtual int bind(int fd, const sockaddr* address, unsigned size) = 0;
    virtual int write(int fd, const void* data, std::size_t size) = 0;
    virtual int recvmsg(int fd, msghdr& message) = 0;
    virtual int poll(pollfd& fd, int timeout_ms) = 0;
    virtual void close(int fd) = 0;

  protected:
    ~SocketCalls() = default;
};

/// The real ones.
SocketCalls& kernel_socket_calls();

struct SocketCanConfig {
    /// How long the sends of one cycle may wait together for room in the kernel's queue, in waits of 1 ms. A
    /// list of 16 objects takes 10 ms at 500 kbit/s; more eats into the period when the bus is stuck.
    int waits_per_cycle = 20;
    /// Frames receive() passes over in one call because they are not ours to read. Bounds it on a flooded
    /// bus.
    int rejects_per_call = 1024;
    /// Standard identifiers to receive, sorted out by the kernel as a controller's acceptance filters do;
    /// empty: all. Must outlive the port. A radar that takes everything spends its look at the bus on other
    /// nodes' frames.
    std::span<const std::uint16_t> accept = {};

    constexpr bool valid() const {
        return waits_per_cycle >= 0 && waits_per_cycle < 100 && rejects_per_call >= 1;
    }
};
static_assert(SocketCanConfig{}.valid());

/// When the interface goes down or away, state() is down, every send is dropped and counted, and
/// begin_cycle() tries to open it again, once a call. What the kernel has queued can not be called back:
/// after a stuck bus recovers, at most its transmit queue (`txqueuelen`, 10 frames on most interfaces) of old
/// frames precedes the newest list.
class SocketCan final : public CanPort {
  public:
    /// Fails, saying why and what to do, if the interface does not exist, is down, is no CAN interface, or
    /// the kernel has no CAN.
    static Opened<SocketCan> open(const std::string& interface_name,
                                  SocketCalls& calls = kernel_socket_calls(),
                                  const SocketCanConfig& config = {});
    ~SocketCan();
    SocketCan(const SocketCan&) = delete;
    SocketCan& operator=(const SocketCan&) = delete;

    bool send(const can::Frame& frame) override;
    bool receive(can::Frame& frame) override;
    void begin_cycle() override;
    CanState state() override { return state_; }
    CanCounters counters() override { return counters_; }

    /// Sleeps until a frame waits or the time is over.
    void wait_for_frame(int timeout_ms);
    /// Why the state is down, and the remedy; empty otherwise.
    const std::string& problem() const { return problem_; }

  private:
    SocketCan(std::string interface_name, SocketCalls& calls, const SocketCanConfig& config)
        : interface_(std::move(interface_name)),
          calls_(calls),
          config_(config),
          waits_left_(config.waits_per_cycle) {}

    bool connect();
    void disconnect(int error);
    bool wait_for_room(int error);
    void note_controller_error(std::uint32_t error_class, std::uint8_t controller_status);

    std::string interface_;
    SocketCalls& calls_;
    SocketCanConfig config_;
    int fd_ = -1;
    int waits_left_;
    CanState state_ = CanState::down;
    CanCounters counters_;
    std::uint32_t overflow_before_ = 0;  ///< of sockets closed before this one
    std::uint32_t overflow_ = 0;         ///< of this socket, as the kernel counts
    std::string problem_;
};

}  // namespace hal
