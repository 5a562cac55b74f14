// Transmitter and receiver against each other with one kind of damage at a time; expected counts by
// construction.
#include <cstdint>
#include <random>

#include "can/receiver.hpp"
#include "can/transmitter.hpp"

#include <CppUTest/TestHarness.h>

using can::Reception;

TEST_GROUP(Receiver) {
    can::Transmitter transmitter;
    can::Receiver receiver;
    can::EgoMotion ego;

    can::Frame next(std::int32_t speed_mmps = 0) {
        return transmitter.frame(can::EgoMotion{.speed_mmps = speed_mmps, .valid = true});
    }
};

TEST(Receiver, GoodFramesAreReadInOrder) {
    for (int i = 0; i < 100; ++i) {
        CHECK(Reception::ok == receiver.receive(next(10 * i), ego));
        LONGS_EQUAL(10 * i, ego.speed_mmps);
    }
    CHECK((can::ReceiveCounters{.good = 100} == receiver.counters()));
    CHECK(can::E2eStatus::ok == receiver.status(0x431));
}

TEST(Receiver, JoinsWithAnyCounter) {
    for (int i = 0; i < 7; ++i) next();
    CHECK(Reception::ok == receiver.receive(next(), ego));
}

TEST(Receiver, LostFramesAreCounted) {
    receiver.receive(next(), ego);
    next();
    next();
    CHECK(Reception::ok_some_lost == receiver.receive(next(500), ego));
    LONGS_EQUAL(500, ego.speed_mmps);
    CHECK((can::ReceiveCounters{.good = 2, .lost = 2} == receiver.counters()));
}

TEST(Receiver, TooManyLostIsAWrongSequenceOnce) {
    receiver.receive(next(5), ego);
    for (int i = 0; i < 5; ++i) next();
    CHECK(Reception::wrong_sequence == receiver.receive(next(500), ego));
    LONGS_EQUAL(5, ego.speed_mmps);
    CHECK(Reception::ok == receiver.receive(next(600), ego));
    CHECK((can::ReceiveCounters{.good = 2, .lost = 5, .wrong_sequence = 1} == receiver.counters()));
}

TEST(Receiver, RepeatedFramesChangeNothing) {
    receiver.receive(next(5), ego);
    const can::Frame frame = next(10);
    CHECK(Reception::ok == receiver.receive(frame, ego));
    ego.speed_mmps = -1;
    CHECK(Reception::repeated == receiver.receive(frame, ego));
    LONGS_EQUAL(-1, ego.speed_mmps);
    LONGS_EQUAL(1, receiver.counters().repeated);
}

TEST(Receiver, DamagedFramesChangeNothing) {
    std::mt19937 random(3);
    receiver.receive(next(5), ego);
    for (std::uint32_t i = 1; i <= 1000; ++i) {
        can::Frame frame = next(1000);
        const auto bit = static_cast<unsigned>(random() % 48);
        frame.data[bit / 8] = static_cast<std::uint8_t>(frame.data[bit / 8] ^ (1u << (bit % 8)));
        CHECK(Reception::bad_crc == receiver.receive(frame, ego));
        LONGS_EQUAL(5, ego.speed_mmps);
        LONGS_EQUAL(i, receiver.counters().bad_crc);
    }
    CHECK(can::E2eStatus::error == receiver.status(0x431));
}

TEST(Receiver, WrongLengthIsToldBeforeTheCrc) {
    for (std::uint8_t length = 0; length <= 8; ++length) {
        if (length == can::ego::kMessage.length) continue;
        can::Frame frame = next();
        frame.length = length;
        CHECK(Reception::wrong_length == receiver.receive(frame, ego));
    }
    can::Frame frame = next();
    frame.length = 255;
    CHECK(Reception::wrong_length == receiver.receive(frame, ego));
    LONGS_EQUAL(9, receiver.counters().wrong_length);
}

TEST(Receiver, IntactButOutOfRangeIsRefused) {
    can::Frame frame = transmitter.frame(can::Status{});
    frame.data[2] |= 0xF0;  // mode 15
    std::uint8_t counter = 0;
    can::e2e_protect(frame, frame.id, counter);
    can::Status status{.detections = 42};
    CHECK(Reception::out_of_range == receiver.receive(frame, status));
    LONGS_EQUAL(42, status.detections);
    CHECK((can::ReceiveCounters{.out_of_range = 1} == receiver.counters()));
}

TEST(Receiver, UnknownIdentifiersAreCounted) {
    for (const int id : {0x000, 0x123, 0x3FF, 0x404, 0x40F, 0x433, 0x43F, 0x440, 0x7FF, 0xFFFF}) {
        CHECK(Reception::unknown_id ==
              receiver.receive({.id = static_cast<std::uint16_t>(id), .length = 8}, ego));
        CHECK(can::E2eStatus::no_new_data == receiver.status(static_cast<std::uint16_t>(id)));
        receiver.no_new_data(static_cast<std::uint16_t>(id));
    }
    CHECK(Reception::unknown_id == receiver.ignore());
    LONGS_EQUAL(11, receiver.counters().unknown_id);
    LONGS_EQUAL(11, receiver.counters().rejected());
}

TEST(Receiver, FrameUnderAnotherIdentifierFailsItsCrc) {
    can::Object object;
    can::Frame frame = transmitter.kinematics(object);
    frame.id = 0x412;
    CHECK(Reception::bad_crc == receiver.receive(frame, object));
}

TEST(Receiver, CountersOfMessagesAreIndependent) {
    can::Object object;
    for (int cycle = 0; cycle < 20; ++cycle) {
        for (std::uint8_t index = 0; index <= cycle % 16; ++index) {
            object.index = index;
            can::Object read;
            CHECK(is_good(receiver.receive(transmitter.kinematics(object), read)));
            CHECK(is_good(receiver.receive(transmitter.quality(object), read)));
            LONGS_EQUAL(index, read.index);
        }
    }
    LONGS_EQUAL(0, receiver.counters().lost);
}

TEST(Receiver, SilenceIsAState) {
    receiver.receive(next(), ego);
    receiver.no_new_data(0x431);
    CHECK(can::E2eStatus::no_new_data == receiver.status(0x431));
    CHECK(Reception::ok == receiver.receive(next(), ego));
}

TEST(Receiver, TransmitterCountsWhatItLimits) {
    LONGS_EQUAL(0, transmitter.limited());
    can::Object object;
    object.range_mm = -1000;
    transmitter.kinematics(object);
    transmitter.quality(object);
    LONGS_EQUAL(1, transmitter.limited());
}
