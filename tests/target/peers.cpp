// What others need on this board for what ours does: see bench.hpp. Exit code 0: measured.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#ifdef RADAR_HAS_KISSFFT16
#include <kiss_fft.h>
#endif

#include "dsp/os_cfar.hpp"
#include "tests/bench/os_cfar_by_selection.hpp"
#include "tests/target/bench.hpp"
#include "tests/target/semihosting.hpp"

namespace {

using target::measure;

dsp::PowerMap map;
dsp::CellMask hits;

void measure_os_cfar() {
    std::uint32_t state = 1;
    for (auto& row : map.cell) {
        for (auto& cell : row) {
            state = state * 1664525U + 1013904223U;
            cell = static_cast<std::uint16_t>(20'000 + (state >> 20));
        }
    }
    const dsp::OsCfar cfar{dsp::CfarConfig{}};
    measure("peer.os_cfar.sort", 4, [&](std::uint32_t) {
        bench::os_cfar_by_selection(map, cfar, hits,
                                    [](auto first, auto, auto last) { std::sort(first, last); });
    });
    measure("peer.os_cfar.nth_element", 4, [&](std::uint32_t) {
        bench::os_cfar_by_selection(
            map, cfar, hits, [](auto first, auto kth, auto last) { std::nth_element(first, kth, last); });
    });
}

#ifdef RADAR_HAS_KISSFFT16
void measure_kissfft() {
    alignas(8) static std::array<std::byte, 1024> memory;
    static std::array<kiss_fft_cpx, 64> in;
    static std::array<kiss_fft_cpx, 64> out;
    std::size_t size = memory.size();
    const kiss_fft_cfg state = kiss_fft_alloc(64, 0, memory.data(), &size);
    if (state == nullptr) semihosting::exit(1);
    for (std::size_t n = 0; n < in.size(); ++n) {
        in[n].r = static_cast<std::int16_t>(n * 7919);
        in[n].i = static_cast<std::int16_t>(n * 104'729);
    }
    measure("peer.kissfft16", 64, [&](std::uint32_t) { kiss_fft(state, in.data(), out.data()); });
}
#else
void measure_kissfft() {}
#endif

}  // namespace

/// KissFFT refers to the heap; given its memory, it does not use it.
extern "C" void* _sbrk(std::ptrdiff_t) {
    return nullptr;
}

int main() {
    target::start_bench();
    measure_os_cfar();
    measure_kissfft();
    semihosting::exit(0);
}
