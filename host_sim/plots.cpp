#include "host_sim/plots.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <system_error>

#include "host_sim/gnuplot.hpp"

namespace sim {

namespace {

constexpr int kWidth = 1400;
constexpr int kHeight = 1000;

std::string without_markup(const std::string& text) {
    std::string plain;
    for (const char c : text) plain += c == '"' || c == '\'' || c == '\\' ? ' ' : c;
    return plain;
}

std::ofstream create(const std::filesystem::path& file) {
    std::ofstream out(file);
    if (!out) throw InputError(file.string() + ": cannot be created");
    return out;
}

}  // namespace

Plots::Plots(std::filesystem::path directory, std::string title, const dsp::Waveform& waveform,
             std::uint64_t frames)
    : directory_(std::move(directory)),
      title_(without_markup(title)),
      waveform_(waveform),
      map_frame_(frames / 2) {
    require_gnuplot();
    std::error_code error;
    std::filesystem::create_directories(directory_, error);
    if (error) throw InputError(directory_.string() + ": cannot be created: " + error.message());
}

void Plots::add(const CycleView& view) {
    const double t = view.time_s;
    for (const TruthObject& o : view.truth) truth_[o.id].push_back({t, o.range_m, o.range_rate_mps});
    for (const auto& track : view.radar.tracks()) {
        if (!track.is_confirmed()) continue;
        tracks_[track.id].push_back(
            {t, tracking::scalar_from<double>(track.x[0]), tracking::scalar_from<double>(track.x[1])});
    }
    const bool take_map = view.map != nullptr && (!has_map_ || view.frame == map_frame_);
    if (take_map) {
        has_map_ = true;
        map_ = *view.map;
        map_time_s_ = t;
        map_peaks_.clear();
    }
    for (const dsp::Detection& d : view.radar.detections().view()) {
        detections_.push_back(
            {t, tracking::scalar_from<double>(d.range_m), tracking::scalar_from<double>(d.range_rate_mps)});
        if (take_map) map_peaks_.emplace_back(d.range_cell, d.doppler_cell);
    }
}

void Plots::write_lines(const char* file, const Lines& lines) const {
    auto out = create(directory_ / file);
    const double pause_s = 1.5 * waveform_.period_ms / 1000;
    out << "# time_s range_m range_rate_mps id\n";
    for (const auto& [id, points] : lines) {
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (i > 0 && points[i].time_s - points[i - 1].time_s > pause_s) out << "\n";
            out << points[i].time_s << ' ' << points[i].range_m << ' ' << points[i].range_rate_mps << ' '
                << id << '\n';
        }
        out << "\n";
    }
    // gnuplot refuses a file without a single point.
    if (lines.empty()) out << "NaN NaN NaN 0\n";
}

