// SocketCan over a kernel of its own that misbehaves on demand. Error numbers and structures are those of
// Linux's can(7), raw(7) and socket(7); texts and counts by construction.
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "hal/host/socket_can.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <CppUTest/TestHarness.h>

namespace {

enum class Behaviour {
    normal,
    no_can_in_kernel,
    no_sockets_left,
    not_a_can_interface,
    queue_full,         ///< the device's: ENOBUFS
    socket_queue_full,  ///< the socket's: EAGAIN
    interrupted,
    short_write,
    write_refused,  ///< an error nothing is known about
};

struct Received {
    canfd_frame frame;
    int size;
};

class FakeKernel final : public hal::SocketCalls {
  public:
    Behaviour behaviour = Behaviour::normal;
    int times = 1'000'000;  ///< how often the calls misbehave before they are normal again
    bool exists = true;
    bool up = true;
    std::deque<Received> waiting;
    int pending_error = 0;  ///< the next receive tells it, as a socket does after its interface went
    std::uint32_t overflow = 0;
    std::vector<can_frame> sent;
    std::vector<can_filter> filters;  ///< of the socket opened last
    int open_sockets = 0;
    int polls = 0;
    int last_polled = -1;

    void deliver(canid_t id, std::uint8_t length, std::array<std::uint8_t, 8> data = {}, int size = CAN_MTU) {
        Received received{};
        received.frame.can_id = id;
        received.frame.len = length;
        std::memcpy(received.frame.data, data.data(), data.size());
        received.size = size;
        waiting.push_back(received);
    }

    int socket(int domain, int type, int) override {
        if (behaviour == Behaviour::no_can_in_kernel) return -EAFNOSUPPORT;
        if (behaviour == Behaviour::no_sockets_left) return -EMFILE;
        LONGS_EQUAL(PF_CAN, domain);
        CHECK((type & SOCK_NONBLOCK) != 0);
        ++open_sockets;
        return 7;
    }
    int setsockopt(int, int, int name, const void* value, unsigned size) override {
        if (name != CAN_RAW_FILTER) return -ENOPROTOOPT;
        const auto* filter = static_cast<const can_filter*>(value);
        filters.assign(filter, filter + size / sizeof(can_filter));
        return 0;
    }
    int ioctl(int, unsigned long request, ifreq& argument) override {
        STRCMP_EQUAL("vcan0", argument.ifr_name);
        if (!exists) return -ENODEV;
        if (request == SIOCGIFINDEX) {
            argument.ifr_ifindex = 3;
        } else {
            argument.ifr_flags = up ? IFF_UP : 0;
        }
        return 0;
    }
    int bind(int, const sockaddr* address, unsigned size) override {
        LONGS_EQUAL(sizeof(sockaddr_can), size);
        sockaddr_can can_address;
        std::memcpy(&can_address, address, sizeof can_address);
        LONGS_EQUAL(3, can_address.can_ifindex);
        return behaviour == Behaviour::not_a_can_interface ? -ENODEV : 0;
    }
    int write(int, const void* data, std::size_t size) override {
        if (!exists) return -ENXIO;
        if (!up) return -ENETDOWN;
        if (times > 0) {
            --times;
            switch (behaviour) {
                case Behaviour::queue_full:
                    return -ENOBUFS;
                case Behaviour::socket_queue_full:
                    return -EAGAIN;
                case Behaviour::interrupted:
                    return -EINTR;
                case Behaviour::short_write:
                    return static_cast<int>(size) - 1;
                case Behaviour::write_refused:
                    return -EINVAL;
                default:
                    break;
            }
        }
        can_frame frame;
        LONGS_EQUAL(sizeof frame, size);
        std::memcpy(&frame, data, sizeof frame);
        sent.push_back(frame);
        return static_cast<int>(size);
    }
    int recvmsg(int, msghdr& message) override {
        if (behaviour == Behaviour::interrupted && times > 0) {
            --times;
            return -EINTR;
        }
        if (pending_error != 0) {
            const int error = pending_error;
            pending_error = 0;
            return error;
        }
        if (waiting.empty()) return -EAGAIN;
        const Received received = waiting.front();
        waiting.pop_front();
        std::memcpy(message.msg_iov->iov_base, &received.frame, static_cast<std::size_t>(received.size));
        if (overflow == 0) {
            message.msg_controllen = 0;
        } else {
            cmsghdr* control = CMSG_FIRSTHDR(&message);
            control->cmsg_level = SOL_SOCKET;
            control->cmsg_type = SO_RXQ_OVFL;
            control->cmsg_len = CMSG_LEN(sizeof overflow);
            std::memcpy(CMSG_DATA(control), &overflow, sizeof overflow);
            message.msg_controllen = CMSG_SPACE(sizeof overflow);
        }
        return received.size;
    }
    int poll(pollfd& fd, int) override {
        ++polls;
        last_polled = fd.fd;
        return 0;
    }
    void close(int) override { --open_sockets; }
};

}  // namespace

