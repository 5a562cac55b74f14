/// Random numbers that are the same everywhere: the distributions of <random> are not.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace sim {

/// xoshiro256++ (Blackman and Vigna 2019), seeded by splitmix64.
///
/// A stream is chosen by (seed, purpose, index), so that what one purpose draws never shifts another, and
/// frame 100 is the same frame whether or not frame 99 was asked for.
class Random {
  public:
    explicit Random(std::uint64_t seed, std::uint64_t purpose = 0, std::uint64_t index = 0);

    std::uint64_t bits();
    /// In (0, 1): never 0, never 1.
    double uniform();
    /// Standard normal; ziggurat of 128 layers (Marsaglia and Tsang 2000, in Doornik's form).
    double gaussian();
    /// Mean 1.
    double exponential();
    /// Number of events, mean below 700.
    int poisson(double mean);
    /// Adds sigma times a standard normal to each element.
    void add_noise(std::span<float> signal, float sigma);

  private:
    std::array<std::uint64_t, 4> state_{};
};

}  // namespace sim
