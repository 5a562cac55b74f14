#include "host_sim/random.hpp"

#include <bit>
#include <cmath>
#include <cstddef>

#include "host_sim/portable_math.hpp"

namespace sim {

namespace {

constexpr std::size_t kLayers = 128;
constexpr double kTail = 3.442619855899;
constexpr double kLayerArea = 9.91256303526217e-3;

struct Ziggurat {
    std::array<double, kLayers + 1> edge{};
    std::array<double, kLayers> inside{};  ///< |u| below this needs no further test

    Ziggurat() {
        double f = sim::exponential(-0.5 * kTail * kTail);
        edge[0] = kLayerArea / f;
        edge[1] = kTail;
        edge[kLayers] = 0;
        for (std::size_t i = 2; i < kLayers; ++i) {
            edge[i] = std::sqrt(-2 * logarithm(kLayerArea / edge[i - 1] + f));
            f = sim::exponential(-0.5 * edge[i] * edge[i]);
        }
        for (std::size_t i = 0; i < kLayers; ++i) inside[i] = edge[i + 1] / edge[i];
    }
};

const Ziggurat kZiggurat;

std::uint64_t splitmix64(std::uint64_t& state) {
    state += 0x9E3779B97F4A7C15;
    std::uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
    return z ^ (z >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t purpose, std::uint64_t index) {
    std::uint64_t mix = seed;
    mix = splitmix64(mix) ^ purpose;
    mix = splitmix64(mix) ^ index;
    for (auto& word : state_) word = splitmix64(mix);
}

std::uint64_t Random::bits() {
    const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = std::rotl(state_[3], 45);
    return result;
}

double Random::uniform() {
    return (static_cast<double>(bits() >> 12) + 0.5) * 0x1p-52;
}

double Random::gaussian() {
    for (;;) {
        const std::uint64_t word = bits();
        const auto layer = static_cast<std::size_t>(word & (kLayers - 1));
        // The upper 53 bits as a signed number in [-1, 1); the layer's bits are not among them.
        const double u = static_cast<double>(static_cast<std::int64_t>(word) >> 11) * 0x1p-52;
        if (std::fabs(u) < kZiggurat.inside[layer]) return u * kZiggurat.edge[layer];
        if (layer == 0) {
            for (;;) {
                const double x = logarithm(uniform()) / kTail;
                const double y = logarithm(uniform());
                if (-2 * y >= x * x) return u < 0 ? x - kTail : kTail - x;
            }
        }
        const double x = u * kZiggurat.edge[layer];
        const double outer = sim::exponential(-0.5 * (kZiggurat.edge[layer] * kZiggurat.edge[layer] - x * x));
        const double inner =
            sim::exponential(-0.5 * (kZiggurat.edge[layer + 1] * kZiggurat.edge[layer + 1] - x * x));
        if (inner + uniform() * (outer - inner) < 1) return x;
    }
}

double Random::exponential() {
    return -logarithm(uniform());
}

int Random::poisson(double mean) {
    const double limit = sim::exponential(-mean);
    int count = 0;
    for (double product = uniform(); product > limit; product *= uniform()) ++count;
    return count;
}

void Random::add_noise(std::span<float> signal, float sigma) {
    for (float& sample : signal) sample += sigma * static_cast<float>(gaussian());
}

}  // namespace sim
