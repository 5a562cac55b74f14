#include "host_sim/infrared_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "dsp/os_cfar.hpp"
#include "host_sim/random.hpp"

namespace sim {

namespace {

constexpr double kSpread_px = 0.8;
constexpr double kTargetPeak = 12;  // in standard deviations of the noise
constexpr double kTargetPeakSigma = 2;
constexpr int kReach = 3;  // pixels a point spreads to each side
constexpr std::uint64_t kNoisePurpose = 6;
constexpr std::uint64_t kPointPurpose = 7;

std::size_t at(int x, int y) {
    return static_cast<std::size_t>(y) * kImageWidth + static_cast<std::size_t>(x);
}

void add_point(std::vector<float>& image, double px, double py, double peak) {
    const int cx = static_cast<int>(std::lround(px));
    const int cy = static_cast<int>(std::lround(py));
    for (int y = std::max(0, cy - kReach); y <= std::min(kImageHeight - 1, cy + kReach); ++y) {
        for (int x = std::max(0, cx - kReach); x <= std::min(kImageWidth - 1, cx + kReach); ++x) {
            const double r2 = (x - px) * (x - px) + (y - py) * (y - py);
            image[at(x, y)] += static_cast<float>(peak * std::exp(-r2 / (2 * kSpread_px * kSpread_px)));
        }
    }
}

}  // namespace

std::vector<InfraredTarget> infrared_targets(int frame) {
    std::vector<InfraredTarget> out;
    const auto add = [&](int id, int formation, double x, double y) {
        if (x >= 0 && x < kImageWidth && y >= 0 && y < kImageHeight) out.push_back({id, formation, {x, y}});
    };
    if (frame >= 6) {
        // Two wedges, the wings of one between those of the other.
        for (int i = 0; i < 7; ++i) {
            const int wing = i - 3;
            const double back = 6.0 * std::abs(wing);
            add(1 + i, 1, 590 + 20.0 * (frame - 6) - back, 300 + 8.0 * wing);
            add(8 + i, 2, 910 - 20.0 * (frame - 6) + back, 304 + 8.0 * wing);
        }
    }
    if (frame >= 25 && frame < 75) add(15, 0, 200 + 12.0 * (frame - 25), 500 - 4.0 * (frame - 25));
    if (frame >= 40) add(16, 0, 1400 - 15.0 * (frame - 40), 100 + 3.0 * (frame - 40));
    if (frame >= 60 && frame < 95) add(17, 0, 700 + 25.0 * (frame - 60), 80);
    return out;
}

std::vector<float> infrared_image(std::uint64_t seed, std::uint64_t index, int frame) {
    std::vector<float> image(static_cast<std::size_t>(kImageWidth) * kImageHeight);
    for (int y = 0; y < kImageHeight; ++y)
        for (int x = 0; x < kImageWidth; ++x)
            image[at(x, y)] = static_cast<float>(100 + 0.02 * y + 3 * std::sin(0.004 * x));
    const std::uint64_t stream = index * kInfraredFrames + static_cast<std::uint64_t>(frame);
    Random points(seed, kPointPurpose, stream);
    for (const InfraredTarget& t : infrared_targets(frame))
        add_point(image, t.position[0], t.position[1], kTargetPeak + kTargetPeakSigma * points.gaussian());
    for (int n = points.poisson(kFlashes); n > 0; --n) {
        const double x = kImageWidth * points.uniform();
        const double y = kImageHeight * points.uniform();
        add_point(image, x, y, 6 + 3 * points.exponential());
    }
    Random(seed, kNoisePurpose, stream).add_noise(image, 1);
    return image;
}

std::vector<PlaneMeasurement> detect_points(const std::vector<float>& image) {
    // Separable blur with the point spread, less the mean of a wider box; scaled to unit variance in white
    // noise.
    constexpr int kBlur = 2;
    constexpr int kBox = 5;
    std::array<float, 2 * kBlur + 1> tap{};
    float sum = 0;
    for (int i = -kBlur; i <= kBlur; ++i) {
        const auto t = static_cast<float>(std::exp(-i * i / (2 * kSpread_px * kSpread_px)));
        tap[static_cast<std::size_t>(i + kBlur)] = t;
        sum += t;
    }
    for (float& t : tap) t /= sum;
    float tap2 = 0;
    for (const float t : tap) tap2 += t * t;
    constexpr float kBoxCells = (2 * kBox + 1) * (2 * kBox + 1);
    // Variance of blur - box: |blur|^2 - 2 <blur, box> + |box|^2, and the blur lies inside the box.
    const float scale = 1 / std::sqrt(tap2 * tap2 - 1 / kBoxCells);

    std::vector<float> rows(image.size());
    std::vector<float> box_rows(image.size());
    for (int y = 0; y < kImageHeight; ++y) {
        float box = 0;
        for (int x = 0; x < 2 * kBox; ++x) box += image[at(x, y)];
        for (int x = kBox; x < kImageWidth - kBox; ++x) {
            box += image[at(x + kBox, y)];
            float blur = 0;
            for (int i = -kBlur; i <= kBlur; ++i)
                blur += tap[static_cast<std::size_t>(i + kBlur)] * image[at(x + i, y)];
            rows[at(x, y)] = blur;
            box_rows[at(x, y)] = box;
            box -= image[at(x - kBox, y)];
        }
    }
    std::vector<float> power(image.size());
    std::vector<float> box(kImageWidth, 0);
    for (int y = 0; y < 2 * kBox; ++y)
        for (int x = kBox; x < kImageWidth - kBox; ++x)
            box[static_cast<std::size_t>(x)] += box_rows[at(x, y)];
    for (int y = kBox; y < kImageHeight - kBox; ++y) {
        const float* above = &rows[at(0, y - 2)];
        for (int x = kBox; x < kImageWidth - kBox; ++x) {
            float& cells = box[static_cast<std::size_t>(x)];
            cells += box_rows[at(x, y + kBox)];
            float blur = 0;
            for (int i = 0; i <= 2 * kBlur; ++i)
                blur += tap[static_cast<std::size_t>(i)] * above[x + i * kImageWidth];
            const float v = scale * (blur - cells / kBoxCells);
            cells -= box_rows[at(x, y - kBox)];
            power[at(x, y)] =
                v > 0 ? v * v : -v * v;  // dark points are not looked for, but are noise all the same
        }
    }

    // x > alpha X_(k) exactly when at least k reference cells are below x / alpha: decided without sorting.
    constexpr int kRing = 6;
    constexpr int kCells = 24;
    constexpr int kRank = 18;
    constexpr int kFalseAlarmPpb = 1'000;
    constexpr float kOffset =
        2;  // squares of Gaussian cells have a heavier tail than the exponential one of alpha
    static const float kAlpha =
        std::exp2(static_cast<float>(dsp::os_cfar_alpha(kCells, kRank, kFalseAlarmPpb)) / 1024.0F) * kOffset;
    constexpr int kMargin = kBox + kRing + 1;
    std::vector<PlaneMeasurement> out;
    for (int y = kMargin; y < kImageHeight - kMargin; ++y) {
        for (int x = kMargin; x < kImageWidth - kMargin; ++x) {
            const float p = power[at(x, y)];
            if (p < 9) continue;  // far below any threshold the ring can give
            bool top = true;
            for (int j = -1; j <= 1 && top; ++j)
                for (int i = -1; i <= 1 && top; ++i)
                    top = (i == 0 && j == 0) || (j < 0 || (j == 0 && i < 0) ? power[at(x + i, y + j)] < p
                                                                            : power[at(x + i, y + j)] <= p);
            if (!top) continue;
            int below = 0;
            for (int i = -kRing; i < kRing; i += 2) {
                for (const float cell : {power[at(x + i, y - kRing)], power[at(x + kRing, y + i)],
                                         power[at(x - i, y + kRing)], power[at(x - kRing, y - i)]})
                    below += std::abs(cell) * kAlpha < p ? 1 : 0;
            }
            if (below < kRank) continue;
            const auto offset = [&](float before, float after) {
                const float a = std::sqrt(std::max(before, 0.0F));
                const float b = std::sqrt(p);
                const float c = std::sqrt(std::max(after, 0.0F));
                const float curve = a - 2 * b + c;
                return curve < 0 ? static_cast<double>(0.5F * (a - c) / curve) : 0.0;
            };
            out.push_back({{x + offset(power[at(x - 1, y)], power[at(x + 1, y)]),
                            y + offset(power[at(x, y - 1)], power[at(x, y + 1)])},
                           static_cast<double>(p)});
        }
    }
    return out;
}

}  // namespace sim
