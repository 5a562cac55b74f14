// Expected values worked by hand.
#include <cmath>
#include <vector>

#include "host_sim/study_statistics.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(StudyStatistics){};

TEST(StudyStatistics, MeanWithNormalInterval) {
    // Deviations -1, 0, 1: standard deviation 1, standard error 1 / sqrt 3.
    const std::vector<double> values{1, 2, 3};
    const sim::Estimate e = sim::mean_of(values);
    DOUBLES_EQUAL(2, e.value, 1e-15);
    DOUBLES_EQUAL(2 - 1.96 / std::sqrt(3.0), e.low, 1e-12);
    DOUBLES_EQUAL(2 + 1.96 / std::sqrt(3.0), e.high, 1e-12);
    DOUBLES_EQUAL(0, sim::mean_of({}).value, 0);
    DOUBLES_EQUAL(5, sim::mean_of(std::vector<double>{5}).low, 0);
}

TEST(StudyStatistics, MedianOfOddEvenAndNone) {
    DOUBLES_EQUAL(3, sim::median_of({9, 1, 3}), 0);
    DOUBLES_EQUAL(2, sim::median_of({9, 1, 3, 1}), 0);
    CHECK(std::isnan(sim::median_of({})));
}

TEST(StudyStatistics, ImprovementOfRootMeanSquares) {
    // Mean squares 4 and 1 in every run: half the error, and no doubt about it.
    std::vector<sim::ErrorPair> pairs;
    for (std::size_t run = 0; run < 50; ++run) pairs.push_back({run, 4, 1});
    const sim::Estimate sure = sim::improvement_of(pairs, 50);
    DOUBLES_EQUAL(0.5, sure.value, 1e-12);
    DOUBLES_EQUAL(0.5, sure.low, 1e-12);
    DOUBLES_EQUAL(0.5, sure.high, 1e-12);

    // Half the runs better by 2, half worse by 2: none on the whole, and the interval says so.
    pairs.clear();
    for (std::size_t run = 0; run < 50; ++run)
        pairs.push_back({run, run % 2 == 0 ? 4.0 : 1.0, run % 2 == 0 ? 1.0 : 4.0});
    const sim::Estimate unsure = sim::improvement_of(pairs, 50);
    DOUBLES_EQUAL(0, unsure.value, 1e-12);
    CHECK(unsure.low < -0.05 && unsure.high > 0.05);
    CHECK(std::isnan(sim::improvement_of({}, 50).value));
}