TEST_GROUP(SocketCan) {
    FakeKernel kernel;
    can::Frame frame{.id = 0x410, .length = 3, .data = {1, 2, 3}};

    hal::Opened<hal::SocketCan> open(const char* name = "vcan0") {
        return hal::SocketCan::open(name, kernel);
    }

    void check_refused(const char* text, const char* name = "vcan0") {
        const auto port = open(name);
        CHECK(port.value == nullptr);
        STRCMP_EQUAL(text, port.error.c_str());
        LONGS_EQUAL(0, kernel.open_sockets);
    }
};

TEST(SocketCan, MissingInterfaceComesWithTheRemedy) {
    kernel.exists = false;
    check_refused("no such CAN interface vcan0: ip link add dev vcan0 type vcan && ip link set vcan0 up");
}

TEST(SocketCan, MissingHardwareHasAnotherRemedy) {
    check_refused(
        "no such CAN interface can_of_a_long_name: connect the adapter, see `ip link`, then ip link set "
        "can_of_a_long_name up type can bitrate 500000",
        "can_of_a_long_name");
}

TEST(SocketCan, EmptyNameIsNotAllInterfaces) {
    const auto port = open("");
    CHECK(port.value == nullptr);
    STRCMP_CONTAINS("no such CAN interface", port.error.c_str());
}

TEST(SocketCan, KernelWithoutCanIsTold) {
    kernel.behaviour = Behaviour::no_can_in_kernel;
    check_refused(
        "the kernel has no SocketCAN: modprobe can_raw && modprobe vcan, or leave the interface away to use "
        "the "
        "loopback bus");
}

TEST(SocketCan, InterfaceThatIsDownIsTold) {
    kernel.up = false;
    check_refused("CAN interface vcan0 is down: ip link set vcan0 up");
}

TEST(SocketCan, OtherInterfacesAreRefused) {
    kernel.behaviour = Behaviour::not_a_can_interface;
    check_refused("vcan0 is not a CAN interface: see `ip -details link show type can`");
}

TEST(SocketCan, OtherErrorsGiveTheSystemsReason) {
    kernel.behaviour = Behaviour::no_sockets_left;
    check_refused("CAN interface vcan0: socket: Too many open files");
}

TEST(SocketCan, SendsStandardDataFrames) {
    const auto port = open();
    CHECK(port.value->send(frame));
    LONGS_EQUAL(1, kernel.sent.size());
    LONGS_EQUAL(0x410, kernel.sent[0].can_id);
    LONGS_EQUAL(3, kernel.sent[0].len);
    MEMCMP_EQUAL(frame.data.data(), kernel.sent[0].data, 8);
    LONGS_EQUAL(1, port.value->counters().sent);
    CHECK(!port.value->send({.id = 0x800}));
    CHECK(!port.value->send({.id = 1, .length = 9}));
    LONGS_EQUAL(2, port.value->counters().dropped);
    LONGS_EQUAL(1, kernel.sent.size());
}

TEST(SocketCan, FullQueueIsWaitedFor) {
    const auto port = open();
    for (const Behaviour behaviour : {Behaviour::queue_full, Behaviour::socket_queue_full}) {
        kernel.behaviour = behaviour;
        kernel.times = 5;
        kernel.polls = 0;
        port.value->begin_cycle();
        CHECK(port.value->send(frame));
        LONGS_EQUAL(5, kernel.polls);
        // Only the socket's own queue can be watched; the device's is a plain sleep.
        LONGS_EQUAL(behaviour == Behaviour::queue_full ? -1 : 7, kernel.last_polled);
    }
    LONGS_EQUAL(0, port.value->counters().dropped);
}

