#include "tests/bench/peer_kissfft16.hpp"

#include <array>
#include <cstddef>
#include <kiss_fft.h>
#include <stdexcept>

namespace bench {

void kissfft16(const dsp::Spectrum64& in, dsp::Spectrum64& out) {
    alignas(16) static std::array<std::byte, 2048> memory;
    static std::size_t size = memory.size();
    static kiss_fft_cfg state = kiss_fft_alloc(dsp::kFftLength, 0, memory.data(), &size);
    if (state == nullptr) throw std::runtime_error("KissFFT needs more memory than it is given");
    static_assert(sizeof(kiss_fft_cpx) == sizeof(dsp::Complex16));
    kiss_fft(state, reinterpret_cast<const kiss_fft_cpx*>(in.data()),
             reinterpret_cast<kiss_fft_cpx*>(out.data()));
}

}  // namespace bench
