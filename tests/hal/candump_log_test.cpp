// Lines as can-utils' `candump -L` and `log2asc` write and read them; expected fields by reading the line.
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "hal/host/candump_log.hpp"
#include "hal/host/loopback_bus.hpp"

#include <unistd.h>

#include <CppUTest/TestHarness.h>

using hal::CandumpKind;

namespace {

struct FixedClock : hal::Clock {
    std::uint64_t now_us() override { return 1'234'567; }
    void wait_until(std::uint64_t) override {}
};

}  // namespace

TEST_GROUP(CandumpLog) {
    std::string path =
        (std::filesystem::temp_directory_path() / ("candump_log_test." + std::to_string(::getpid()) + ".log"))
            .string();

    void teardown() override {
        std::filesystem::remove(path);
    }

    void write_file(const std::string& text) const {
        std::ofstream(path) << text;
    }
};

TEST(CandumpLog, ReadsWhatCandumpWrites) {
    const hal::CandumpLine line = hal::parse_candump_line("(1436509052.249713) vcan0 44A#2A366C2BBA");
    CHECK(CandumpKind::frame == line.kind);
    CHECK(1436509052249713u == line.time_us);
    CHECK((can::Frame{.id = 0x44A, .length = 5, .data = {0x2A, 0x36, 0x6C, 0x2B, 0xBA}} == line.frame));
    CHECK(CandumpKind::frame == hal::parse_candump_line("(0.000001) can0 000#").kind);
    CHECK(CandumpKind::frame == hal::parse_candump_line("(0.000001) can0 7ff#aabbccddeeff0011 R\r").kind);
    CHECK(7u == hal::parse_candump_line("(0.000007123) can0 123#00").time_us);
}

TEST(CandumpLog, KnowsOtherKindsOfFrames) {
    CHECK(CandumpKind::remote == hal::parse_candump_line("(1.000000) vcan0 400#R").kind);
    CHECK(CandumpKind::remote == hal::parse_candump_line("(1.000000) vcan0 400#R8").kind);
    CHECK(CandumpKind::extended == hal::parse_candump_line("(1.000000) vcan0 00000400#11").kind);
    CHECK(CandumpKind::extended == hal::parse_candump_line("(1.000000) vcan0 1FFFFFFF#R").kind);
    CHECK(CandumpKind::error == hal::parse_candump_line("(1.000000) can0 20000004#0020000000000000").kind);
    CHECK(CandumpKind::fd == hal::parse_candump_line("(1.000000) vcan0 400##1112233").kind);
}

TEST(CandumpLog, EverythingElseIsGarbage) {
    for (const char* text : {"garbage",
                             "",
                             "(",
                             "()",
                             "(1.0) vcan0 400#00",
                             "(1.000000)",
                             "(1.000000) vcan0",
                             "(1.000000) vcan0 400",
                             "(1.000000) vcan0 400#0",
                             "(1.000000) vcan0 400#GG",
                             "(1.000000) vcan0 400#112233445566778899",
                             "(1.000000) vcan0 800#00",
                             "(1.000000) vcan0 40#00",
                             "(1.000000) vcan0 4 00#00",
                             "1.000000 vcan0 400#00",
                             "(-1.000000) vcan0 400#00",
                             "(1.-00001) vcan0 400#00",
                             "(99999999999999999999.000000) vcan0 400#00",
                             "(9999999999999.000000) vcan0 400#00",
                             "(nan.000000) vcan0 400#00",
                             "(1.000000) vcan0 400#00 trailing words",
                             "(1.000000) vcan0 FFFFFFFFF#00",
                             "(1.000000) vcan0 C0000000#00",
                             "(1.000000) vcan0 400#R9",
                             "  vcan0  400   [8]  00 11 22 33 44 55 66 77"}) {
        CHECK_TEXT(CandumpKind::garbage == hal::parse_candump_line(text).kind, text);
    }
}

TEST(CandumpLog, NoTextBreaksTheParser) {
    std::mt19937 random(5);
    const std::string good = "(0000000001.000000) vcan0 400#0011223344556677";
    for (int run = 0; run < 20000; ++run) {
        std::string text = good.substr(0, random() % (good.size() + 1));
        for (auto edits = random() % 4; edits > 0 && !text.empty(); --edits)
            text[random() % text.size()] = static_cast<char>(random() % 256);
        const hal::CandumpLine line = hal::parse_candump_line(text);
        CHECK(line.frame.length <= 8);
        CHECK(line.frame.id <= 0x7FF);
    }
}

