// Expected values: thresholds from Rohling's product formula solved elsewhere in double precision; decisions
// by sorting; maxima by comparing all neighbours.
#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <vector>

#include "dsp/os_cfar.hpp"
#include "tests/bench/accuracy_dsp.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(OsCfar) {
    std::unique_ptr<dsp::PowerMap> map = std::make_unique<dsp::PowerMap>();
    dsp::CellMask hits;

    void setup() override {
        fill(9000);
    }
    void fill(std::uint16_t level) {
        for (auto& row : map->cell) row.fill(level);
    }
    int count_hits(const dsp::CfarConfig& config = {}) {
        const dsp::OsCfar cfar(config);
        hits = {};
        int count = 0;
        for (int r = config.first_range_cell; r < 32; ++r) {
            for (int d = 0; d < 64; ++d) {
                if (!cfar.detects(*map, r, d)) continue;
                hits.set(r, d);
                ++count;
            }
        }
        return count;
    }
};

TEST(OsCfar, ThresholdFactors) {
    struct {
        int cells, rank, ppb;
        double alpha;
    } const table[] = {
        {16, 12, 10'000'000, 4.425}, {16, 12, 1'000'000, 7.421}, {16, 12, 100'000, 11.080},
        {24, 18, 10'000'000, 4.025}, {24, 18, 1'000'000, 6.502}, {24, 18, 100'000, 9.341},
        {32, 24, 10'000'000, 3.838}, {32, 24, 1'000'000, 6.086}, {32, 24, 100'000, 8.580},
    };
    for (const auto& t : table) {
        DOUBLES_EQUAL(1024 * std::log2(t.alpha), dsp::os_cfar_alpha(t.cells, t.rank, t.ppb), 1);
    }
    // One reference cell: Pfa = 1/(1+alpha), in closed form.
    DOUBLES_EQUAL(1024 * std::log2(999.0), dsp::os_cfar_alpha(1, 1, 1'000'000), 1);
    DOUBLES_EQUAL(1024 * std::log2(999'999.0), dsp::os_cfar_alpha(1, 1, 1'000), 1);
}

TEST(OsCfar, ThresholdSolvesTheFormulaForEveryShape) {
    for (int cells = 1; cells <= dsp::kMaxReferenceCells; cells += cells < 8 ? 1 : 8) {
        for (int rank = 1; rank <= cells; rank += cells < 8 ? 1 : 3) {
            for (const int ppb : {1'000, 100'000, 100'000'000}) {
                const auto pfa = [&](double log2_alpha) {
                    double product = 1;
                    for (int i = 0; i < rank; ++i)
                        product *= (cells - i) / (cells - i + std::exp2(log2_alpha / 1024));
                    return product * 1e9;
                };
                const int alpha = dsp::os_cfar_alpha(cells, rank, ppb);
                CHECK(pfa(alpha - 1) >= ppb && pfa(alpha + 1) <= ppb);
            }
        }
    }
}

TEST(OsCfar, NoiseOffsetIsTheMeanOfTheOrderStatistic) {
    DOUBLES_EQUAL(0, dsp::os_cfar_noise_offset(1, 1), 0.6);
    double mean = 0;
    for (int i = 0; i < 12; ++i) mean += 1.0 / (20 - i);
    DOUBLES_EQUAL(-1024 * std::log2(mean), dsp::os_cfar_noise_offset(20, 12), 0.6);
}

TEST(OsCfar, TheSameDecisionsAsSorting) {
    for (const auto& row : bench::os_cfar_exactness(5)) CHECK_TEXT(row.met(), row.what.c_str());
}

TEST(OsCfar, TheNoiseLevelIsTheOrderStatisticAtEveryRank) {
    std::uint32_t state = 17;
    const auto random = [&state](unsigned below) {
        state = state * 1664525U + 1013904223U;
        return (state >> 8) % below;
    };
    std::vector<dsp::CfarConfig> shapes(3);  // the default, and others that take other paths
    shapes[1].doppler_guard = 0;
    shapes[2].range_reference = 1;
    for (const unsigned values : {65'536U, 6U}) {
        for (auto& row : map->cell) {
            for (auto& cell : row) cell = static_cast<std::uint16_t>(30'000 / values + random(values));
        }
        for (dsp::CfarConfig config : shapes) {
            for (std::int16_t rank = 1; rank <= config.reference_cells(); ++rank) {
                config.rank = rank;
                const dsp::OsCfar cfar(config);
                const int offset = dsp::os_cfar_noise_offset(config.reference_cells(), rank);
                for (int r = config.first_range_cell; r < 32; ++r) {
                    for (int d = 0; d < 64; ++d) {
                        std::vector<int> cells;
                        for (int i = 0; i < config.doppler_reference; ++i) {
                            const int distance = config.doppler_guard + 1 + config.spacing * i;
                            cells.push_back(map->at(r, d + distance));
                            cells.push_back(map->at(r, d - distance));
                        }
                        for (int i = 0; static_cast<int>(cells.size()) < config.reference_cells(); ++i) {
                            const int distance = config.range_guard + 1 + config.spacing * i;
                            if (r + distance < 32) cells.push_back(map->at(r + distance, d));
                            if (static_cast<int>(cells.size()) < config.reference_cells() &&
                                r - distance >= config.first_range_cell) {
                                cells.push_back(map->at(r - distance, d));
                            }
                        }
                        std::ranges::sort(cells);
                        const int selected = cells[static_cast<std::size_t>(rank - 1)];
                        const int noise = cfar.noise(*map, r, d);
                        CHECK(noise == std::max(selected + offset, 0));
                        CHECK(!cfar.detects(*map, r, d) || map->at(r, d) - noise >= cfar.least_snr());
                    }
                }
            }
        }
    }
}

TEST(OsCfar, ConstantAndEmptyMapsGiveNothing) {
    for (const int level : {0, 1, 9000, 65535}) {
        fill(static_cast<std::uint16_t>(level));
        LONGS_EQUAL(0, count_hits());
    }
    // Even where a lax design puts the threshold below the reference cells, nothing is not a target.
    fill(0);
    dsp::CfarConfig lax;
    lax.rank = static_cast<std::int16_t>(lax.reference_cells());
    lax.false_alarm_ppb = 100'000'000;
    lax.offset_cdb = -300;
    LONGS_EQUAL(0, count_hits(lax));
}

TEST(OsCfar, OneCellOverThresholdAnywhereIsFoundAndAloneAt) {
    const int threshold = dsp::OsCfar(dsp::CfarConfig{}).threshold();
    for (std::size_t r = 0; r < 32; ++r) {
        for (std::size_t d = 0; d < 64; d += 7) {
            fill(9000);
            map->cell[r][d] = static_cast<std::uint16_t>(9000 + threshold);
            LONGS_EQUAL(0, count_hits());
            ++map->cell[r][d];
            LONGS_EQUAL(r >= 2 ? 1 : 0, count_hits());
            LONGS_EQUAL(r >= 2, hits.test(static_cast<int>(r), static_cast<int>(d)));
        }
    }
}

TEST(OsCfar, TheOffsetMovesTheThreshold) {
    dsp::CfarConfig config;
    const int before = dsp::OsCfar(config).threshold();
    config.offset_cdb = 600;
    DOUBLES_EQUAL(before + 1024 * 0.6 * std::log2(10.0), dsp::OsCfar(config).threshold(), 1);
}

TEST(OsCfar, InvalidConfigurationsAreRecognised) {
    dsp::CfarConfig config;
    config.rank = 0;
    CHECK_FALSE(config.valid());
    config = {};
    config.rank = static_cast<std::int16_t>(config.reference_cells() + 1);
    CHECK_FALSE(config.valid());
    config = {};
    config.doppler_reference = 16;
    config.doppler_guard = 8;  // the two arms would meet behind the cell
    config.rank = 1;
    CHECK_FALSE(config.valid());
    config = {};
    config.false_alarm_ppb = 0;
    CHECK_FALSE(config.valid());
    config = {};
    config.offset_cdb = 2001;
    CHECK_FALSE(config.valid());
}

/// By its definition: over threshold, and no neighbour is larger or equal and later in memory.
dsp::CellMask peaks_by_definition(const dsp::PowerMap& map, const dsp::OsCfar& cfar) {
    dsp::CellMask peaks;
    for (int r = cfar.config().first_range_cell; r < 32; ++r) {
        for (int d = 0; d < 64; ++d) {
            bool peak = cfar.detects(map, r, d);
            for (int i = -1; i <= 1; ++i) {
                for (int j = -1; j <= 1; ++j) {
                    const int rr = r + i;
                    const int dd = (d + j + 64) % 64;
                    if ((i == 0 && j == 0) || rr < 0 || rr > 31) continue;
                    const int x = map.at(r, d);
                    const int y = map.at(rr, dd);
                    if (y > x || (y == x && 64 * rr + dd > 64 * r + d)) peak = false;
                }
            }
            if (peak) peaks.set(r, d);
        }
    }
    return peaks;
}

TEST(OsCfar, PeaksAreTheLocalMaximaOverThresholdWhateverTheLevel) {
    std::uint32_t state = 99;
    const auto random = [&state](unsigned below) {
        state = state * 1664525U + 1013904223U;
        return (state >> 8) % below;
    };
    std::vector<dsp::CfarConfig> shapes(7);
    shapes[1] = {1, 8, 2, 2, 2, 12, 0, 10'000'000, 0};   // even distance to the first reference cell
    shapes[2] = {0, 16, 0, 1, 1, 20, 5, 50'000'000, 0};  // every cell is a reference cell
    shapes[3] = {2, 8, 2, 0, 2, 12, 2, 1'000'000, 0};
    shapes[4] = {2, 4, 2, 2, 2, 8, 2, 10'000'000, 0};  // too few for the quick look
    shapes[5] = {2, 8, 2, 2, 2, 20, 2, 100'000'000, -300};
    shapes[6] = {3, 12, 2, 2, 2, 28, 1, 100'000'000, 0};  // rank N: a single large cell decides
    std::size_t found = 0;
    for (const auto& shape : shapes) {
        CHECK(shape.valid());
        const dsp::OsCfar cfar(shape);
        for (int kind = 0; kind < 6; ++kind) {
            for (auto& row : map->cell) {
                for (auto& cell : row) {
                    const double u = (random(1U << 20) + 0.5) / (1U << 20);
                    const double noise = 1024 * (20 + std::log2(-std::log(u)));
                    cell = static_cast<std::uint16_t>(kind == 0   ? random(60'000)
                                                      : kind == 1 ? random(3) * 20'000
                                                      : kind == 2 ? 65'535 - random(2)
                                                      : kind == 3 ? noise + (random(20) == 0 ? 12'000 : 0)
                                                                  : noise);
                }
            }
            const dsp::CellMask expected = peaks_by_definition(*map, cfar);
            for (const int level : {0, 1, 9'000, 18'000, 19'000, 20'000, 21'000, 40'000, 65'535}) {
                dsp::CellMask peaks;
                dsp::cfar_peaks(*map, cfar, static_cast<std::uint16_t>(level), peaks);
                for (std::size_t r = 0; r < 32; ++r) CHECK(expected.row[r] == peaks.row[r]);
            }
            for (const auto row : expected.row) found += static_cast<std::size_t>(std::popcount(row));
        }
    }
    CHECK(found > 1000);
}

TEST(OsCfar, RowsFullOfMaximaGiveThePeaksOfTheDefinition) {
    // Every second cell of every second row is a maximum or nearly so, and about as far over its reference
    // cells as the threshold: in a row as many decisions as there can be, two at once.
    std::uint32_t state = 7;
    const auto random = [&state](int below) {
        state = state * 1664525U + 1013904223U;
        return static_cast<int>(state >> 8) % below;
    };
    std::vector<dsp::CfarConfig> shapes(6);
    shapes[1] = {1, 8, 2, 2, 2, 12, 0, 10'000'000, 0};  // even distance to the first reference cell
    shapes[2] = {3, 12, 2, 2, 2, 20, 1, 10'000'000, 0};
    shapes[3] = {2, 9, 0, 0, 2, 10, 0, 1'000'000, 0};  // no reference cells along range
    shapes[4] = {2, 8, 3, 3, 2, 18, 2, 100'000'000, -300};
    shapes[5] = {2, 8, 2, 2, 1, 12, 2, 10'000'000, 0};  // neighbours that are reference cells
    std::size_t found = 0;
    std::size_t maxima = 0;
    for (const auto& shape : shapes) {
        CHECK(shape.valid());
        const dsp::OsCfar cfar(shape);
        for (int round = 0; round < 24; ++round) {
            const int odd = random(2);
            const int odd_row = random(2);
            const int low = round % 6 == 0 ? 0 : (round % 6 == 1 ? 65'535 - cfar.threshold() : 20'000);
            for (int r = 0; r < 32; ++r) {
                for (int d = 0; d < 64; ++d) {
                    const bool maximum = r % 2 == odd_row && d % 2 == odd && random(round % 5 + 2) != 0;
                    const int level =
                        low + (maximum ? cfar.threshold() + random(5) - 1 : random(round % 3 + 1));
                    map->cell[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)] =
                        static_cast<std::uint16_t>(std::clamp(level, 0, 65'535));
                    maxima += maximum ? 1 : 0;
                }
            }
            const dsp::CellMask expected = peaks_by_definition(*map, cfar);
            for (const int level : {0, low, 65'535}) {
                dsp::CellMask peaks;
                dsp::cfar_peaks(*map, cfar, static_cast<std::uint16_t>(level), peaks);
                for (std::size_t r = 0; r < 32; ++r) CHECK(expected.row[r] == peaks.row[r]);
            }
            for (const auto row : expected.row) found += static_cast<std::size_t>(std::popcount(row));
        }
    }
    CHECK(found > maxima / 10 && found < maxima * 9 / 10);
}

TEST(OsCfar, APlateauIsOnePeak) {
    fill(1000);
    for (std::size_t r = 10; r < 12; ++r) map->cell[r][30] = map->cell[r][31] = map->cell[r][32] = 40000;
    dsp::CellMask peaks;
    dsp::cfar_peaks(*map, dsp::OsCfar(dsp::CfarConfig{}), 1000, peaks);
    int count = 0;
    for (const auto row : peaks.row) count += std::popcount(row);
    LONGS_EQUAL(1, count);
    CHECK(peaks.test(11, 32));  // the last of the equals in memory
}
