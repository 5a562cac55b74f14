// The program itself: exit codes and messages for good, broken and impossible input.
#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <nlohmann/json.hpp>

#include "hal/host/candump_log.hpp"
#include "tests/host_sim/test_bus.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <CppUTest/TestHarness.h>

namespace {

struct Run {
    int exit_code;
    std::string output;  ///< both streams
};

Run monitor(const std::string& arguments) {
    FILE* pipe = ::popen((RADAR_MONITOR " " + arguments + " 2>&1").c_str(), "r");
    Run result{};
    std::array<char, 4096> buffer;
    while (const std::size_t size = std::fread(buffer.data(), 1, buffer.size(), pipe))
        result.output.append(buffer.data(), size);
    const int status = ::pclose(pipe);
    result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return result;
}

}  // namespace

TEST_GROUP(RadarMonitor) {
    std::string folder =
        (std::filesystem::temp_directory_path() / ("radar_monitor_test." + std::to_string(::getpid())))
            .string();
    std::string log = folder + "/run.log";
    TestBus bus;

    void setup() override {
        std::filesystem::create_directory(folder);
    }
    void teardown() override {
        std::filesystem::remove_all(folder);
    }

    void write_log(int cycles) {
        auto writer = hal::CandumpWriter::open(log, "vcan0");
        for (int i = 0; i < cycles; ++i)
            for (const auto& timed : bus.next_cycle(2)) writer.value->write(timed.time_us, timed.frame);
    }
    void append(const std::string& line) const {
        std::ofstream(log, std::ios::app) << line << '\n';
    }

    void check_refused(const std::string& arguments, const char* text) {
        const Run result = monitor(arguments);
        LONGS_EQUAL(1, result.exit_code);
        STRCMP_CONTAINS(text, result.output.c_str());
    }
};

TEST(RadarMonitor, SoundLogIsClean) {
    write_log(20);
    const Run result = monitor(log + " --json " + folder + "/run.json");
    LONGS_EQUAL(0, result.exit_code);
    STRCMP_CONTAINS("#3 45.20 m -10.05 m/s Oncoming", result.output.c_str());
    STRCMP_CONTAINS("errors: 0\n", result.output.c_str());
    std::ifstream file(folder + "/run.json");
    const auto json = nlohmann::json::parse(file);
    LONGS_EQUAL(20, json["lists"]["whole"].get<int>());
    LONGS_EQUAL(142, json["frames"].get<int>());
}

TEST(RadarMonitor, BrokenLogIsReadToItsEnd) {
    write_log(5);
    append("garbage");
    append("(0.500000) vcan0 400#R");
    append("(0.500000) vcan0 00000400#00");
    append("(0.500000) vcan0 400#00");
    append("(0.500000) vcan0 400#00000000000000");
    append("(0.500000) vcan0 123#00");
    const Run result = monitor("--quiet " + log);
    LONGS_EQUAL(2, result.exit_code);
    STRCMP_CONTAINS("garbage lines                       1", result.output.c_str());
    STRCMP_CONTAINS("remote frames (RTR)                 1", result.output.c_str());
    STRCMP_CONTAINS("extended identifiers                1", result.output.c_str());
    STRCMP_CONTAINS("wrong length                        1", result.output.c_str());
    STRCMP_CONTAINS("bad CRC                             1", result.output.c_str());
    STRCMP_CONTAINS("foreign identifiers                 1", result.output.c_str());
    STRCMP_CONTAINS("errors: 3\n", result.output.c_str());
}

TEST(RadarMonitor, NothingButGarbageIsCountedNotBelieved) {
    for (int i = 0; i < 1000; ++i) append("nonsense " + std::to_string(i));
    const Run result = monitor(log);
    LONGS_EQUAL(2, result.exit_code);
    STRCMP_CONTAINS("line 1 is no line of a CAN log", result.output.c_str());
    STRCMP_CONTAINS("further events are counted only", result.output.c_str());
    CHECK(result.output.find("line 900 ") == std::string::npos);
    STRCMP_CONTAINS("garbage lines                    1000", result.output.c_str());
    STRCMP_CONTAINS("no frame of the radar", result.output.c_str());
}

TEST(RadarMonitor, StopsWhereItIsTold) {
    write_log(20);
    STRCMP_CONTAINS("\n70 frames in ", ("\n" + monitor("--quiet --frames 70 " + log).output).c_str());
    STRCMP_CONTAINS(" frames in 1.0 s", monitor("--quiet --duration 1 " + log).output.c_str());
}

TEST(RadarMonitor, ReadsStandardInput) {
    write_log(3);
    LONGS_EQUAL(0, monitor("- < " + log).exit_code);
}

TEST(RadarMonitor, ImpossibleInputIsNamed) {
    write_log(1);
    check_refused("", "name an interface or a CAN log");
    check_refused("--nonsense", "--nonsense");
    check_refused("/nonexistent/run.log",
                  "cannot read CAN log /nonexistent/run.log: No such file or directory");
    check_refused(folder + "/", "Is a directory");
    check_refused("/dev/null", "CAN log /dev/null is empty");
    check_refused(log + " --json /nonexistent/x.json", "cannot write /nonexistent/x.json");
    check_refused(log + " --frames 0", "--frames");
    check_refused(log + " --frames -3", "--frames");
    check_refused(log + " --duration NaN", "--duration");
    check_refused(log + " --duration 0", "--duration");
    check_refused("--bus-load 17", "--bus-load");
    check_refused("--write-dbc /nonexistent/x.dbc", "cannot write /nonexistent/x.dbc");
}

TEST(RadarMonitor, MissingInterfaceComesWithTheRemedy) {
    const Run result = monitor("vcan_missing");
    LONGS_EQUAL(1, result.exit_code);
    CHECK(result.output.find("ip link add dev vcan_missing type vcan") != std::string::npos ||
          result.output.find("modprobe can_raw") != std::string::npos);
}

TEST(RadarMonitor, HelpTeaches) {
    const Run result = monitor("--help");
    LONGS_EQUAL(0, result.exit_code);
    STRCMP_CONTAINS("radar_monitor vcan0", result.output.c_str());
    STRCMP_CONTAINS("exit code", result.output.c_str());
}

TEST(RadarMonitor, PrintsTheBusLoad) {
    const Run result = monitor("--bus-load");
    LONGS_EQUAL(0, result.exit_code);
    STRCMP_CONTAINS("10.13 %   (bar: < 40 %)", result.output.c_str());
}

TEST(RadarMonitor, WritesTheDbc) {
    LONGS_EQUAL(0, monitor("--write-dbc " + folder + "/radar.dbc").exit_code);
    const auto read = [](const std::string& path) {
        std::stringstream text;
        text << std::ifstream(path).rdbuf();
        return text.str();
    };
    CHECK(read(folder + "/radar.dbc") == read(RADAR_SOURCE_DIR "/can/radar.dbc"));
}
