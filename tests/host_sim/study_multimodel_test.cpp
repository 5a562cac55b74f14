// The study itself, small: files are there, a second start computes nothing anew, and what must hold of any
// sound IMM-PDAF holds.
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include <unistd.h>

#include "host_sim/study_multimodel.hpp"

#include <CppUTest/TestHarness.h>
#include <CppUTest/MemoryLeakWarningPlugin.h>

namespace {
std::string read(const std::filesystem::path& file) {
    std::ifstream in(file);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
}
}  // namespace

namespace {
struct Study {
    std::filesystem::path directory =
        std::filesystem::temp_directory_path() / ("study_multimodel_" + std::to_string(::getpid()));

    Study() { std::filesystem::remove_all(directory); }
    Study(const Study&) = delete;
    Study& operator=(const Study&) = delete;
    ~Study() { std::filesystem::remove_all(directory); }

    void run(std::size_t runs, int threads) const {
        const sim::StudyRanks ranks;
        sim::StudyOptions options;
        options.runs = runs;
        options.pictures = false;
        options.run = {.directory = directory, .threads = threads, .show_progress = false};
        sim::run_multimodel(options, ranks);
    }
    [[nodiscard]] std::string tables() const {
        return read(directory / "multimodel.csv") + read(directory / "multimodel.json");
    }
};
}  // namespace

TEST_GROUP(StudyMultimodel){
    // Threads and the parser keep memory of their own between tests; AddressSanitizer looks after leaks.
    void setup() override{MemoryLeakWarningPlugin::turnOffNewDeleteOverloads();
}
void teardown() override {
    MemoryLeakWarningPlugin::turnOnDefaultNotThreadSafeNewDeleteOverloads();
}
}
;

TEST(StudyMultimodel, ResumedRunsGiveTheTablesOfRunsAtOnce) {
    std::string resumed;
    {
        const Study study;
        study.run(3, 1);
        study.run(8, 2);
        resumed = study.tables();
    }
    const Study study;
    study.run(8, 1);
    CHECK(resumed == study.tables());
    CHECK(!resumed.empty());
}

TEST(StudyMultimodel, ModesAndSensorsHelp) {
    const Study study;
    study.run(12, 2);
    const auto json = nlohmann::json::parse(read(study.directory / "multimodel.json"));
    LONGS_EQUAL(10, json.at("filters").size());
    const auto& imm = json.at("filters").at(3);
    const auto& imm_three = json.at("filters").at(8);
    CHECK(imm.at("lost_percent").at(0) == 0.0);
    CHECK(json.at("filters").at(0).at("lost_percent").at(0) > 50.0);  // sigma 1 cannot turn
    for (const auto& [vehicle, rms] : imm.at("rms_m").items()) {
        CHECK(rms < 0.4);
        CHECK(imm_three.at("rms_m").at(vehicle) < rms);
        CHECK(rms < json.at("filters").at(1).at("rms_m").at(vehicle));  // PDAF, sigma 4
    }
}
