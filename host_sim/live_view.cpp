#include "host_sim/live_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <unistd.h>

namespace sim {

namespace {

double number(dsp::Real v) {
    return tracking::scalar_from<double>(v);
}

template <class... Args>
std::string format(const char* pattern, Args... args) {
    std::array<char, 160> text{};
    const int length = std::snprintf(text.data(), text.size(), pattern, args...);
    return {text.data(), std::min(static_cast<std::size_t>(std::max(0, length)), text.size() - 1)};
}

const char* warning_name(tracking::WarningLevel level) {
    constexpr std::array<const char*, 4> kNames{"-", "INFORM", "WARN", "BRAKE"};
    return kNames[static_cast<std::size_t>(level)];
}

std::string faults(const CycleView& view) {
    std::string text;
    for (const auto& name : fault_names(view.radar.health().faults())) text += " " + name;
    return text.empty() ? "" : "  faults:" + text;
}

int confirmed(const CycleView& view) {
    const auto tracks = view.radar.tracks();
    return static_cast<int>(
        std::count_if(tracks.begin(), tracks.end(), [](const auto& t) { return t.is_confirmed(); }));
}

std::string head(const CycleView& view) {
    std::string text = format("%8.1f s  ", view.time_s);
    text += view.ego ? format("ego %5.1f m/s", view.ego->speed_mps) : "ego unknown";
    const auto& warning = view.radar.warning();
    text += format("  detections %2d  tracks %2d  warning %s", view.radar.detections().count, confirmed(view),
                   warning_name(warning.level));
    if (warning.level != tracking::WarningLevel::none && warning.time_to_collision_s)
        text += format(" (id %d in %.1f s)", static_cast<int>(warning.track_id),
                       number(*warning.time_to_collision_s));
    return text + faults(view);
}

}  // namespace

LiveView::LiveView(std::FILE* out, std::uint64_t frames)
    : out_(out), frames_(frames), terminal_(isatty(fileno(out)) != 0) {}

std::string LiveView::table(const CycleView& view, std::uint64_t frames) {
    std::string text = format("frame %llu of %llu\n", static_cast<unsigned long long>(view.frame + 1),
                              static_cast<unsigned long long>(frames));
    text += head(view) + "\n  id   range m        rate m/s       SNR dB  exists  state\n";
    for (const auto& t : view.radar.tracks()) {
        if (!t.is_confirmed()) continue;
        text +=
            format(" %3d  %7.2f +-%4.2f  %+7.2f +-%4.2f  %6.1f   %3.0f %%  %s\n", static_cast<int>(t.id),
                   number(t.x[0]), std::sqrt(std::max(0.0, number(t.covariance(0, 0)))), number(t.x[1]),
                   std::sqrt(std::max(0.0, number(t.covariance(1, 1)))), number(t.snr_db),
                   100 * number(t.existence), t.state == tracking::TrackState::coasting ? "coasting" : "");
    }
    return text;
}

void LiveView::redraw(const CycleView& view) {
    const std::string text = table(view, frames_);
    // Up over the last table, and clear to the end of the screen.
    if (lines_ > 0) std::fprintf(out_, "\x1b[%dA\x1b[J", lines_);
    std::fputs(text.c_str(), out_);
    std::fflush(out_);
    lines_ = static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

void LiveView::show(const CycleView& view) {
    if (terminal_) {
        const auto now = std::chrono::steady_clock::now();
        if (now < next_redraw_) return;
        next_redraw_ = now + std::chrono::milliseconds(50);
        redraw(view);
    } else if (view.frame >= next_line_) {
        // About ten lines a run, and not more than one a second.
        next_line_ = view.frame + std::max<std::uint64_t>(10, frames_ / 10);
        std::fprintf(out_, "%s\n", head(view).c_str());
        std::fflush(out_);
    }
}

void LiveView::finish(const CycleView& view) {
    if (terminal_) redraw(view);
}

}  // namespace sim
