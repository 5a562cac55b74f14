/// Repairs what the ZCU102 emulator (xlnx-zynqmp-can of QEMU, 7.2 and later) does to CAN frames on their way
/// between the emulated controller and a SocketCAN interface of the host (`-object can-host-socketcan`):
///
/// - The controller's identifier register is passed on as the SocketCAN identifier as it stands: standard
/// identifier in
///   bits 31 to 21, SRR/RTR 20, IDE 19, rest of an extended identifier 18 to 1, its RTR 0. Standard 0x411 so
///   comes out as an extended frame 0x02200000, and identifiers with bit 8 set look like error frames.
/// - The data registers are unpacked from their least significant byte up. In the silicon the first byte on
/// the wire is
///   the most significant one (Zynq UltraScale+ register reference, TXFIFO_DATA1: DB0 is bits 31 to 24), so
///   each half of the data field comes out reversed.
///
///     zcu102_can_bridge EMULATED CLEAN
///
/// The emulator is joined to interface EMULATED, everybody else to CLEAN; frames are passed on repaired, in
/// both directions, until SIGTERM or SIGINT. A controller, or an emulator, without these flaws is recognised
/// by the first frame it sends, since no register form of a frame looks like a plain standard one: the bridge
/// then says that it is not needed and passes frames on unchanged. One kind of frame cannot be repaired:
/// identifiers with bit 8 set and all of bits 7 to 0 clear (0x100, 0x300, 0x500, 0x700) are lost in the
/// host's kernel, which takes them for error frames without a cause.

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace {

constexpr canid_t kRawRemoteStandard = 1U << 20;  // with IDE: SRR, always set
constexpr canid_t kRawExtended = 1U << 19;
constexpr canid_t kRawRemoteExtended = 1U << 0;
constexpr int kIdentifierShift = 21;
constexpr int kExtendedLowBits = 18;

/// Data bytes beyond the length are carried too: a frame of five bytes has its fifth in the last place.
void swap_halves(can_frame& frame) {
    for (int i = 0; i < 8; i += 4) {
        std::swap(frame.data[i], frame.data[i + 3]);
        std::swap(frame.data[i + 1], frame.data[i + 2]);
    }
}

can_frame from_register_form(can_frame frame) {
    const canid_t raw = frame.can_id;
    if ((raw & kRawExtended) != 0) {
        const canid_t low = (raw >> 1) & ((1U << kExtendedLowBits) - 1);
        frame.can_id = CAN_EFF_FLAG | (raw >> kIdentifierShift) << kExtendedLowBits | low;
        if ((raw & kRawRemoteExtended) != 0) frame.can_id |= CAN_RTR_FLAG;
    } else {
        frame.can_id = raw >> kIdentifierShift;
        if ((raw & kRawRemoteStandard) != 0) frame.can_id |= CAN_RTR_FLAG;
    }
    swap_halves(frame);
    return frame;
}

can_frame to_register_form(can_frame frame) {
    const canid_t id = frame.can_id;
    const bool remote = (id & CAN_RTR_FLAG) != 0;
    if ((id & CAN_EFF_FLAG) != 0) {
        const canid_t low = id & ((1U << kExtendedLowBits) - 1);
        frame.can_id = ((id & CAN_EFF_MASK) >> kExtendedLowBits) << kIdentifierShift | low << 1 |
                       kRawExtended | kRawRemoteStandard | (remote ? kRawRemoteExtended : 0);
    } else {
        frame.can_id = (id & CAN_SFF_MASK) << kIdentifierShift | (remote ? kRawRemoteStandard : 0);
    }
    swap_halves(frame);
    return frame;
}

/// Identifier 0 reads the same in both forms.
bool plain_standard(const can_frame& frame) {
    return frame.can_id != 0 && (frame.can_id & ~CAN_SFF_MASK) == 0;
}

int open_interface(const char* name) {
    const unsigned index = if_nametoindex(name);
    if (index == 0) {
        std::fprintf(
            stderr,
            "zcu102_can_bridge: no such interface %s: ip link add dev %s type vcan; ip link set %s up\n",
            name, name, name);
        std::exit(1);
    }
    const int fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    // Register forms look like anything, error frames included.
    const can_err_mask_t everything = CAN_ERR_MASK;
    const int counted = 1;
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(index);
    if (fd < 0 || setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &everything, sizeof(everything)) != 0 ||
        setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &counted, sizeof(counted)) != 0 ||
        bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
        std::fprintf(stderr, "zcu102_can_bridge: %s: %s\n", name, std::strerror(errno));
        std::exit(1);
    }
    return fd;
}

