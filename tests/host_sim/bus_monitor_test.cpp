// A sound bus broken in one way at a time; expected counts by construction.
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "can/e2e.hpp"
#include "host_sim/bus_monitor.hpp"
#include "tests/host_sim/test_bus.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(BusMonitor) {
    TestBus bus;
    sim::BusMonitor monitor;

    void feed(const std::vector<TestBus::Timed>& frames) {
        for (const TestBus::Timed& timed : frames) monitor.frame(timed.time_us, timed.frame);
    }
    void cycles(int count, std::uint8_t objects = 2) {
        for (int i = 0; i < count; ++i) feed(bus.next_cycle(objects));
    }
    bool told(const std::string& text) {
        for (const std::string& event : monitor.take_events())
            if (event.find(text) != std::string::npos) return true;
        return false;
    }
    /// The only error of the run, and the bus recovers from it.
    void check_only_error(std::uint64_t count) {
        LONGS_EQUAL(count, monitor.errors());
        const std::uint32_t lists = monitor.lists();
        cycles(20);
        LONGS_EQUAL(count, monitor.errors());
        LONGS_EQUAL(lists + 20, monitor.lists());
    }
};

TEST(BusMonitor, SoundBusHasNoErrors) {
    cycles(300);
    LONGS_EQUAL(0, monitor.errors());
    LONGS_EQUAL(300, monitor.lists());
    CHECK(monitor.take_events().empty());
    LONGS_EQUAL(2, monitor.list().objects().size());
    LONGS_EQUAL(45200, monitor.list().objects()[0].range_mm);
    LONGS_EQUAL(99, monitor.list().objects()[1].existence_percent);
    LONGS_EQUAL(2310, *monitor.warning()->time_to_collision_ms);
    CHECK(can::Mode::operating == monitor.status()->mode);
    LONGS_EQUAL(2, monitor.version()->minor);
    LONGS_EQUAL(300, monitor.warning_levels().at(can::WarningLevel::warn));
    LONGS_EQUAL(2, monitor.most_objects());
    // 7 frames a cycle and the version once a second, each 95 to 135 bits.
    CHECK(monitor.bus_load() > 71 * 95 / 500e3 && monitor.bus_load() < 71 * 135 * 1.01 / 500e3);
}

TEST(BusMonitor, ListLengthsMayChange) {
    for (const int objects : {0, 16, 3, 0, 1, 16}) feed(bus.next_cycle(static_cast<std::uint8_t>(objects)));
    LONGS_EQUAL(0, monitor.errors());
    LONGS_EQUAL(6, monitor.lists());
}

TEST(BusMonitor, ListeningMayBeginInTheMiddle) {
    auto frames = bus.next_cycle(4);
    frames.erase(frames.begin(), frames.begin() + 5);
    feed(frames);
    cycles(5);
    LONGS_EQUAL(0, monitor.errors());
    LONGS_EQUAL(5, monitor.lists());
}

TEST(BusMonitor, BadCrcTearsTheList) {
    cycles(3);
    auto frames = bus.next_cycle(2);
    frames[3].frame.data[5] ^= 0x10;
    feed(frames);
    LONGS_EQUAL(1, monitor.receive_counters().bad_crc);
    CHECK(told("ObjectKinematics00: bad CRC"));
    LONGS_EQUAL(3, monitor.lists());
    cycles(1);
    CHECK(told("object list before this header is torn"));
    LONGS_EQUAL(1, monitor.list().counters().torn);
    check_only_error(3);  // CRC, torn, and the counter that is then missing
}

TEST(BusMonitor, RepeatedCounter) {
    cycles(3);
    const auto frames = bus.next_cycle(2);
    feed(frames);
    monitor.frame(bus.time_us, frames[0].frame);
    LONGS_EQUAL(1, monitor.receive_counters().repeated);
    CHECK(told("RadarStatus: repeated counter"));
    check_only_error(1);
}

