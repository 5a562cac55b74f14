/// The 16-bit variant of KissFFT, in a file of its own because the float variant has the same names.
#pragma once

#include "dsp/fft64.hpp"

namespace bench {

/// out = transform of in / 64.
void kissfft16(const dsp::Spectrum64& in, dsp::Spectrum64& out);

}  // namespace bench
