#include "dsp/window_response.hpp"

namespace dsp {

namespace {
// One variable each: a compiler's limit on compile-time evaluation counts per variable.
constexpr WindowResponse kRectangular = make_response(window(WindowKind::rectangular));
constexpr WindowResponse kHann = make_response(window(WindowKind::hann));
constexpr WindowResponse kHamming = make_response(window(WindowKind::hamming));
constexpr WindowResponse kBlackman = make_response(window(WindowKind::blackman));
}  // namespace

constinit const std::array<WindowResponse, 4> kWindowResponses{kRectangular, kHann, kHamming, kBlackman};

}  // namespace dsp