TEST(CandumpLog, WritesWhatItReads) {
    std::mt19937 random(6);
    std::vector<can::Frame> frames;
    {
        auto log = hal::CandumpWriter::open(path, "vcan0");
        CHECK(log.value != nullptr);
        for (unsigned i = 0; i < 500; ++i) {
            can::Frame frame{.id = static_cast<std::uint16_t>(random() % 0x800),
                             .length = static_cast<std::uint8_t>(random() % 9)};
            for (unsigned b = 0; b < frame.length; ++b) frame.data[b] = static_cast<std::uint8_t>(random());
            log.value->write(i * 100000u, frame);
            frames.push_back(frame);
        }
        STRCMP_EQUAL("", log.value->flush().c_str());
        LONGS_EQUAL(500, log.value->lines());
    }
    auto reader = hal::CandumpReader::open(path);
    CHECK(reader.value != nullptr);
    hal::CandumpLine line;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        CHECK(reader.value->next(line));
        CHECK(CandumpKind::frame == line.kind);
        CHECK(frames[i] == line.frame);
        CHECK(i * 100000u == line.time_us);
    }
    CHECK(!reader.value->next(line));
}

TEST(CandumpLog, LineIsExactlyCandumps) {
    {
        auto log = hal::CandumpWriter::open(path, "vcan0");
        log.value->write(100000, {.id = 0x400, .length = 2, .data = {0x01, 0xAB}});
        log.value->write(0, {.id = 0x5});
    }
    std::ifstream file(path);
    std::string text;
    std::getline(file, text);
    STRCMP_EQUAL("(0000000000.100000) vcan0 400#01AB", text.c_str());
    std::getline(file, text);
    STRCMP_EQUAL("(0000000000.000000) vcan0 005#", text.c_str());
}

TEST(CandumpLog, GarbageKeepsItsLineNumber) {
    write_file("(1.000000) vcan0 400#00\n\n   \nnonsense\n(1.000000) vcan0 401#00");
    auto reader = hal::CandumpReader::open(path);
    hal::CandumpLine line;
    CHECK(reader.value->next(line));
    LONGS_EQUAL(1, reader.value->line_number());
    CHECK(reader.value->next(line));
    CHECK(CandumpKind::garbage == line.kind);
    LONGS_EQUAL(4, reader.value->line_number());
    STRCMP_EQUAL("nonsense", reader.value->text().c_str());
    CHECK(reader.value->next(line));  // last line without an end
    LONGS_EQUAL(0x401, line.frame.id);
    CHECK(!reader.value->next(line));
}

TEST(CandumpLog, EmptyFileEnds) {
    write_file("");
    auto reader = hal::CandumpReader::open(path);
    CHECK(reader.value != nullptr);
    hal::CandumpLine line;
    CHECK(!reader.value->next(line));
}

TEST(CandumpLog, PathsThatDoNotWorkAreNamed) {
    const auto writer = hal::CandumpWriter::open("/nonexistent/dir/x.log", "vcan0");
    CHECK(writer.value == nullptr);
    STRCMP_EQUAL("cannot write CAN log /nonexistent/dir/x.log: No such file or directory",
                 writer.error.c_str());
    const auto reader = hal::CandumpReader::open("/nonexistent/x.log");
    CHECK(reader.value == nullptr);
    STRCMP_EQUAL("cannot read CAN log /nonexistent/x.log: No such file or directory", reader.error.c_str());
    const auto directory = hal::CandumpReader::open("/tmp");
    CHECK(directory.value == nullptr);
    STRCMP_CONTAINS("Is a directory", directory.error.c_str());
}

TEST(CandumpLog, FullDiskIsTold) {
    auto writer = hal::CandumpWriter::open("/dev/full", "vcan0");
    CHECK(writer.value != nullptr);
    for (int i = 0; i < 10000; ++i) writer.value->write(0, {.id = 1, .length = 8});
    STRCMP_EQUAL("CAN log /dev/full is incomplete: No space left on device", writer.value->flush().c_str());
}

TEST(CandumpLog, LoggingPortWritesBothDirections) {
    hal::LoopbackBus bus;
    auto& radar = bus.add_port();
    auto& car = bus.add_port();
    FixedClock clock;
    {
        auto log = hal::CandumpWriter::open(path, "vcan0");
        hal::LoggingPort port(radar, clock, *log.value);
        CHECK(port.send({.id = 0x400, .length = 1, .data = {7}}));
        car.send({.id = 0x431, .length = 1, .data = {9}});
        can::Frame frame;
        CHECK(port.receive(frame));
        LONGS_EQUAL(0x431, frame.id);
        CHECK(!port.receive(frame));
        bus.set_up(false);
        CHECK(!port.send({.id = 0x400}));  // not on the bus, so not in the log
        CHECK(hal::CanState::down == port.state());
        LONGS_EQUAL(1, port.counters().dropped);
        LONGS_EQUAL(2, log.value->lines());
    }
    auto reader = hal::CandumpReader::open(path);
    hal::CandumpLine line;
    CHECK(reader.value->next(line));
    CHECK(1234567u == line.time_us);
    LONGS_EQUAL(0x400, line.frame.id);
    CHECK(reader.value->next(line));
    LONGS_EQUAL(0x431, line.frame.id);
}
