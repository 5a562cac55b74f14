/// Loops written out, which gcc does at -O3 only.
#pragma once

#include <cstddef>
#include <utility>

namespace dsp {

/// body(0), body(kStep), .. below kEnd, kTimes of them in each round of a loop.
template <std::size_t kEnd, std::size_t kStep, std::size_t kTimes, class Body>
inline void unrolled(Body body) {
    static_assert(kEnd % (kStep * kTimes) == 0);
    for (std::size_t i = 0; i < kEnd; i += kStep * kTimes) {
        [&]<std::size_t... kIndex>(std::index_sequence<kIndex...>) {
            (body(i + kStep * kIndex), ...);
        }
        (std::make_index_sequence<kTimes>{});
    }
}

}  // namespace dsp
