// Expected counts by construction.
#include <cstdint>

#include "hal/host/loopback_bus.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(LoopbackBus){};

TEST(LoopbackBus, EveryoneButTheSenderHears) {
    hal::LoopbackBus bus;
    auto& a = bus.add_port();
    auto& b = bus.add_port();
    auto& c = bus.add_port();
    for (std::uint16_t id = 1; id <= 3; ++id) CHECK(a.send({.id = id, .length = 1}));
    can::Frame frame;
    CHECK(!a.receive(frame));
    for (std::uint16_t id = 1; id <= 3; ++id) {
        CHECK(b.receive(frame));
        LONGS_EQUAL(id, frame.id);
        CHECK(c.receive(frame));
        LONGS_EQUAL(id, frame.id);
    }
    CHECK(!b.receive(frame));
    LONGS_EQUAL(3, a.counters().sent);
    LONGS_EQUAL(3, b.counters().received);
    LONGS_EQUAL(0, b.counters().sent);
}

TEST(LoopbackBus, FullQueuesCountWhatTheyLose) {
    hal::LoopbackBus bus({.receive_queue = 4});
    auto& sender = bus.add_port();
    auto& reader = bus.add_port();
    for (std::uint16_t id = 0; id < 10; ++id) CHECK(sender.send({.id = id}));
    LONGS_EQUAL(10, sender.counters().sent);
    LONGS_EQUAL(6, reader.counters().receive_overflow);
    can::Frame frame;
    for (int i = 0; i < 4; ++i) CHECK(reader.receive(frame));
    CHECK(!reader.receive(frame));
    CHECK(sender.send({.id = 99}));
    CHECK(reader.receive(frame));
    LONGS_EQUAL(99, frame.id);
}

TEST(LoopbackBus, FramesNoControllerCouldSendAreDropped) {
    hal::LoopbackBus bus;
    auto& sender = bus.add_port();
    auto& reader = bus.add_port();
    CHECK(!sender.send({.id = 0x800}));
    CHECK(!sender.send({.id = 1, .length = 9}));
    LONGS_EQUAL(2, sender.counters().dropped);
    can::Frame frame;
    CHECK(!reader.receive(frame));
}

TEST(LoopbackBus, DownMeansDroppedAndCounted) {
    hal::LoopbackBus bus;
    auto& sender = bus.add_port();
    auto& reader = bus.add_port();
    bus.set_up(false);
    CHECK(hal::CanState::down == sender.state());
    CHECK(!sender.send({.id = 1}));
    bus.set_up(true);
    CHECK(hal::CanState::active == sender.state());
    CHECK(sender.send({.id = 2}));
    can::Frame frame;
    CHECK(reader.receive(frame));
    LONGS_EQUAL(2, frame.id);
    LONGS_EQUAL(1, sender.counters().dropped);
}
