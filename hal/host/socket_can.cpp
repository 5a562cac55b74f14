#include "hal/host/socket_can.hpp"

#include <cerrno>
#include <cstring>
#include <vector>

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

namespace hal {
namespace {

constexpr int kInterruptionsPerCall = 16;
/// Bytes asked for; the kernel gives at most net.core.rmem_max. About 0.3 s of a full bus at the usual 208
/// KiB.
constexpr int kReceiveBuffer = 1 << 20;

int result_or_error(long result) {
    return result < 0 ? -errno : static_cast<int>(result);
}

class KernelSocketCalls final : public SocketCalls {
  public:
    int socket(int domain, int type, int protocol) override {
        return result_or_error(::socket(domain, type, protocol));
    }
    int setsockopt(int fd, int level, int name, const void* value, unsigned size) override {
        return result_or_error(::setsockopt(fd, level, name, value, size));
    }
    int ioctl(int fd, unsigned long request, ifreq& argument) override {
        return result_or_error(::ioctl(fd, request, &argument));
    }
    int bind(int fd, const sockaddr* address, unsigned size) override {
        return result_or_error(::bind(fd, address, size));
    }
    int write(int fd, const void* data, std::size_t size) override {
        return result_or_error(::write(fd, data, size));
    }
    int recvmsg(int fd, msghdr& message) override { return result_or_error(::recvmsg(fd, &message, 0)); }
    int poll(pollfd& fd, int timeout_ms) override { return result_or_error(::poll(&fd, 1, timeout_ms)); }
    void close(int fd) override { ::close(fd); }
};

/// Interface down, or gone.
bool is_down(int error) {
    return error == -ENETDOWN || error == -ENXIO || error == -ENODEV || error == -EBADF;
}

std::string up_command(const std::string& name) {
    return name.starts_with("vcan") ? "ip link set " + name + " up"
                                    : "ip link set " + name + " up type can bitrate 500000";
}

std::string missing_text(const std::string& name) {
    std::string text = "no such CAN interface " + name + ": ";
    if (name.starts_with("vcan"))
        return text + "ip link add dev " + name + " type vcan && " + up_command(name);
    return text + "connect the adapter, see `ip link`, then " + up_command(name);
}

std::string down_text(const std::string& name) {
    return "CAN interface " + name + " is down: " + up_command(name);
}

bool is_interruption(int result) {
    return result == -EINTR;
}

}  // namespace

SocketCalls& kernel_socket_calls() {
    static KernelSocketCalls calls;
    return calls;
}

Opened<SocketCan> SocketCan::open(const std::string& interface_name, SocketCalls& calls,
                                  const SocketCanConfig& config) {
    std::unique_ptr<SocketCan> port(new SocketCan(interface_name, calls, config));
    if (!port->connect()) return {.error = port->problem_};
    return {.value = std::move(port)};
}

SocketCan::~SocketCan() {
    if (fd_ >= 0) calls_.close(fd_);
}

bool SocketCan::connect() {
    if (interface_.empty() || interface_.size() >= IFNAMSIZ) {
        problem_ = missing_text(interface_);
        return false;
    }
    const int fd = calls_.socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (fd == -EAFNOSUPPORT || fd == -EPROTONOSUPPORT) {
        problem_ =
            "the kernel has no SocketCAN: modprobe can_raw && modprobe vcan, or leave the interface away to "
            "use the "
            "loopback bus";
        return false;
    }
    const auto fail = [&](std::string problem) {
        if (fd >= 0) calls_.close(fd);
        problem_ = std::move(problem);
        return false;
    };
    const auto fail_with = [&](const char* step, int error) {
        return fail("CAN interface " + interface_ + ": " + step + ": " + std::strerror(-error));
    };
    if (fd < 0) return fail_with("socket", fd);

    // Error messages tell of bus off; FD frames and lost frames are asked for to be counted. An older kernel
    // may not know one of them, which costs the count only.
    const can_err_mask_t errors = CAN_ERR_MASK;
    const int on = 1;
    int result = 0;
    calls_.setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    calls_.setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    calls_.setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    calls_.setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);

    if (!config_.accept.empty()) {
        std::vector<can_filter> filters;
        for (const std::uint16_t id : config_.accept) filters.push_back({id, CAN_SFF_MASK | CAN_EFF_FLAG});
        result = calls_.setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                                   static_cast<unsigned>(filters.size() * sizeof(can_filter)));
        if (result < 0) return fail_with("filter", result);
    }

    ifreq request{};
    std::memcpy(request.ifr_name, interface_.data(), interface_.size());
    result = calls_.ioctl(fd, SIOCGIFINDEX, request);
    if (result == -ENODEV || result == -ENXIO) return fail(missing_text(interface_));
    if (result < 0) return fail_with("index", result);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    result = calls_.ioctl(fd, SIOCGIFFLAGS, request);
    if (result < 0) return fail_with("flags", result);
    const bool up = (static_cast<unsigned>(request.ifr_flags) & IFF_UP) != 0;
    result = calls_.bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    if (result == -ENODEV)
        return fail(interface_ + " is not a CAN interface: see `ip -details link show type can`");
    if (result < 0) return fail_with("bind", result);
    if (!up) return fail(down_text(interface_));

    fd_ = fd;
    state_ = CanState::active;
    problem_.clear();
    overflow_before_ += overflow_;
    overflow_ = 0;
    return true;
}