TEST(SocketCan, WaitingIsBoundedPerCycleAndDropsAreCounted) {
    const auto port = open();
    kernel.behaviour = Behaviour::queue_full;
    port.value->begin_cycle();
    for (int i = 0; i < 36; ++i) CHECK(!port.value->send(frame));
    LONGS_EQUAL(hal::SocketCanConfig{}.waits_per_cycle, kernel.polls);
    LONGS_EQUAL(36, port.value->counters().dropped);
    CHECK(hal::CanState::active == port.value->state());
    port.value->begin_cycle();
    kernel.behaviour = Behaviour::normal;
    CHECK(port.value->send(frame));
    LONGS_EQUAL(1, port.value->counters().sent);
}

TEST(SocketCan, InterruptionsAreRetriedAndBounded) {
    const auto port = open();
    kernel.behaviour = Behaviour::interrupted;
    kernel.times = 3;
    CHECK(port.value->send(frame));
    kernel.times = 3;
    kernel.deliver(0x431, 0);
    CHECK(port.value->receive(frame));
    kernel.times = 1'000'000;
    CHECK(!port.value->send(frame));
    CHECK(!port.value->receive(frame));
    LONGS_EQUAL(1, port.value->counters().dropped);
}

TEST(SocketCan, OtherWriteErrorsDropTheFrame) {
    const auto port = open();
    for (const Behaviour behaviour : {Behaviour::short_write, Behaviour::write_refused}) {
        kernel.behaviour = behaviour;
        CHECK(!port.value->send(frame));
    }
    LONGS_EQUAL(2, port.value->counters().dropped);
    LONGS_EQUAL(0, kernel.polls);
    CHECK(hal::CanState::active == port.value->state());
}

TEST(SocketCan, InterfaceDownAndBack) {
    const auto port = open();
    kernel.up = false;
    CHECK(!port.value->send(frame));
    CHECK(hal::CanState::down == port.value->state());
    STRCMP_EQUAL("CAN interface vcan0 is down: ip link set vcan0 up", port.value->problem().c_str());
    for (int cycle = 0; cycle < 10; ++cycle) {
        port.value->begin_cycle();
        CHECK(!port.value->send(frame));
        CHECK(!port.value->receive(frame));
        CHECK(hal::CanState::down == port.value->state());
        LONGS_EQUAL(0, kernel.open_sockets);
    }
    LONGS_EQUAL(11, port.value->counters().dropped);
    kernel.up = true;
    port.value->begin_cycle();
    CHECK(hal::CanState::active == port.value->state());
    STRCMP_EQUAL("", port.value->problem().c_str());
    CHECK(port.value->send(frame));
    LONGS_EQUAL(1, kernel.open_sockets);
}

TEST(SocketCan, ReceivingNoticesTheInterfaceToo) {
    for (const int error : {-ENETDOWN, -ENODEV, -ENXIO}) {
        const auto port = open();
        kernel.pending_error = error;
        CHECK(!port.value->receive(frame));
        CHECK(hal::CanState::down == port.value->state());
        LONGS_EQUAL(0, kernel.open_sockets);
        port.value->begin_cycle();
        CHECK(hal::CanState::active == port.value->state());
    }
}

TEST(SocketCan, InterfaceRemovedAndMadeAgain) {
    const auto port = open();
    kernel.exists = false;
    CHECK(!port.value->send(frame));
    port.value->begin_cycle();
    CHECK(hal::CanState::down == port.value->state());
    STRCMP_CONTAINS("no such CAN interface vcan0", port.value->problem().c_str());
    kernel.exists = true;
    port.value->begin_cycle();
    CHECK(hal::CanState::active == port.value->state());
}

