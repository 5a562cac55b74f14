#include "dsp/window_response.hpp"

#include <algorithm>

namespace dsp {

namespace {
// One variable each: a compiler's limit on compile-time evaluation counts per variable.
constexpr WindowResponse kRectangular = make_response(window(WindowKind::rectangular));
constexpr WindowResponse kHann = make_response(window(WindowKind::hann));
constexpr WindowResponse kHamming = make_response(window(WindowKind::hamming));
constexpr WindowResponse kBlackman = make_response(window(WindowKind::blackman));

constexpr bool falls(const WindowResponse& response) {
    std::int16_t largest = response.sidelobe[kWindowLength / 2];
    for (std::size_t m = kWindowLength / 2; m-- > 0;) {
        largest = std::max(largest, response.sidelobe[m]);
        if (largest > std::max(response.sidelobe[m], response.sidelobe[m + 1])) return false;
    }
    return true;
}
static_assert(falls(kRectangular) && falls(kHann) && falls(kHamming) && falls(kBlackman));
}  // namespace

constinit const std::array<WindowResponse, 4> kWindowResponses{kRectangular, kHann, kHamming, kBlackman};

}  // namespace dsp
