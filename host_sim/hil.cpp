#include "host_sim/hil.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <sstream>
#include <thread>
#include <utility>

#include "can/codec.hpp"
#include "can/signals.hpp"
#include "can/transmitter.hpp"
#include "hal/common/beat_link.hpp"
#include "hal/host/candump_log.hpp"
#include "hal/host/frame_file_source.hpp"
#include "hal/host/serial_port.hpp"
#include "hal/host/socket_can.hpp"
#include "host_sim/beat_synthesis.hpp"
#include "host_sim/traffic.hpp"
#include "host_sim/world.hpp"

namespace sim {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::uint64_t kRestartLists = 6;
constexpr int kRestartAttempts = 8;
constexpr int kLostInARow = 3;  ///< then the board takes no frames at all
/// From the end of a packet to the start of the next: the time in which a board need not look at the line.
constexpr std::chrono::microseconds kGap{dsp::kDefaultWaveform.period_ms * 1000 -
                                         std::int64_t{hal::kBeatPacketBytes} * 10 * 1'000'000 /
                                             hal::kBeatLinkBaud};

template <class T>
std::unique_ptr<T> opened_or_throw(hal::Opened<T> opened) {
    if (!opened.value) throw InputError(opened.error);
    return std::move(opened.value);
}

double to_ms(Clock::duration duration) {
    return std::chrono::duration<double, std::milli>(duration).count();
}

/// What goes to the board, frame by frame.
class Scene {
  public:
    explicit Scene(const SimulationOptions& o) {
        if (!o.detections.empty())
            throw InputError("--hil: detections have no beat frames to send to a board");
        if (!o.ego.empty()) ego_speed_ = read_ego_speed(o.ego);
        if (!o.replay.empty()) {
            recording_ = std::make_unique<hal::FrameFileSource>(o.replay);
            frames_ = recording_->frames();
        } else {
            if (o.scenario) {
                world_.emplace(*o.scenario, o.seed);
            } else {
                world_.emplace(Scenario{}, o.seed, read_traffic(o.traffic), ego_speed_);
            }
            const Scenario& scenario = world_->scenario();
            check(scenario.waveform);
            synthesis_.emplace(scenario.waveform, scenario.front_end, o.seed);
            frames_ = world_->frames();
        }
        if (o.waveform) check(*o.waveform);
        if (o.frames) frames_ = std::min(frames_, *o.frames);
        from_scenario_ = o.scenario.has_value();
    }

    [[nodiscard]] std::uint64_t frames() const { return frames_; }

    void beat(std::uint64_t index, dsp::BeatFrame& frame) {
        if (recording_) {
            std::uint32_t sequence = 0;
            if (recording_->acquire(frame, sequence) != hal::BeatResult::ok)
                throw InputError("the recording cannot be read");
        } else {
            synthesis_->synthesise(world_->echoes(index), world_->bursts(index), index, frame);
        }
    }

    [[nodiscard]] std::optional<can::EgoMotion> ego(std::uint64_t index) const {
        const double time_s = static_cast<double>(index) * dsp::kDefaultWaveform.period_ms / 1000;
        Ego ego;
        if (from_scenario_) {
            ego = world_->ego_at(time_s);
        } else if (!ego_speed_.empty()) {
            ego.speed_mps = speed_at(ego_speed_, time_s);
            ego.acceleration_mps2 = (ego.speed_mps - speed_at(ego_speed_, time_s - 0.1)) / 0.1;
        } else {
            return std::nullopt;
        }
        return can::EgoMotion{
            .speed_mmps = static_cast<std::int32_t>(std::lround(ego.speed_mps * 1000)),
            .acceleration_mmps2 = static_cast<std::int32_t>(std::lround(ego.acceleration_mps2 * 1000)),
            .valid = true};
    }

  private:
    /// A board's image has its waveform built in.
    static void check(const dsp::Waveform& waveform) {
        const dsp::Waveform& board = dsp::kDefaultWaveform;
        if (waveform.range_cell_um() != board.range_cell_um() ||
            waveform.rate_cell_umps() != board.rate_cell_umps() ||
            waveform.coupling_ns() != board.coupling_ns() ||
            waveform.range_offset_um != board.range_offset_um || waveform.period_ms != board.period_ms)
            throw InputError(
                "--hil: the board's image is built for the standard waveform, this input has another");
    }

