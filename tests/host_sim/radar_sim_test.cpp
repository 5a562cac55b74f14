// The program as its users call it: exit status and message of good and bad command lines, files it writes.
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <sys/wait.h>

#include <nlohmann/json.hpp>

#include <CppUTest/TestHarness.h>

TEST_GROUP(RadarSim) {
    std::filesystem::path folder = std::filesystem::temp_directory_path() / "radar_sim_test";
    int status = 0;
    std::string output;
    void setup() {
        std::filesystem::create_directories(folder);
    }
    void teardown() {
        std::filesystem::remove_all(folder);
    }

    const std::string& call(const std::string& arguments, const std::string& before = "") {
        output.clear();
        std::FILE* pipe = ::popen((before + " " RADAR_SIM " " + arguments + " 2>&1").c_str(), "r");
        std::array<char, 4096> part{};
        while (const std::size_t n = std::fread(part.data(), 1, part.size(), pipe))
            output.append(part.data(), n);
        const int result = ::pclose(pipe);
        status = WIFEXITED(result) ? WEXITSTATUS(result) : -1;
        return output;
    }
    void refuses(const std::string& arguments, const char* reason) {
        call(arguments);
        LONGS_EQUAL_TEXT(1, status, arguments.c_str());
        STRCMP_CONTAINS(reason, output.c_str());
    }
    [[nodiscard]] std::string file(const char* name) const {
        return (folder / name).string();
    }
};

TEST(RadarSim, HelpAndListAreShown) {
    STRCMP_CONTAINS("Examples:", call("--help").c_str());
    LONGS_EQUAL(0, status);
    STRCMP_CONTAINS("Exit status: 0", output.c_str());
    STRCMP_CONTAINS("four-targets   experiment of Lee and Kim 2000", call("--list-scenarios").c_str());
    LONGS_EQUAL(0, status);
}

TEST(RadarSim, RefusesBadCommandLinesWithStatusOneAndAReason) {
    refuses("", "nothing to do: give --scenario");
    refuses("--scenario rush-hour", "no scenario named \"rush-hour\"; shipped: approach");
    refuses("--scenario empty --tracker best", "no tracker named \"best\"; known: nn, pda, ospda");
    refuses("--scenario empty --tracker ijipda:32", "no tracker named \"ijipda:32\"");
    refuses("--scenario empty --tracker pda:2", "no tracker named \"pda:2\"");
    refuses("--scenario empty --trackers pda", "--trackers");
    refuses("--scenario empty --frames 0", "--frames: must be at least 1, is 0");
    refuses("--scenario empty --frames -5", "--frames: must be at least 1, is -5");
    refuses("--scenario empty --frames many", "--frames");
    refuses("--scenario empty --speed 0", "--speed");
    refuses("--scenario empty --speed 2 --realtime", "excludes");
    refuses("--scenario empty --replay x.bin", "excludes");
    refuses("--scenario empty --frames 2 --can nocan7", "nocan7");
    refuses("--scenario empty --frames 2 --log /nowhere/can.log", "/nowhere/can.log");
    refuses("--scenario empty --frames 2 --json /nowhere/result.json",
            "/nowhere/result.json: cannot be created");
    refuses("--scenario empty --frames 2 --plot /proc/no/plots", "/proc/no/plots: cannot be created");
    refuses("--replay /nowhere/frames.bin", "/nowhere/frames.bin: no such file");
    refuses("--traffic /nowhere/traffic.csv", "/nowhere/traffic.csv: cannot be read");
    std::ofstream(file("s.json")) << R"({"description": "x", "duration_s": -3, "ego": {"speed_mps": 1}})";
    refuses("--scenario " + file("s.json"), "s.json: duration_s: out of range: -3");
    std::ofstream(file("w.json")) << R"({"carrier_hz": "high"})";
    refuses("--replay x.bin --waveform " + file("w.json"),
            "w.json: carrier_hz: wrong type: must be a number");
}

TEST(RadarSim, WritesSummaryLogAndRecordingAndReplaysIt) {
    call("--scenario four-targets --frames 12 --seed 3 --tracker pda --json " + file("r.json") + " --log " +
         file("can.log") + " --record " + file("f.bin"));
    LONGS_EQUAL(0, status);
    STRCMP_CONTAINS("four-targets, tracker pda, bus loopback: 12 frames", output.c_str());
    STRCMP_CONTAINS("wrote ", output.c_str());
    const auto json = nlohmann::json::parse(std::ifstream(file("r.json")));
    for (const char* key :
         {"frames", "scenario", "tracker", "bus", "can_frames", "dropped_frames", "overruns", "targets",
          "confirmed_tracks", "false_tracks", "id_switches", "range_rmse_m", "velocity_rmse_mps",
          "gospa_mean", "first_confirmation_s", "faults"}) {
        CHECK_TEXT(json.contains(key), key);
    }
    LONGS_EQUAL(12, json["frames"].get<int>());
    LONGS_EQUAL(4, json["targets"].get<int>());
    LONGS_EQUAL(12 * 8192, std::filesystem::file_size(file("f.bin")));
    std::string line;
    std::getline(std::ifstream(file("can.log")) >> std::ws, line);
    STRCMP_CONTAINS(") loopback 4", line.c_str());
    std::ofstream(file("w.json")) << "{}";
    call("--quiet --replay " + file("f.bin") + " --waveform " + file("w.json"));
    LONGS_EQUAL(0, status);
    STRCMP_EQUAL("", output.c_str());
}

TEST(RadarSim, RealTimeTakesItsTime) {
    const auto before = std::chrono::steady_clock::now();
    call("--scenario empty --frames 6 --speed 5 --quiet");
    LONGS_EQUAL(0, status);
    CHECK(std::chrono::steady_clock::now() - before >= std::chrono::milliseconds(100));
}

TEST(RadarSim, DrawsPicturesOrSaysThatGnuplotIsMissing) {
    call("--scenario four-targets --frames 12 --plot " + file("out"), "PATH=/nowhere");
    LONGS_EQUAL(1, status);
    STRCMP_CONTAINS("gnuplot is not installed: apt-get install gnuplot-nox", output.c_str());
    if (std::system("command -v gnuplot > /dev/null") != 0) {
        std::printf("SKIPPED: gnuplot is not installed\n");
        return;
    }
    call("--scenario four-targets --frames 12 --plot " + file("out"));
    LONGS_EQUAL(0, status);
    for (const char* picture : {"out/tracks.png", "out/range_doppler.png"}) {
        std::string head(8, ' ');
        std::ifstream(folder / picture, std::ios::binary).read(head.data(), 8);
        STRCMP_EQUAL("\x89PNG\r\n\x1a\n", head.c_str());
        CHECK(std::filesystem::file_size(folder / picture) > 10000);
    }
}
