/// OS-CFAR by its definition: gather the reference cells, select the k-th smallest, compare. What the one in
/// dsp/ is compared with, on the PC and on the boards.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "dsp/os_cfar.hpp"

namespace bench {

/// Tests all cells. `select(first, kth, last)` puts the k-th smallest reference cell in its place: by
/// sorting, or less.
template <class Select>
void os_cfar_by_selection(const dsp::PowerMap& map, const dsp::OsCfar& cfar, dsp::CellMask& hits,
                          Select select) {
    const dsp::CfarConfig& config = cfar.config();
    hits = {};
    for (int r = config.first_range_cell; r < dsp::kRangeCells; ++r) {
        for (int d = 0; d < dsp::kDopplerCells; ++d) {
            std::array<std::uint16_t, dsp::kMaxReferenceCells> cell;
            std::size_t count = 0;
            for (int i = 0; i < config.doppler_reference; ++i) {
                const int distance = config.doppler_guard + 1 + config.spacing * i;
                cell[count++] = map.at(r, d + distance);
                cell[count++] = map.at(r, d - distance);
            }
            int missing = 2 * config.range_reference;
            for (int distance = config.range_guard + 1; missing > 0; distance += config.spacing) {
                for (const int at : {r + distance, r - distance}) {
                    if (missing == 0 || at < config.first_range_cell || at >= dsp::kRangeCells) continue;
                    cell[count++] = map.at(at, d);
                    --missing;
                }
            }
            const auto kth = cell.begin() + config.rank - 1;
            select(cell.begin(), kth, cell.begin() + static_cast<std::ptrdiff_t>(count));
            if (map.at(r, d) > *kth + cfar.threshold()) hits.set(r, d);
        }
    }
}

}  // namespace bench