TEST(BusMonitor, SkippedCounters) {
    cycles(3);
    bus.transmitter.frame(can::Status{});
    bus.transmitter.frame(can::Status{});
    cycles(1);
    LONGS_EQUAL(2, monitor.receive_counters().lost);
    CHECK(told("RadarStatus: frames before this one were lost"));
    check_only_error(2);
}

TEST(BusMonitor, CounterOutOfSequence) {
    cycles(3);
    for (int i = 0; i < 6; ++i) bus.transmitter.frame(can::Status{});
    cycles(1);
    LONGS_EQUAL(1, monitor.receive_counters().wrong_sequence);
    CHECK(told("RadarStatus: counter out of sequence"));
    check_only_error(1 + 6);
}

TEST(BusMonitor, WrongLength) {
    cycles(3);
    monitor.frame(bus.time_us, {.id = 0x400, .length = 3});
    LONGS_EQUAL(1, monitor.receive_counters().wrong_length);
    CHECK(told("RadarStatus: wrong length"));
    check_only_error(1);
}

TEST(BusMonitor, ValueOutOfRange) {
    cycles(3);
    auto frames = bus.next_cycle(0);
    can::Frame& status = frames[0].frame;
    status.data[2] |= 0xF0;
    auto counter = static_cast<std::uint8_t>(status.data[1] & 0x0F);
    can::e2e_protect(status, status.id, counter);
    feed(frames);
    LONGS_EQUAL(1, monitor.receive_counters().out_of_range);
    CHECK(told("RadarStatus: value out of range"));
    CHECK(can::Mode::operating == monitor.status()->mode);
    check_only_error(1);
}

TEST(BusMonitor, MissingObjectIsATornList) {
    cycles(3);
    auto frames = bus.next_cycle(2);
    frames.erase(frames.begin() + 4);
    feed(frames);
    LONGS_EQUAL(3, monitor.lists());
    cycles(1);
    LONGS_EQUAL(1, monitor.list().counters().torn);
    LONGS_EQUAL(1, monitor.receive_counters().lost);
    check_only_error(2);
}

TEST(BusMonitor, MissingHeaderLeavesStrayObjects) {
    cycles(3);
    auto frames = bus.next_cycle(2);
    frames.erase(frames.begin() + 2);
    feed(frames);
    LONGS_EQUAL(4, monitor.list().counters().stray);
    CHECK(told("ObjectKinematics00: belongs to no list"));
    cycles(1);
    check_only_error(4 + 1);
}

