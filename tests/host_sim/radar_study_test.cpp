// The program as a user runs it: the same tables with one thread, with two, interrupted, and under mpirun.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <sys/wait.h>

#include <CppUTest/TestHarness.h>

namespace {

#ifdef __SANITIZE_ADDRESS__
constexpr bool kSlow = true;
#else
constexpr bool kSlow = false;
#endif

const std::filesystem::path kRoot = std::filesystem::temp_directory_path() / "radar_study_test";

int shell(const std::string& command) {
    const int status = std::system((command + " >/dev/null 2>&1").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string study(const char* out, const std::string& options) {
    return std::string(RADAR_STUDY) + " lee2000 --no-pictures --scenarios " + kRoot.string() + " --out " +
           (kRoot / out).string() + " " + options;
}

std::string contents(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// Of two runs of a study all but the times.
void check_same(const char* out, const std::string& name = "lee2000", const char* first = "one") {
    for (const char* ending : {".txt", ".csv", ".json"}) {
        const std::string expected = contents(kRoot / first / (name + ending));
        CHECK(!expected.empty());
        CHECK_TEXT(expected == contents(kRoot / out / (name + ending)), (name + ending).c_str());
    }
}

const std::string kMpirun =
    "env OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 mpirun --oversubscribe -n 2 ";

/// Three conditions instead of twenty-five, and the results of a first run in "one".
void prepare() {
    std::filesystem::remove_all(kRoot);
    std::filesystem::create_directories(kRoot);
    std::ofstream(kRoot / "lee2000.json") << R"({ "geometries": ["lee2000-short"], "clutter_density": [0.02],
        "sweeps": { "gate": [9.21] },
        "unresolved": { "geometry": "lee2000-short", "clutter_density": [0.005] } })";
    std::ofstream(kRoot / "lee2000-short.json")
        << R"({ "description": "short", "duration_s": 4, "pairs": [[1, 2]],
        "targets": [ { "range_m": 50, "range_rate_mps": -1 }, { "range_m": 48, "range_rate_mps": 0 } ] })";
    LONGS_EQUAL(0, shell(study("one", "--runs 4 --threads 1")));
}

}  // namespace

TEST_GROUP(RadarStudy){};

TEST(RadarStudy, SameTablesHoweverItIsRun) {
    prepare();
    LONGS_EQUAL(0, shell(study("two", "--runs 4 --threads 2")));
    check_same("two");

    // Killed at some moment, then started again.
    shell("timeout -s KILL 0.05 " + study("killed", "--runs 4"));
    LONGS_EQUAL(0, shell(study("killed", "--runs 4")));
    check_same("killed");

    if (shell("command -v mpirun") != 0) {
        std::printf("mpirun is not installed: not compared\n");
        return;
    }
    LONGS_EQUAL(0, shell(kMpirun + study("mpi", "--runs 4")));
    CHECK(std::filesystem::exists(kRoot / "mpi" / "lee2000.1.runs") || !RADAR_WITH_MPI);
    check_same("mpi");
}

// In lowsnr the processes need the thresholds that one of them works out.
TEST(RadarStudy, OtherStudiesTooGiveTheSameTablesHoweverTheyAreRun) {
    std::filesystem::remove_all(kRoot);
    std::filesystem::create_directories(kRoot);
    for (const std::string name : {"multimodel", "lowsnr"}) {
        if (kSlow && name == "lowsnr") continue;  // a minute with sanitizers
        const std::string options = name == "lowsnr" ? " --runs 2 --calibration 2" : " --runs 2";
        const auto of = [&](const std::string& out) {
            return std::string(RADAR_STUDY) + " " + name + " --no-pictures --out " + (kRoot / out).string() +
                   options;
        };
        LONGS_EQUAL(0, shell(of(name + "-one") + " --threads 1"));
        shell("timeout -s KILL 0.2 " + of(name + "-killed"));
        LONGS_EQUAL(0, shell(of(name + "-killed") + " --threads 2"));
        check_same((name + "-killed").c_str(), name, (name + "-one").c_str());
        if (shell("command -v mpirun") != 0) continue;
        LONGS_EQUAL(0, shell(kMpirun + of(name + "-mpi")));
        check_same((name + "-mpi").c_str(), name, (name + "-one").c_str());
    }
}

TEST(RadarStudy, ErrorsAreToldAndLoseNothing) {
    prepare();
    LONGS_EQUAL(1, shell(study("one", "--runs 4 --seed 9")));
    LONGS_EQUAL(1, shell(study("one", "--runs 1")));
    LONGS_EQUAL(1, shell(study("/proc/none", "--runs 4")));
    LONGS_EQUAL(1, shell(std::string(RADAR_STUDY) + " lee1999 --out x"));
    LONGS_EQUAL(1, shell(std::string(RADAR_STUDY)));
    LONGS_EQUAL(1, shell(std::string(RADAR_STUDY) + " lowsnr"));
    LONGS_EQUAL(0, shell(std::string(RADAR_STUDY) + " lowsnr --help"));
    LONGS_EQUAL(0, shell(study("one", "--runs 4")));
}