    std::optional<World> world_;
    std::optional<BeatSynthesis> synthesis_;
    std::unique_ptr<hal::FrameFileSource> recording_;
    std::vector<SpeedSample> ego_speed_;
    std::uint64_t frames_ = 0;
    bool from_scenario_ = false;
};

struct Heard {
    can::Frame frame;
    Clock::time_point time;
};

/// Reads the bus in a thread of its own, so that the times are true while the serial line is being written
/// to.
class Listener {
  public:
    explicit Listener(const std::string& interface_name)
        : port_(opened_or_throw(hal::SocketCan::open(interface_name))), thread_([this] { listen(); }) {}
    ~Listener() {
        stop_ = true;
        thread_.join();
    }
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    /// The next frame, if one comes until then.
    std::optional<Heard> next(Clock::time_point until) {
        std::unique_lock lock(mutex_);
        if (!arrived_.wait_until(lock, until, [this] { return !queue_.empty(); })) return std::nullopt;
        Heard heard = queue_.front();
        queue_.pop_front();
        return heard;
    }
    [[nodiscard]] std::uint64_t overflow() const { return overflow_; }

  private:
    static constexpr int kLook_ms = 20;

    void listen() {
        while (!stop_) {
            port_->begin_cycle();  // opens an interface that went down again
            port_->wait_for_frame(kLook_ms);
            can::Frame frame;
            while (port_->receive(frame)) {
                const std::scoped_lock lock(mutex_);
                queue_.push_back({frame, Clock::now()});
                arrived_.notify_one();
            }
            overflow_ = port_->counters().receive_overflow;
        }
    }

    std::unique_ptr<hal::SocketCan> port_;
    std::mutex mutex_;
    std::condition_variable arrived_;
    std::deque<Heard> queue_;
    std::atomic<std::uint64_t> overflow_ = 0;
    std::atomic<bool> stop_ = false;
    std::thread thread_;
};

class Session {
  public:
    Session(const SimulationOptions& simulation, const HilOptions& options,
            const std::function<void(const HilReport&)>& progress)
        : scene_(simulation), options_(options), progress_(progress), interface_(simulation.bus) {
        if (interface_ == kLoopback)
            throw InputError("--hil: name the CAN interface the board is connected to with --can");
        if (!simulation.log.empty())
            log_ = opened_or_throw(hal::CandumpWriter::open(simulation.log.string(), interface_));
        serial_ = opened_or_throw(hal::SerialPort::open(options.serial, hal::kBeatLinkBaud));
        car_port_ = opened_or_throw(hal::SocketCan::open(interface_));
        listener_ = std::make_unique<Listener>(interface_);
        const auto now = std::chrono::system_clock::now().time_since_epoch();
        sequence_ = static_cast<std::uint32_t>(std::chrono::duration_cast<milliseconds>(now).count() / 10);
    }

    HilReport run() {
        hear_board();
        restart_board();
        if (options_.lockstep) {
            lockstep();
        } else {
            real_time();
        }
        finish();
        return report_;
    }

  private:
    static constexpr std::chrono::milliseconds kPeriod{dsp::kDefaultWaveform.period_ms};

    std::optional<Heard> next_frame(Clock::time_point until) {
        auto heard = listener_->next(until);
        if (heard && log_) {
            const auto since_start =
                std::chrono::duration_cast<std::chrono::microseconds>(heard->time - start_);
            log_->write(static_cast<std::uint64_t>(std::max<std::int64_t>(since_start.count(), 0)),
                        heard->frame);
        }
        return heard;
    }

    void hear_board() {
        const auto until = Clock::now() + options_.patience;
        while (const auto heard = next_frame(until)) {
            if (can::status::kMessage.has(heard->frame.id)) return;
        }
        throw InputError(
            "nothing is heard from a radar on " + interface_ +
            " (status 0x400 every 0.1 s): is the board powered and running, the bus terminated at both "
            "ends, and the bit rate 500 kbit/s?");
    }

    /// Ends with the board's first list after the restart under way to the twin.
    void restart_board() {
        std::vector<can::Frame> commands;  // command i has sequence i
        std::vector<Heard> list;
        for (int attempt = 0; attempt < kRestartAttempts; ++attempt) {
            commands.push_back(car_.frame(can::Command{.code = can::CommandCode::restart,
                                                       .sequence = static_cast<std::uint8_t>(attempt)}));
            send_to_bus(commands.back());
            for (std::uint64_t lists = 0; lists <= kRestartLists;) {
                const auto heard = next_frame(Clock::now() + options_.patience);
                if (!heard) break;
                if (can::status::kMessage.has(heard->frame.id)) {
                    list.clear();
                    ++lists;
                }
                list.push_back(*heard);
                can::CommandEcho echo;
                if (!can::decode(heard->frame, echo) || echo.code != can::CommandCode::restart ||
                    echo.result != can::CommandResult::applied || echo.sequence >= commands.size() ||
                    !can::status::kMessage.has(list.front().frame.id))
                    continue;
                // Commands sent after the one that is answered restart the board, and the twin, once more.
                for (std::size_t i = echo.sequence; i < commands.size(); ++i) twin_.bus_sent(commands[i]);
                for (const Heard& h : list) take(h);
                return;
            }
        }
        throw InputError("the board on " + interface_ +
                         " does not answer the command restart: does its firmware speak " +
                         "this version of can/radar.dbc, and do frames from this PC reach the bus?");
    }