TEST(BusMonitor, RadarThatFallsSilent) {
    cycles(3);
    monitor.advance(bus.time_us + 250'000);
    LONGS_EQUAL(0, monitor.counters().overdue);
    monitor.advance(bus.time_us + 250'001);
    monitor.advance(bus.time_us + 900'000);
    LONGS_EQUAL(3, monitor.counters().overdue);  // status, warning, header; the version has a second
    CHECK(can::E2eStatus::no_new_data == monitor.status_of(0x400));
    CHECK(told("RadarStatus: no new data since 0.200 s"));
    monitor.advance(bus.time_us + 3'000'000);
    LONGS_EQUAL(4, monitor.counters().overdue);
    cycles(1);
    CHECK(can::E2eStatus::ok == monitor.status_of(0x400));
}

TEST(BusMonitor, ForeignTrafficIsNoError) {
    cycles(3);
    monitor.frame(bus.time_us, {.id = 0x123, .length = 8});
    monitor.frame(bus.time_us, {.id = 0x404, .length = 1});
    monitor.line({.kind = hal::CandumpKind::remote, .time_us = bus.time_us}, 1);
    monitor.line({.kind = hal::CandumpKind::extended, .time_us = bus.time_us}, 2);
    monitor.line({.kind = hal::CandumpKind::fd, .time_us = bus.time_us}, 3);
    LONGS_EQUAL(2, monitor.counters().foreign);
    LONGS_EQUAL(1, monitor.counters().remote);
    LONGS_EQUAL(1, monitor.counters().extended);
    LONGS_EQUAL(1, monitor.counters().fd);
    check_only_error(0);
}

TEST(BusMonitor, ErrorFramesAndGarbageLines) {
    cycles(3);
    monitor.line({.kind = hal::CandumpKind::error, .time_us = bus.time_us}, 17);
    CHECK(told("error frame, line 17"));
    monitor.line({}, 18);
    CHECK(told("line 18 is no line of a CAN log"));
    LONGS_EQUAL(1, monitor.counters().error_frames);
    LONGS_EQUAL(1, monitor.counters().garbage_lines);
    check_only_error(2);
}

TEST(BusMonitor, TimeThatGoesBackIsTold) {
    cycles(30);
    bus.time_us = 500'000;
    cycles(1);
    CHECK(told("time goes back"));
    CHECK(monitor.duration_us() == 2'900'000);
    check_only_error(1);
}

TEST(BusMonitor, WhatTheInterfaceLosesIsCounted) {
    cycles(1);
    monitor.port_counters({.receive_overflow = 5, .rejected = 7});
    monitor.port_counters({.receive_overflow = 5, .rejected = 8});
    LONGS_EQUAL(8, monitor.counters().rejected);
    LONGS_EQUAL(5, monitor.counters().lost_here);
    LONGS_EQUAL(5, monitor.errors());
}

TEST(BusMonitor, CommandsAndAnswersAreTold) {
    cycles(1);
    can::Transmitter tester;
    monitor.frame(bus.time_us, tester.frame(can::Command{can::CommandCode::set_min_snr, 12, -5}));
    CHECK(told("command 12 SetMinSnr -5"));
    monitor.frame(bus.time_us,
                  bus.transmitter.frame(can::CommandEcho{can::CommandCode::set_min_snr,
                                                         can::CommandResult::value_out_of_range, 12, 1000}));
    CHECK(told("answer to command 12 SetMinSnr: ValueOutOfRange, in force 1000"));
    LONGS_EQUAL(0, monitor.errors());
}

TEST(BusMonitor, FaultsAreRemembered) {
    feed(bus.next_cycle(0, 0x0102));
    cycles(3);
    LONGS_EQUAL(0x0102, monitor.faults_seen());
    STRCMP_EQUAL("AdcStuck+EgoStale", sim::fault_names(0x0102).c_str());
    STRCMP_EQUAL("none", sim::fault_names(0).c_str());
    CHECK(monitor.warning()->valid);
}

TEST(BusMonitor, NamesOfMessages) {
    STRCMP_EQUAL("RadarStatus", sim::message_name(0x400).c_str());
    STRCMP_EQUAL("ObjectQuality15", sim::message_name(0x430).c_str());
    STRCMP_EQUAL("0x07F", sim::message_name(0x07F).c_str());
}

TEST(BusMonitor, NoiseNeitherPassesNorBreaksIt) {
    std::mt19937 random(4);
    std::uint64_t bad = 0;
    for (int i = 0; i < 20000; ++i) {
        can::Frame frame{.id = static_cast<std::uint16_t>(0x3F0 + random() % 0x60),
                         .length = static_cast<std::uint8_t>(random() % 9)};
        for (unsigned b = 0; b < frame.length; ++b) frame.data[b] = static_cast<std::uint8_t>(random());
        monitor.frame(static_cast<std::uint64_t>(i) * 1000, frame);
        bad += monitor.take_events().size();
    }
    const can::ReceiveCounters& counters = monitor.receive_counters();
    LONGS_EQUAL(20000, counters.good + counters.rejected());
    // One in 256 passes the CRC by chance; fewer have a counter and values to match.
    CHECK(counters.good * 200 < 20000);
    CHECK(bad > 0);
}
