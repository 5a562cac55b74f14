// Moments and tail probabilities of the distributions, against their closed forms; bounds are 5 standard
// errors.
#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "host_sim/random.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Random) {
    static constexpr int kDraws = 1'000'000;
};

TEST(Random, GaussianHasTheMomentsAndTheTailOfTheNormalDistribution) {
    sim::Random random(1);
    double sum = 0;
    double square = 0;
    double fourth = 0;
    int beyond_1 = 0;
    int beyond_tail = 0;  // outside the ziggurat's last layer, where another algorithm draws
    for (int i = 0; i < kDraws; ++i) {
        const double x = random.gaussian();
        sum += x;
        square += x * x;
        fourth += x * x * x * x;
        if (std::fabs(x) > 1) ++beyond_1;
        if (x > 3.442619855899) ++beyond_tail;
    }
    DOUBLES_EQUAL(0, sum / kDraws, 5 * 1e-3);
    DOUBLES_EQUAL(1, square / kDraws, 5 * std::sqrt(2.0) * 1e-3);
    DOUBLES_EQUAL(3, fourth / kDraws, 5 * std::sqrt(96.0) * 1e-3);
    DOUBLES_EQUAL(std::erfc(1 / std::sqrt(2.0)), beyond_1 / double{kDraws}, 5 * 0.466e-3);
    const double tail = std::erfc(3.442619855899 / std::sqrt(2.0)) / 2;
    DOUBLES_EQUAL(tail * kDraws, beyond_tail, 5 * std::sqrt(tail * kDraws));
}

TEST(Random, UniformExponentialAndPoissonHaveTheirMeansAndVariances) {
    sim::Random random(2);
    double uniform = 0;
    double exponential = 0;
    double exponential_square = 0;
    for (int i = 0; i < kDraws; ++i) {
        const double u = random.uniform();
        CHECK(u > 0 && u < 1);
        uniform += u;
        const double e = random.exponential();
        exponential += e;
        exponential_square += e * e;
    }
    DOUBLES_EQUAL(0.5, uniform / kDraws, 5 * 0.289e-3);
    DOUBLES_EQUAL(1, exponential / kDraws, 5e-3);
    DOUBLES_EQUAL(2, exponential_square / kDraws, 5 * std::sqrt(20.0) * 1e-3);
    double count = 0;
    double count_square = 0;
    constexpr int kFew = 20000;
    for (int i = 0; i < kFew; ++i) {
        const double n = random.poisson(6);
        count += n;
        count_square += n * n;
    }
    const double mean = count / kFew;
    DOUBLES_EQUAL(6, mean, 5 * std::sqrt(6.0 / kFew));
    DOUBLES_EQUAL(6, count_square / kFew - mean * mean, 5 * std::sqrt((6 + 2 * 36.0) / kFew));
    LONGS_EQUAL(0, random.poisson(0));
}

TEST(Random, StreamsAreRepeatableAndDifferInSeedPurposeAndIndex) {
    std::set<std::uint64_t> first;
    for (std::uint64_t seed : {0U, 1U}) {
        for (std::uint64_t purpose : {0U, 1U, 2U}) {
            for (std::uint64_t index : {0U, 1U, 2U, 3U}) {
                first.insert(sim::Random(seed, purpose, index).bits());
                CHECK(sim::Random(seed, purpose, index).bits() == sim::Random(seed, purpose, index).bits());
            }
        }
    }
    UNSIGNED_LONGS_EQUAL(24, first.size());
}