    void send_to_bus(const can::Frame& frame) {
        car_port_->begin_cycle();
        if (!car_port_->send(frame))
            throw InputError("a frame could not be sent on " + interface_ + ": " +
                             (car_port_->problem().empty() ? "its queue is full; is anybody else on the bus?"
                                                           : car_port_->problem()));
    }

    void send_frame(std::uint64_t index) {
        scene_.beat(index, frame_);
        if (const auto ego = scene_.ego(index)) {
            const can::Frame frame = car_.frame(*ego);
            twin_.bus_sent(frame);
            send_to_bus(frame);
        }
        ++sequence_;
        hal::encode_beat_packet(frame_, sequence_, packet_);
        switch (serial_->write(packet_, static_cast<int>(options_.patience.count()))) {
            case hal::SerialResult::ok:
                break;
            case hal::SerialResult::timeout:
                throw InputError("serial line " + options_.serial + ": the board takes no bytes");
            case hal::SerialResult::failed:
                throw InputError("serial line " + options_.serial +
                                 ": closed by the other end, or unplugged");
        }
        complete_at_ = Clock::now();
        complete_[sequence_] = complete_at_;
        twin_.beat_sent(sequence_, frame_);
        ++report_.frames_sent;
    }

    /// A frame to the twin, and its verdict to the report.
    void take(const Heard& heard) {
        const bool starts_list = can::status::kMessage.has(heard.frame.id);
        if (const auto verdict = twin_.receive(heard.frame))
            note(*verdict, starts_list ? last_heard_ : heard.time);
        if (can::status::kMessage.id <= heard.frame.id && heard.frame.id < can::ego::kMessage.id)
            last_heard_ = heard.time;
    }

    void note(const ListVerdict& verdict, Clock::time_point last_frame) {
        ++verdicts_;
        if (!verdict.identical && report_.differences.size() < HilReport::kMaxDifferences)
            report_.differences.push_back("list " + std::to_string(twin_.counters().lists) + ", " +
                                          verdict.difference);
        if (verdict.beat == hal::BeatResult::ok) {
            processed_ = verdict.sequence;
            const auto sent = complete_.find(verdict.sequence);
            if (sent != complete_.end())
                latencies_ms_.push_back(std::max(0.0, to_ms(last_frame - sent->second)));
            complete_.erase(complete_.begin(), complete_.upper_bound(verdict.sequence));
        }
        report_.board = twin_.counters();
        progress_(report_);
    }

    [[nodiscard]] bool too_different() const { return report_.board.different >= HilReport::kMaxDifferences; }

    /// Takes frames until `done()` or the time. False: time is up.
    template <class Done>
    bool pump(Clock::time_point until, Done done) {
        while (!done()) {
            const auto heard = next_frame(until);
            if (!heard) return false;
            take(*heard);
        }
        return true;
    }

    /// The same, for as long as a frame may take to be answered.
    template <class Done>
    bool pump_patiently(Done done) {
        return pump(Clock::now() + options_.patience, done);
    }

    [[nodiscard]] bool silent() const { return Clock::now() > last_heard_ + options_.patience; }
    [[nodiscard]] bool hopeless() const { return too_different() || report_.fell_silent; }

    void await_list() {
        const std::uint64_t before = verdicts_;
        pump_patiently([&] { return verdicts_ != before; });
    }

    void lockstep() {
        await_list();
        int lost = 0;
        for (std::uint64_t i = 0; i < scene_.frames() && lost < kLostInARow && !hopeless(); ++i) {
            pump(complete_at_ + kGap, [] { return false; });
            send_frame(i);
            // A cycle with a damaged frame can only have had this one.
            const std::uint64_t damaged = report_.board.invalid;
            pump_patiently([&] {
                return processed_ == sequence_ || report_.board.invalid != damaged || too_different();
            });
            lost = processed_ == sequence_ ? 0 : lost + 1;
            report_.fell_silent = silent();
        }
    }

    void real_time() {
        await_list();
        const auto start = Clock::now();
        for (std::uint64_t i = 0; i < scene_.frames() && !hopeless(); ++i) {
            const auto due = start + static_cast<Clock::rep>(i) * kPeriod;
            if (Clock::now() > due + kPeriod / 2) ++report_.late_sends;
            pump(due, [] { return false; });
            report_.fell_silent = silent();
            if (!hopeless()) send_frame(i);
        }
    }