void SocketCan::disconnect(int error) {
    if (fd_ >= 0) calls_.close(fd_);
    fd_ = -1;
    state_ = CanState::down;
    problem_ = error == -ENETDOWN ? down_text(interface_) : missing_text(interface_);
}

void SocketCan::begin_cycle() {
    waits_left_ = config_.waits_per_cycle;
    if (fd_ < 0) connect();
}

bool SocketCan::send(const can::Frame& frame) {
    const auto drop = [this] {
        ++counters_.dropped;
        return false;
    };
    if (fd_ < 0 || frame.length > CAN_MAX_DLEN || frame.id > CAN_SFF_MASK) return drop();
    can_frame raw{};
    raw.can_id = frame.id;
    raw.len = frame.length;
    std::memcpy(raw.data, frame.data.data(), frame.length);

    // Ends: every turn either returns, or uses up an interruption or a wait.
    int interruptions = 0;
    for (;;) {
        const int result = calls_.write(fd_, &raw, sizeof raw);
        if (result == static_cast<int>(sizeof raw)) {
            ++counters_.sent;
            return true;
        }
        if (is_down(result)) {
            disconnect(result);
            return drop();
        }
        if (is_interruption(result)) {
            if (++interruptions > kInterruptionsPerCall) return drop();
        } else if (!wait_for_room(result)) {
            return drop();
        }
    }
}

/// After a full queue waits a millisecond, if the cycle still has one. False: another error, no time left, or
/// bus off, when no waiting helps.
bool SocketCan::wait_for_room(int error) {
    const bool full = error == -EAGAIN || error == -ENOBUFS;
    if (!full || waits_left_ == 0 || state_ == CanState::bus_off) return false;
    --waits_left_;
    // EAGAIN is the socket's own queue, which poll() watches; ENOBUFS is the device's, which it does not.
    pollfd poll{.fd = error == -EAGAIN ? fd_ : -1, .events = POLLOUT, .revents = 0};
    calls_.poll(poll, 1);
    return true;
}

bool SocketCan::receive(can::Frame& frame) {
    if (fd_ < 0) return false;
    int interruptions = 0;
    for (int rejects = 0; rejects < config_.rejects_per_call;) {
        canfd_frame raw{};
        iovec data{.iov_base = &raw, .iov_len = sizeof raw};
        alignas(cmsghdr) char control[CMSG_SPACE(sizeof(std::uint32_t))];
        msghdr message{};
        message.msg_iov = &data;
        message.msg_iovlen = 1;
        message.msg_control = control;
        message.msg_controllen = sizeof control;
        const int result = calls_.recvmsg(fd_, message);
        if (is_interruption(result)) {
            if (++interruptions > kInterruptionsPerCall) return false;
            continue;
        }
        if (is_down(result)) disconnect(result);
        if (result <= 0) return false;

        for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
            if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL) continue;
            std::memcpy(&overflow_, CMSG_DATA(c), sizeof overflow_);
            counters_.receive_overflow = overflow_before_ + overflow_;
        }
        constexpr canid_t kFlags = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG;
        if (result == static_cast<int>(CAN_MTU) && (raw.can_id & kFlags) == 0 && raw.len <= CAN_MAX_DLEN) {
            frame = {.id = static_cast<std::uint16_t>(raw.can_id & CAN_SFF_MASK), .length = raw.len};
            std::memcpy(frame.data.data(), raw.data, raw.len);
            ++counters_.received;
            return true;
        }
        ++counters_.rejected;
        ++rejects;
        if ((raw.can_id & CAN_ERR_FLAG) != 0) note_controller_error(raw.can_id, raw.data[1]);
    }
    return false;
}

void SocketCan::note_controller_error(std::uint32_t error_class, std::uint8_t controller_status) {
    if ((error_class & CAN_ERR_BUSOFF) != 0) {
        if (state_ != CanState::bus_off) ++counters_.bus_off;
        state_ = CanState::bus_off;
    } else if ((error_class & CAN_ERR_RESTARTED) != 0) {
        state_ = CanState::active;
    } else if ((error_class & CAN_ERR_CRTL) != 0) {
        if ((controller_status & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
            state_ = CanState::passive;
        } else if ((controller_status & CAN_ERR_CRTL_ACTIVE) != 0) {
            state_ = CanState::active;
        }
    }
}

void SocketCan::wait_for_frame(int timeout_ms) {
    pollfd poll{.fd = fd_, .events = POLLIN, .revents = 0};
    calls_.poll(poll, timeout_ms);
}

}  // namespace hal
