/// One frame of beat signal, as the front end's DMA or a recording delivers it.
#pragma once

#include <array>
#include <cstdint>

#include "dsp/waveform.hpp"

namespace dsp {

/// 64 chirps x 64 real samples, two's complement ADC codes. In files: little-endian int16, [chirp][sample],
/// 8192 bytes. Aligned as loads of four samples need it.
struct alignas(4) BeatFrame {
    std::array<std::array<std::int16_t, kSamples>, kChirps> chirp{};
};
static_assert(sizeof(BeatFrame) == 8192);

}  // namespace dsp