    void finish() {
        if (!hopeless()) pump_patiently([this] { return twin_.outstanding() == 0 || too_different(); });
        if (const auto verdict = twin_.give_up_list()) note(*verdict, last_heard_);
        report_.board = twin_.counters();
        report_.frames_lost = report_.frames_sent - report_.board.processed;
        report_.can_overflow = listener_->overflow();
        if (!latencies_ms_.empty()) {
            std::sort(latencies_ms_.begin(), latencies_ms_.end());
            const auto count = latencies_ms_.size();
            report_.latency_ms = {.min = latencies_ms_.front(),
                                  .mean = std::accumulate(latencies_ms_.begin(), latencies_ms_.end(), 0.0) /
                                          static_cast<double>(count),
                                  .p99 = latencies_ms_[(count * 99 + 99) / 100 - 1],
                                  .max = latencies_ms_.back()};
        }
        if (log_) {
            if (const std::string problem = log_->flush(); !problem.empty()) throw InputError(problem);
        }
    }

    Scene scene_;
    HilOptions options_;
    const std::function<void(const HilReport&)>& progress_;
    std::string interface_;
    std::unique_ptr<hal::CandumpWriter> log_;
    std::unique_ptr<hal::SerialPort> serial_;
    std::unique_ptr<hal::SocketCan> car_port_;
    std::unique_ptr<Listener> listener_;
    BoardTwin twin_{firmware::radar_config(dsp::kDefaultWaveform)};
    can::Transmitter car_;
    dsp::BeatFrame frame_{};
    hal::BeatPacket packet_{};
    std::uint32_t sequence_ = 0;                           ///< of the last packet
    std::optional<std::uint32_t> processed_;               ///< newest packet that is in a list
    std::map<std::uint32_t, Clock::time_point> complete_;  ///< when a packet had left the PC
    Clock::time_point complete_at_;                        ///< of the last one
    Clock::time_point start_ = Clock::now();
    Clock::time_point last_heard_;
    std::uint64_t verdicts_ = 0;
    std::vector<double> latencies_ms_;
    HilReport report_;
};

}  // namespace

HilReport run_hil(const SimulationOptions& simulation, const HilOptions& options,
                  const std::function<void(const HilReport&)>& progress) {
    try {
        return Session(simulation, options, progress).run();
    } catch (const hal::FrameFileError& e) {
        throw InputError(e.what());
    }
}

std::string to_text(const HilReport& r) {
    std::ostringstream text;
    text.setf(std::ios::fixed);
    text.precision(1);
    text << "beat frames    " << r.frames_sent << " sent, " << r.board.processed << " processed, "
         << r.frames_lost << " lost\n"
         << "lists          " << r.board.lists << " compared, " << r.board.different << " different; "
         << r.board.missing << " without a frame, " << r.board.invalid << " with a damaged one, "
         << r.board.overruns << " late\n"
         << "CAN frames     " << r.board.can_frames << " from the board";
    if (r.can_overflow != 0) text << ", " << r.can_overflow << " lost by this PC";
    text << "\nlatency        " << r.latency_ms.min << " / " << r.latency_ms.mean << " / " << r.latency_ms.p99
         << " / " << r.latency_ms.max << " ms (min / mean / 99 % / max), frame complete to last CAN frame\n";
    if (r.late_sends != 0)
        text << "late           " << r.late_sends << " frames went out late: the line was still busy\n";
    for (const std::string& difference : r.differences) text << "different      " << difference << '\n';
    text << "verdict        "
         << (r.identical()            ? "identical"
             : r.board.different != 0 ? "DIFFERENT"
                                      : "FRAMES LOST, all else identical")
         << '\n';
    if (r.fell_silent) {
        text << "               the board fell silent: power, reset or bus fault? Its console tells why the "
                "last run ended\n";
    } else if (r.frames_sent != 0 && r.board.processed == 0) {
        text << "               no beat frame reached the board: is this the serial line of its beat input, "
                "1 Mbaud, and not the console?\n";
    }
    return text.str();
}

nlohmann::json to_json(const HilReport& r) {
    return {{"identical", r.identical()},
            {"frames_sent", r.frames_sent},
            {"frames_processed", r.board.processed},
            {"frames_lost", r.frames_lost},
            {"late_sends", r.late_sends},
            {"lists", r.board.lists},
            {"lists_different", r.board.different},
            {"lists_without_frame", r.board.missing},
            {"lists_with_damaged_frame", r.board.invalid},
            {"overruns", r.board.overruns},
            {"can_frames", r.board.can_frames},
            {"can_overflow", r.can_overflow},
            {"fell_silent", r.fell_silent},
            {"latency_ms",
             {{"min", r.latency_ms.min},
              {"mean", r.latency_ms.mean},
              {"p99", r.latency_ms.p99},
              {"max", r.latency_ms.max}}},
            {"differences", r.differences}};
}

}  // namespace sim