TEST(SocketCan, ReceivesDataFramesAndRejectsTheRest) {
    const auto port = open();
    kernel.deliver(0x431, 6, {9, 8, 7, 6, 5, 4});
    kernel.deliver(0x431 | CAN_RTR_FLAG, 0);
    kernel.deliver(0x431 | CAN_EFF_FLAG, 6);
    kernel.deliver(CAN_ERR_FLAG | CAN_ERR_PROT, 8);
    kernel.deliver(0x431, 32, {}, CANFD_MTU);
    kernel.deliver(0x431, 9);  // a length no classic frame has
    kernel.deliver(0x7FF, 0);
    CHECK(port.value->receive(frame));
    CHECK((can::Frame{.id = 0x431, .length = 6, .data = {9, 8, 7, 6, 5, 4}} == frame));
    CHECK(port.value->receive(frame));
    CHECK((can::Frame{.id = 0x7FF} == frame));
    CHECK(!port.value->receive(frame));
    LONGS_EQUAL(2, port.value->counters().received);
    LONGS_EQUAL(5, port.value->counters().rejected);
}

TEST(SocketCan, FloodOfForeignFramesIsBounded) {
    const auto port = hal::SocketCan::open("vcan0", kernel, {.rejects_per_call = 8});
    for (int i = 0; i < 20; ++i) kernel.deliver(1u | CAN_RTR_FLAG, 0);
    CHECK(!port.value->receive(frame));
    LONGS_EQUAL(8, port.value->counters().rejected);
    LONGS_EQUAL(12, kernel.waiting.size());
}

TEST(SocketCan, TakesOnlyAcceptedIdentifiersAndAlsoAfterAReconnect) {
    static constexpr std::array<std::uint16_t, 2> kAccept{0x431, 0x432};
    const auto port = hal::SocketCan::open("vcan0", kernel, {.accept = kAccept});
    LONGS_EQUAL(2, kernel.filters.size());
    kernel.filters.clear();
    kernel.pending_error = -ENETDOWN;
    port.value->receive(frame);
    port.value->begin_cycle();
    LONGS_EQUAL(2, kernel.filters.size());
    LONGS_EQUAL(0x432, kernel.filters[1].can_id);
    LONGS_EQUAL(CAN_SFF_MASK | CAN_EFF_FLAG, kernel.filters[1].can_mask);
}

TEST(SocketCan, LostFramesAreCountedAcrossReconnects) {
    const auto port = open();
    kernel.overflow = 5;
    kernel.deliver(0x431, 0);
    CHECK(port.value->receive(frame));
    LONGS_EQUAL(5, port.value->counters().receive_overflow);
    kernel.pending_error = -ENETDOWN;
    port.value->receive(frame);
    port.value->begin_cycle();
    kernel.overflow = 2;
    kernel.deliver(0x431, 0);
    CHECK(port.value->receive(frame));
    LONGS_EQUAL(7, port.value->counters().receive_overflow);
}

TEST(SocketCan, ControllerStatesFollowItsErrorMessages) {
    const auto port = open();
    const auto tell = [&](canid_t error, std::uint8_t controller) {
        kernel.deliver(CAN_ERR_FLAG | error, 8, {0, controller});
        CHECK(!port.value->receive(frame));
        return port.value->state();
    };
    CHECK(hal::CanState::passive == tell(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
    CHECK(hal::CanState::active == tell(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
    CHECK(hal::CanState::passive == tell(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE));
    CHECK(hal::CanState::bus_off == tell(CAN_ERR_BUSOFF, 0));
    CHECK(hal::CanState::bus_off == tell(CAN_ERR_BUSOFF, 0));
    LONGS_EQUAL(1, port.value->counters().bus_off);
    // No waiting for a queue that can not move.
    kernel.behaviour = Behaviour::queue_full;
    port.value->begin_cycle();
    CHECK(!port.value->send(frame));
    LONGS_EQUAL(0, kernel.polls);
    CHECK(hal::CanState::active == tell(CAN_ERR_RESTARTED, 0));
}

TEST(SocketCan, SocketIsClosedAtTheEnd) {
    {
        const auto port = open();
        LONGS_EQUAL(1, kernel.open_sockets);
    }
    LONGS_EQUAL(0, kernel.open_sockets);
}

TEST(SocketCan, RealKernelNeverCrashes) {
    // Whatever this machine's kernel can do: an interface of this name does not exist on it.
    const auto port = hal::SocketCan::open("vcan_missing");
    CHECK(port.value == nullptr);
    CHECK(port.error.starts_with("no such CAN interface vcan_missing: ip link add") ||
          port.error.starts_with("the kernel has no SocketCAN"));
}
