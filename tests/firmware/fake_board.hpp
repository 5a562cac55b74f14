/// A board in memory whose faults are chosen from an enum. Time is what the test says.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "can/transmitter.hpp"
#include "hal/contract/board.hpp"

namespace test {

enum class Fault {
    none,
    missing_frame,
    short_frame,
    sequence_gap,
    dead_adc,      ///< every sample the same
    stuck_adc,     ///< the same frame again
    stuck_chirp,   ///< one chirp repeated through the frame
    clipped,       ///< a tone far above the converter's range
    noise_only,    ///< front end alive, no echo at all
    interference,  ///< noise 20 dB up
    slow_cycle,    ///< acquiring takes two and a half periods
    can_down,      ///< every send fails
};

class FakeClock : public hal::Clock {
  public:
    std::uint64_t now_us() override { return time_us; }
    void wait_until(std::uint64_t t) override { time_us = t > time_us ? t : time_us; }
    std::uint64_t time_us = 0;
};

class FakeCan : public hal::CanPort {
  public:
    bool send(const can::Frame& frame) override {
        if (down) {
            ++counters_.dropped;
            return false;
        }
        ++counters_.sent;
        sent.push_back(frame);
        return true;
    }
    bool receive(can::Frame& frame) override {
        if (to_radar.empty()) return false;
        frame = to_radar.front();
        to_radar.pop_front();
        ++counters_.received;
        return true;
    }
    void begin_cycle() override {}
    hal::CanState state() override { return down ? hal::CanState::bus_off : hal::CanState::active; }
    hal::CanCounters counters() override { return counters_; }

    bool down = false;
    std::deque<can::Frame> to_radar;
    std::vector<can::Frame> sent;

  private:
    hal::CanCounters counters_;
};

/// One target of constant range and rate in noise; a fault replaces or spoils the frame.
class FakeFrontEnd : public hal::BeatSource {
  public:
    explicit FakeFrontEnd(FakeClock& clock) : clock_(clock) {}

    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        ++sequence_;
        if (fault == Fault::sequence_gap) sequence_ += 3;
        sequence = sequence_;
        if (fault == Fault::missing_frame) return hal::BeatResult::missing;
        if (fault == Fault::short_frame) return hal::BeatResult::invalid;
        if (fault == Fault::slow_cycle) clock_.time_us += 250'000;
        if (fault == Fault::stuck_adc && filled_) {
            frame = last_;
            return hal::BeatResult::ok;
        }
        const double amplitude =
            fault == Fault::noise_only ? 0.0 : (fault == Fault::clipped ? 9000.0 : echo_amplitude);
        const double noise = fault == Fault::interference ? 20.0 : 2.0;
        for (int k = 0; k < dsp::kChirps; ++k) {
            for (int n = 0; n < dsp::kSamples; ++n) {
                const double phase = 2.0 * M_PI * (range_cell * n + rate_cell * k) / 64.0;
                double v = amplitude * std::cos(phase) + noise * gaussian();
                if (fault == Fault::dead_adc) v = 12.0;
                v = std::fmin(2047.0, std::fmax(-2048.0, std::nearbyint(v)));
                frame.chirp[static_cast<std::size_t>(k)][static_cast<std::size_t>(n)] =
                    static_cast<std::int16_t>(v);
            }
            if (fault == Fault::stuck_chirp) frame.chirp[static_cast<std::size_t>(k)] = frame.chirp[0];
        }
        last_ = frame;
        filled_ = true;
        return hal::BeatResult::ok;
    }

    Fault fault = Fault::none;
    double echo_amplitude = 40.0;
    double range_cell = 10.0;
    double rate_cell = 0.0;

  private:
    /// Sum of twelve uniforms: near enough to a Gaussian for a fake.
    double gaussian() {
        double sum = -6.0;
        for (int i = 0; i < 12; ++i) {
            state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
            sum += static_cast<double>(state_ >> 40) / 16777216.0;
        }
        return sum;
    }

    FakeClock& clock_;
    std::uint64_t state_ = 1;
    std::uint32_t sequence_ = 0;
    dsp::BeatFrame last_{};
    bool filled_ = false;
};

class FakeWatchdog : public hal::Watchdog {
  public:
    void start() override { started = true; }
    void kick() override { ++kicks; }
    bool started = false;
    int kicks = 0;
};

class FakeConsole : public hal::Console {
  public:
    void line(std::string_view text) override { lines.emplace_back(text); }
    int read() override { return -1; }
    std::vector<std::string> lines;
};

struct FakeBoard {
    FakeClock clock;
    FakeFrontEnd front_end{clock};
    FakeCan can;
    FakeWatchdog watchdog;
    FakeConsole console;
    can::Transmitter car;  ///< the other node on the bus

    hal::Board board() { return {front_end, can, clock, watchdog, console}; }
    void send_ego(int speed_mmps) { can.to_radar.push_back(car.frame(can::EgoMotion{speed_mmps, 0, true})); }
};

}  // namespace test
