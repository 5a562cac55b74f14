// Texts compared with what the test's radar says.
#include <string>

#include <nlohmann/json.hpp>

#include "host_sim/monitor_view.hpp"
#include "tests/host_sim/test_bus.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(MonitorView) {
    TestBus bus;
    sim::BusMonitor monitor;

    void cycle(std::uint8_t objects, std::uint16_t faults = 0) {
        for (const auto& timed : bus.next_cycle(objects, faults)) monitor.frame(timed.time_us, timed.frame);
    }
};

TEST(MonitorView, LineTellsTheCycle) {
    cycle(1);
    cycle(2);
    STRCMP_EQUAL(
        "    0.100 s  cycle   2  Operating, faults none | warning Warn, track 3, collision in 2.31 s, needs "
        "4.20 m/s^2 "
        "| 2 objects | #3 45.20 m -10.05 m/s Oncoming | #4 55.20 m -10.05 m/s Oncoming ~",
        sim::cycle_line(monitor).c_str());
}

TEST(MonitorView, FaultNeverLooksLikeAnEmptyRoad) {
    cycle(0, 0x0020);
    const std::string line = sim::cycle_line(monitor);
    STRCMP_CONTAINS("Failed, faults Blocked", line.c_str());
    STRCMP_CONTAINS("warning no statement possible", line.c_str());
    STRCMP_CONTAINS("0 objects, LIST NOT VALID", line.c_str());
    STRCMP_CONTAINS("LIST NOT VALID", sim::cycle_table(monitor).c_str());
}

TEST(MonitorView, SilenceIsSaid) {
    STRCMP_CONTAINS("no status", sim::cycle_line(monitor).c_str());
    cycle(0);
    monitor.advance(bus.time_us + 1'000'000);
    STRCMP_CONTAINS("Operating (no longer told)", sim::cycle_line(monitor).c_str());
}

TEST(MonitorView, TableHasALineAnObject) {
    cycle(2);
    const std::string table = sim::cycle_table(monitor);
    STRCMP_CONTAINS("   3   45.20 m  -10.05  Oncoming          0.12 m   0.040 m/s    99 %   31.5 dB    45\n",
                    table.c_str());
    STRCMP_CONTAINS("   4   55.20 m  -10.05  Oncoming ~", table.c_str());
    STRCMP_CONTAINS("lists 1 whole, 0 torn   errors 0", table.c_str());
}

TEST(MonitorView, SummaryCountsEveryKind) {
    cycle(2);
    monitor.frame(bus.time_us, {.id = 0x400, .length = 1});
    monitor.frame(bus.time_us, {.id = 0x123});
    monitor.line({}, 9);
    const std::string text = sim::summary_text(monitor);
    STRCMP_CONTAINS("firmware 1.2.3, protocol 1, Operating", text.c_str());
    STRCMP_CONTAINS("errors: 2\n", text.c_str());
    STRCMP_CONTAINS("  wrong length                        1\n", text.c_str());
    STRCMP_CONTAINS("  garbage lines                       1\n", text.c_str());
    STRCMP_CONTAINS("  foreign identifiers                 1\n", text.c_str());
    STRCMP_CONTAINS("  bad CRC                             0\n", text.c_str());

    const auto json = sim::summary_json(monitor);
    LONGS_EQUAL(10, json["frames"].get<int>());
    STRCMP_EQUAL("Operating", json["radar"]["mode"].get<std::string>().c_str());
    STRCMP_EQUAL("1.2.3", json["radar"]["firmware"].get<std::string>().c_str());
    LONGS_EQUAL(1, json["lists"]["whole"].get<int>());
    LONGS_EQUAL(2, json["errors"]["total"].get<int>());
    LONGS_EQUAL(1, json["errors"]["wrong_length"].get<int>());
    LONGS_EQUAL(1, json["other"]["foreign"].get<int>());
    LONGS_EQUAL(1, json["warnings"]["Warn"].get<int>());
}

TEST(MonitorView, ErrorsOfTheSummaryAddUp) {
    cycle(2);
    monitor.frame(bus.time_us, {.id = 0x400, .length = 1});
    monitor.line({.kind = hal::CandumpKind::error, .time_us = bus.time_us}, 3);
    monitor.line({}, 4);
    auto broken = bus.next_cycle(3);
    broken.pop_back();
    broken[0].frame.data[3] ^= 1;
    for (const auto& timed : broken) monitor.frame(timed.time_us, timed.frame);
    cycle(1);
    const auto json = sim::summary_json(monitor);
    std::uint64_t sum = 0;
    for (const auto& [key, value] : json["errors"].items())
        if (key != "total") sum += value.get<std::uint64_t>();
    CHECK(sum > 4);
    LONGS_EQUAL(sum, json["errors"]["total"].get<std::uint64_t>());
}

TEST(MonitorView, BusLoadIsPrintedBesideItsBar) {
    const std::string text = sim::bus_load_text(16);
    STRCMP_CONTAINS("ObjectKinematics        8         135       160", text.c_str());
    STRCMP_CONTAINS("10.13 %   (bar: < 40 %)\n", text.c_str());
}