std::vector<std::filesystem::path> Plots::draw() const {
    write_lines("truth.dat", truth_);
    write_lines("tracks.dat", tracks_);
    {
        auto out = create(directory_ / "detections.dat");
        out << "# time_s range_m range_rate_mps\n";
        for (const Point& p : detections_)
            out << p.time_s << ' ' << p.range_m << ' ' << p.range_rate_mps << '\n';
        if (detections_.empty()) out << "NaN NaN NaN\n";
    }
    const double range_cell = static_cast<double>(waveform_.range_cell_um()) * 1e-6;
    const double range_0 = static_cast<double>(waveform_.range_offset_um) * 1e-6;
    const double rate_cell = static_cast<double>(waveform_.rate_cell_umps()) * 1e-6;
    const double coupling = static_cast<double>(waveform_.coupling_ns()) * 1e-9;
    const double range_end = range_0 + dsp::kRangeCells * range_cell;
    const double rate_end = dsp::kDopplerCells / 2 * rate_cell;

    std::ostringstream tracks;
    tracks << "set multiplot layout 2,1 title '" << title_ << "' noenhanced\n"
           << "set grid lc rgb '#dddddd'\nset key outside right top\nset lmargin 9\n"
           << "set palette maxcolors 12 defined (0 '#d62728', 1 '#1f77b4', 2 '#2ca02c', 3 '#9467bd', 4 "
              "'#ff7f0e', 5 '#17becf', "
              "6 '#8c564b', 7 '#e377c2', 8 '#bcbd22', 9 '#393b79', 10 '#637939', 11 '#843c39')\n"
           << "unset colorbox\nset cbrange [0:12]\n";
    const auto panel = [&tracks](const char* label, int column, double low, double high) {
        tracks << "set xlabel 'time / s'\nset ylabel '" << label << "'\nset yrange [" << low << ":" << high
               << "]\n"
               << "plot 'detections.dat' using 1:" << column
               << " with points pt 7 ps 0.5 lc rgb '#909090' title 'detections', "
               << "'tracks.dat' using 1:" << column
               << ":(int($4)%12) with lines lw 4 lc palette title 'tracks', "
               << "'truth.dat' using 1:" << column
               << " with lines lw 1 dt (6,6) lc rgb '#000000' title 'truth'\n";
    };
    // The rates that occur fill the picture; range is shown to the end of the map.
    double slowest = rate_end;
    double fastest = -rate_end;
    for (const Lines* lines : {&truth_, &tracks_}) {
        for (const auto& [id, points] : *lines) {
            for (const Point& p : points) {
                slowest = std::min(slowest, p.range_rate_mps);
                fastest = std::max(fastest, p.range_rate_mps);
            }
        }
    }
    if (slowest > fastest) std::swap(slowest, fastest);
    const double margin = std::max(0.15 * (fastest - slowest), rate_cell);
    panel("range / m", 2, range_0, range_end);
    panel("range rate / (m/s)", 3, slowest - margin, fastest + margin);
    tracks << "unset multiplot\n";
    std::vector<std::filesystem::path> pictures{
        run_gnuplot(directory_, "tracks", tracks.str(), kWidth, kHeight)};
    if (!has_map_) return pictures;

    {
        auto out = create(directory_ / "range_doppler.dat");
        out << "# range_m range_rate_mps power_db (range before the range-Doppler coupling is removed)\n";
        constexpr double kDbPerCount = 3.0103 / 1024;
        for (int r = 0; r < dsp::kRangeCells; ++r) {
            for (int d = -dsp::kDopplerCells / 2; d < dsp::kDopplerCells / 2; ++d) {
                const auto power = map_.cell[static_cast<std::size_t>(r)]
                                            [static_cast<std::size_t>(d & (dsp::kDopplerCells - 1))];
                out << range_0 + r * range_cell << ' ' << d * rate_cell << ' ' << power * kDbPerCount << '\n';
            }
            out << '\n';
        }
        auto peaks = create(directory_ / "range_doppler_detections.dat");
        for (const auto& [r, d] : map_peaks_)
            peaks << range_0 + r * range_cell << ' '
                  << (d < dsp::kDopplerCells / 2 ? d : d - dsp::kDopplerCells) * rate_cell << '\n';
        if (map_peaks_.empty()) peaks << "NaN NaN\n";
    }
    std::ostringstream map;
    map << "set title '" << title_ << ": range-Doppler map at " << map_time_s_ << " s' noenhanced\n"
        << "set xlabel 'range rate / (m/s)'\nset ylabel 'range / m (apparent: true + "
        << std::round(coupling * 1e4) / 10 << " ms x range rate)'\n"
        << "set cblabel 'power / dB'\nset cbrange [15:*]\nset xrange [" << -rate_end - rate_cell / 2 << ":"
        << rate_end - rate_cell / 2 << "]\n"
        << "set yrange [" << range_0 - range_cell / 2 << ":" << range_end - range_cell / 2 << "]\n"
        << "set palette defined (0 '#000022', 1 '#1b3a7a', 2 '#2a8a8a', 3 '#a8c84a', 4 '#ffe94a', 5 "
           "'#ffffff')\n"
        << "set key outside top right\n"
        << "plot 'range_doppler.dat' using 2:1:3 with image notitle, "
        << "'range_doppler_detections.dat' using 2:1 with points pt 6 ps 2.4 lw 2 lc rgb '#ff3030' title "
           "'detections'\n";
    pictures.push_back(run_gnuplot(directory_, "range_doppler", map.str(), kWidth, kHeight));
    return pictures;
}

}  // namespace sim
