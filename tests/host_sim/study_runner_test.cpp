// The results are known: unit u gives {u, u * u}. What is tested is that nothing else ever comes out.
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "host_sim/json_fields.hpp"
#include "host_sim/study_runner.hpp"

#include <CppUTest/TestHarness.h>

namespace {

struct Study {
    std::filesystem::path directory;
    std::atomic<int> computed = 0;
    sim::StudyRanks ranks;

    explicit Study(const char* name) : directory(std::filesystem::temp_directory_path() / name) {
        std::filesystem::remove_all(directory);
    }
    Study(const Study&) = delete;
    Study& operator=(const Study&) = delete;
    ~Study() { std::filesystem::remove_all(directory); }

    std::vector<std::vector<double>> run(std::size_t units, int threads, const char* configuration = "a") {
        computed = 0;
        sim::StudyWork work;
        work.name = "squares";
        work.configuration = configuration;
        work.units = units;
        work.run = [this](std::size_t u) {
            ++computed;
            const auto v = static_cast<double>(u);
            return std::vector<double>{v, v * v};
        };
        return sim::run_study_units(work, {directory, threads, false}, ranks);
    }
    [[nodiscard]] std::filesystem::path file() const { return directory / "squares.0.runs"; }
};

void check(const std::vector<std::vector<double>>& results, std::size_t units) {
    LONGS_EQUAL(units, results.size());
    for (std::size_t u = 0; u < units; ++u) {
        LONGS_EQUAL(2, results[u].size());
        DOUBLES_EQUAL(static_cast<double>(u * u), results[u][1], 0);
    }
}

}  // namespace

TEST_GROUP(StudyRunner){};

TEST(StudyRunner, SameResultsWithOneThreadAndWithMany) {
    Study one("radar_study_runner_one");
    Study many("radar_study_runner_many");
    check(one.run(50, 1), 50);
    check(many.run(50, 4), 50);
    LONGS_EQUAL(50, many.computed);
}

TEST(StudyRunner, GoesOnWhereItStoppedAndAddsUnits) {
    Study study("radar_study_runner_resume");
    check(study.run(20, 2), 20);
    check(study.run(20, 2), 20);
    LONGS_EQUAL(0, study.computed);
    check(study.run(30, 2), 30);
    LONGS_EQUAL(10, study.computed);
}

TEST(StudyRunner, RecordCutOffByACrashIsDoneAgain) {
    Study study("radar_study_runner_crash");
    study.run(10, 1);
    std::filesystem::resize_file(study.file(), std::filesystem::file_size(study.file()) - 5);
    check(study.run(10, 1), 10);
    LONGS_EQUAL(1, study.computed);
    check(study.run(10, 1), 10);
    LONGS_EQUAL(0, study.computed);
}

TEST(StudyRunner, DamagedRecordIsNotBelieved) {
    Study study("radar_study_runner_damage");
    study.run(10, 1);
    {
        // A bit of the value of the sixth record: header 8 bytes, records of 40.
        std::fstream file(study.file(), std::ios::binary | std::ios::in | std::ios::out);
        file.seekp(8 + 5 * 40 + 20);
        file.put('\x55');
    }
    check(study.run(10, 1), 10);
    LONGS_EQUAL(5, study.computed);  // it and all after it
}

TEST(StudyRunner, RefusesResultsOfAnotherConfiguration) {
    Study study("radar_study_runner_other");
    study.run(5, 1, "seed 1");
    CHECK_THROWS(sim::InputError, study.run(5, 1, "seed 2"));
    check(study.run(5, 1, "seed 1"), 5);
    LONGS_EQUAL(0, study.computed);
}

TEST(StudyRunner, DirectoryThatCannotBeMade) {
    Study study("radar_study_runner_file");
    std::ofstream(study.directory) << "a file";
    CHECK_THROWS(sim::InputError, study.run(1, 1));
}

TEST(StudyRunner, ErrorInAUnitIsReportedAndTheRestIsKept) {
    Study study("radar_study_runner_error");
    sim::StudyWork work;
    work.name = "squares";
    work.configuration = "a";
    work.units = 10;
    work.run = [](std::size_t u) -> std::vector<double> {
        if (u == 7) throw sim::InputError("unit 7");
        return {static_cast<double>(u), static_cast<double>(u * u)};
    };
    CHECK_THROWS(sim::InputError, sim::run_study_units(work, {study.directory, 1, false}, study.ranks));
    check(study.run(10, 1), 10);
    LONGS_EQUAL(3, study.computed);
}
