/// Pictures of a run, drawn by gnuplot.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "host_sim/simulation.hpp"

namespace sim {

class Plots {
  public:
    /// Creates the directory. Throws InputError when that fails or gnuplot is not installed, before anything
    /// is run.
    Plots(std::filesystem::path directory, std::string title, const dsp::Waveform& waveform,
          std::uint64_t frames);

    void add(const CycleView& view);

    /// Draws tracks.png (range and range rate over time: truth, detections, tracks; after Lee and Kim 2000,
    /// figure 15) and range_doppler.png (the map half way through the run, with its detections). The numbers
    /// stay beside them as .dat files, the commands as .gp. Returns the pictures' paths. Throws InputError
    /// when gnuplot fails.
    std::vector<std::filesystem::path> draw() const;

  private:
    struct Point {
        double time_s;
        double range_m;
        double range_rate_mps;
    };
    using Lines = std::map<int, std::vector<Point>>;  ///< by id; a pause in time breaks a line
    void write_lines(const char* file, const Lines& lines) const;

    std::filesystem::path directory_;
    std::string title_;
    dsp::Waveform waveform_;
    std::uint64_t map_frame_;
    Lines truth_;
    Lines tracks_;
    std::vector<Point> detections_;
    double map_time_s_ = 0;
    bool has_map_ = false;
    dsp::PowerMap map_{};
    std::vector<std::pair<int, int>> map_peaks_;  ///< range and Doppler cell of the detections in map_
};

}  // namespace sim