/// `overflowed`: frames the kernel has dropped so far because this end was not read fast enough.
bool read_frame(int fd, can_frame& frame, std::uint32_t& overflowed) {
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(overflowed))];
    iovec data{&frame, sizeof(frame)};
    msghdr message{};
    message.msg_iov = &data;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof(control);
    if (recvmsg(fd, &message, 0) != sizeof(frame)) return false;
    const cmsghdr* header = CMSG_FIRSTHDR(&message);
    if (header != nullptr && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SO_RXQ_OVFL) {
        std::memcpy(&overflowed, CMSG_DATA(header), sizeof(overflowed));
    }
    return true;
}

/// Waits up to 100 ms for room in the interface's queue.
bool write_frame(int fd, const can_frame& frame) {
    for (int attempt = 0; attempt < 100; ++attempt) {
        if (write(fd, &frame, sizeof(frame)) == sizeof(frame)) return true;
        if (errno != ENOBUFS && errno != EAGAIN && errno != EINTR) return false;
        usleep(1000);
    }
    return false;
}

volatile std::sig_atomic_t stop_requested = 0;

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: zcu102_can_bridge EMULATED_INTERFACE CLEAN_INTERFACE\n");
        return 1;
    }
    struct sigaction action {};
    action.sa_handler = [](int) { stop_requested = 1; };
    sigaction(SIGTERM, &action, nullptr);
    sigaction(SIGINT, &action, nullptr);

    pollfd ends[2] = {{open_interface(argv[1]), POLLIN, 0}, {open_interface(argv[2]), POLLIN, 0}};
    std::printf("zcu102_can_bridge: %s (register form) <-> %s\n", argv[1], argv[2]);
    std::fflush(stdout);

    bool repair = true;
    bool seen = false;
    unsigned long passed[2] = {0, 0};
    std::uint32_t overflowed[2] = {0, 0};
    unsigned long unsent = 0;
    while (stop_requested == 0) {
        if (poll(ends, 2, -1) < 0) continue;  // a signal
        for (int from = 0; from < 2; ++from) {
            if (ends[from].revents == 0) continue;
            can_frame frame{};
            if (!read_frame(ends[from].fd, frame, overflowed[from])) {
                if (errno == ENETDOWN) continue;  // and up again later
                std::fprintf(stderr, "zcu102_can_bridge: %s: %s\n", argv[1 + from], std::strerror(errno));
                return 1;
            }
            if (from == 0 && !seen) {
                seen = true;
                repair = !plain_standard(frame);
                std::printf(repair ? "zcu102_can_bridge: %s carries register forms: repairing\n"
                                   : "zcu102_can_bridge: not needed: %s carries plain frames already\n",
                            argv[1]);
                std::fflush(stdout);
            }
            // What the kernel itself reports, such as a restarted controller, is no frame of the emulator.
            if (from == 1 && (frame.can_id & CAN_ERR_FLAG) != 0) continue;
            if (repair) frame = from == 0 ? from_register_form(frame) : to_register_form(frame);
            if (write_frame(ends[1 - from].fd, frame)) {
                ++passed[from];
            } else {
                ++unsent;
            }
        }
    }
    const unsigned long lost = unsent + overflowed[0] + overflowed[1];
    std::printf("zcu102_can_bridge: %lu frames from the emulator, %lu to it, %lu lost\n", passed[0],
                passed[1], lost);
    return lost == 0 ? 0 : 2;
}
