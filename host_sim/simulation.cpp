#include "host_sim/simulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "can/signals.hpp"
#include "can/transmitter.hpp"
#include "hal/host/candump_log.hpp"
#include "hal/host/counting_watchdog.hpp"
#include "hal/host/frame_file_source.hpp"
#include "hal/host/loopback_bus.hpp"
#include "hal/host/real_clock.hpp"
#include "hal/host/socket_can.hpp"
#include "hal/host/stderr_console.hpp"
#include "hal/host/virtual_clock.hpp"
#include "host_sim/csv.hpp"
#include "host_sim/portable_math.hpp"

namespace sim {

namespace {

using dsp::Real;

Real real(double value) {
    return Real::ratio(std::llround(value * 1e6), 1'000'000);
}

template <class T>
std::unique_ptr<T> opened_or_throw(const std::string& what, hal::Opened<T> opened) {
    if (!opened.value) throw InputError(what + ": " + opened.error);
    return std::move(opened.value);
}

/// The front end in the simulated world: one frame a period, whether or not somebody takes it in time.
class FrontEndSource final : public hal::BeatSource {
  public:
    FrontEndSource(const World& world, const BeatSynthesis& synthesis, hal::Clock& clock,
                   std::uint64_t frames)
        : world_(world), synthesis_(synthesis), clock_(clock), frames_(frames) {
        const dsp::Waveform& w = world.scenario().waveform;
        period_us_ = static_cast<std::uint64_t>(w.period_ms) * 1000;
        sweep_us_ = static_cast<std::uint64_t>(dsp::kChirps * w.chirp_interval_ns / 1000);
    }

    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        const std::uint64_t index = std::max(next_, clock_.now_us() / period_us_);
        if (index >= frames_) return hal::BeatResult::ended;
        synthesis_.synthesise(world_.echoes(index), world_.bursts(index), index, frame);
        clock_.wait_until(index * period_us_ + sweep_us_);
        sequence = static_cast<std::uint32_t>(index);
        next_ = index + 1;
        return hal::BeatResult::ok;
    }

  private:
    const World& world_;
    const BeatSynthesis& synthesis_;
    hal::Clock& clock_;
    std::uint64_t frames_;
    std::uint64_t period_us_;
    std::uint64_t sweep_us_;
    std::uint64_t next_ = 0;
};

/// Where there are only detections, nobody may ask for a beat frame.
class NoSource final : public hal::BeatSource {
  public:
    hal::BeatResult acquire(dsp::BeatFrame&, std::uint32_t&) override { return hal::BeatResult::ended; }
};

/// Any source, cut off after some frames, and written to a file if wanted.
class TappedSource final : public hal::BeatSource {
  public:
    TappedSource(hal::BeatSource& source, std::uint64_t frames, hal::FrameFileWriter* writer)
        : source_(source), frames_(frames), writer_(writer) {}

    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        if (taken_ == frames_) return hal::BeatResult::ended;
        const hal::BeatResult result = source_.acquire(frame, sequence);
        if (result == hal::BeatResult::ended) return result;
        ++taken_;
        last_ = sequence;
        if (result == hal::BeatResult::ok && writer_ != nullptr) writer_->write(frame);
        return result;
    }
    [[nodiscard]] std::uint32_t last() const { return last_; }

  private:
    hal::BeatSource& source_;
    std::uint64_t frames_;
    hal::FrameFileWriter* writer_;
    std::uint64_t taken_ = 0;
    std::uint32_t last_ = 0;
};

/// As the acceptance filters of the boards.
constexpr std::array<std::uint16_t, 2> kRadarHears{can::ego::kMessage.id, can::command::kMessage.id};

/// Two ports on one bus: the radar's, and the car's.
struct Bus {
    std::unique_ptr<hal::LoopbackBus> loopback;
    std::unique_ptr<hal::SocketCan> radar_socket;
    std::unique_ptr<hal::SocketCan> car_socket;
    hal::CanPort* radar = nullptr;
    hal::CanPort* car = nullptr;

    explicit Bus(const std::string& name) {
        if (name == kLoopback) {
            loopback = std::make_unique<hal::LoopbackBus>();
            radar = &loopback->add_port();
            car = &loopback->add_port();
        } else {
            radar_socket = opened_or_throw(
                "CAN interface " + name,
                hal::SocketCan::open(name, hal::kernel_socket_calls(), {.accept = kRadarHears}));
            car_socket = opened_or_throw("CAN interface " + name, hal::SocketCan::open(name));
            radar = radar_socket.get();
            car = car_socket.get();
        }
    }
};

std::string input_name(const SimulationOptions& o) {
    if (o.scenario) return o.scenario->name.empty() ? "scenario" : o.scenario->name;
    for (const auto* file : {&o.replay, &o.traffic, &o.detections})
        if (!file->empty()) return file->filename().string();
    return "";
}

void check(const SimulationOptions& o) {
    const int inputs = (o.scenario ? 1 : 0) + (o.replay.empty() ? 0 : 1) + (o.traffic.empty() ? 0 : 1) +
                       (o.detections.empty() ? 0 : 1);
    if (inputs != 1)
        throw InputError("give exactly one of scenario, replay, traffic and detections, not " +
                         std::to_string(inputs));
    if (o.waveform && o.scenario) throw InputError("waveform: a scenario has its own");
    if (!o.ego.empty() && o.scenario) throw InputError("ego: a scenario has its own");
    if (!o.record.empty() && !o.detections.empty())
        throw InputError("record: detections have no beat frames");
    if (o.frames && *o.frames == 0) throw InputError("frames: must be at least 1, is 0");
    if (!(o.speed >= 0) || !std::isfinite(o.speed)) throw InputError("speed: must be a positive number");
}

}  // namespace

firmware::RadarConfig radar_config(const dsp::Waveform& waveform, int adc_bits,
                                   tracking::Associator tracker) {
    firmware::RadarConfig config = firmware::radar_config(waveform, adc_bits);
    config.tracker.associator = tracker;
    return config;
}

std::vector<dsp::DetectionList> read_detections(const std::filesystem::path& file,
                                                const dsp::Waveform& waveform) {
    const auto rows = read_csv(file, {"frame", "range_m", "range_rate_mps", "snr_db"});
    require_ascending(file, rows, 0, "frame");
    constexpr double kLongest = 10'000'000;  // 11 days
    const auto fail = [&file](std::size_t row, const std::string& reason) {
        throw InputError(file.string() + ":" + std::to_string(row + 2) + ": " + reason);
    };
    const double range_cell = static_cast<double>(waveform.range_cell_um()) * 1e-6;
    const double rate_cell = static_cast<double>(waveform.rate_cell_umps()) * 1e-6;
    std::vector<dsp::DetectionList> frames;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const double frame = rows[i][0];
        const double range = rows[i][1];
        const double rate = rows[i][2];
        const double snr_db = rows[i][3];
        if (frame != std::floor(frame) || frame > kLongest)
            fail(i, "frame: must be a whole number up to 10000000");
        if (range < 0 || range > 500) fail(i, "range_m: not within 0 .. 500 m");
        if (std::fabs(rate) > 400) fail(i, "range_rate_mps: not within -400 .. 400 m/s");
        if (snr_db < 0 || snr_db > 150) fail(i, "snr_db: not within 0 .. 150 dB");
        frames.resize(static_cast<std::size_t>(frame) + 1);
        dsp::DetectionList& list = frames.back();
        // A Hann window loses 1.5 against the bound of the rectangular one.
        const double cells2 =
            1.5 * 1.5 * 6 / (4 * std::numbers::pi * std::numbers::pi * power_from_db(snr_db)) + 0.02 * 0.02;
        dsp::Detection d;
        d.range_m = real(range);
        d.range_rate_mps = real(rate);
        d.snr_db = real(snr_db);
        d.range_variance_m2 = std::max(real(range_cell * range_cell * cells2), Real::from_raw(1));
        d.rate_variance_m2ps2 = std::max(real(rate_cell * rate_cell * cells2), Real::from_raw(1));
        if (list.count == dsp::kMaxDetections) {
            ++list.dropped;
            auto& weakest = list.item.back();
            if (d.snr_db <= weakest.snr_db) continue;
            weakest = d;
        } else {
            list.item[static_cast<std::size_t>(list.count++)] = d;
        }
        std::stable_sort(
            list.item.begin(), list.item.begin() + list.count,
            [](const dsp::Detection& a, const dsp::Detection& b) { return a.snr_db > b.snr_db; });
    }
    return frames;
}

std::vector<std::string> fault_names(std::uint16_t faults) {
    std::vector<std::string> names;
    for (const can::ValueName& bit : can::status::kFaultBits)
        if ((faults & bit.raw) != 0) names.emplace_back(bit.name);
    return names;
}

struct Simulation::Parts {
    SimulationOptions options;
    std::unique_ptr<hal::VirtualClock> virtual_clock;
    std::unique_ptr<hal::RealClock> real_clock;
    std::optional<Bus> bus;
    std::unique_ptr<hal::CandumpWriter> log;
    std::unique_ptr<hal::LoggingPort> logging_port;
    std::unique_ptr<hal::FrameFileWriter> writer;
    std::optional<World> world;
    std::vector<SpeedSample> ego_speed;
    std::unique_ptr<BeatSynthesis> synthesis;
    std::unique_ptr<FrontEndSource> front_end;
    std::unique_ptr<hal::FrameFileSource> recording;
    std::vector<dsp::DetectionList> detections;
    NoSource no_source;
    std::unique_ptr<TappedSource> source;
    hal::CountingWatchdog watchdog;
    hal::StderrConsole console;
    std::unique_ptr<firmware::Radar> radar;
    can::Transmitter car;
    Metrics metrics;

    dsp::Waveform waveform;
    std::uint64_t total = 0;
    std::uint64_t done = 0;
    std::optional<Ego> ego;
    std::vector<TruthObject> truth;

    explicit Parts(const SimulationOptions& o) : options(o), console(o.quiet) {
        check(o);
        if (o.speed > 0) {
            real_clock = std::make_unique<hal::RealClock>(o.speed);
        } else {
            virtual_clock = std::make_unique<hal::VirtualClock>();
        }
        if (o.waveform) waveform = *o.waveform;
        if (!o.ego.empty()) ego_speed = read_ego_speed(o.ego);
        hal::BeatSource& input = open_input();
        if (o.frames) total = std::min(total, *o.frames);
        bus.emplace(o.bus);
        hal::CanPort* port = bus->radar;
        if (!o.log.empty()) {
            log = opened_or_throw("log", hal::CandumpWriter::open(o.log.string(), o.bus));
            logging_port = std::make_unique<hal::LoggingPort>(*port, clock(), *log);
            port = logging_port.get();
        }
        if (!o.record.empty()) writer = std::make_unique<hal::FrameFileWriter>(o.record);
        source = std::make_unique<TappedSource>(input, total, writer.get());

        constexpr int kWidestConverter = 16;
        auto config = radar_config(waveform, world ? world->scenario().front_end.adc_bits : kWidestConverter,
                                   o.tracker);
        if (o.tracker_level) config.tracker.ijipda.level = *o.tracker_level;
        config.tracker.gate.nonparametric = o.nonparametric;
        if (!config.valid())
            throw InputError("waveform: no valid configuration of the firmware follows from it");
        radar =
            std::make_unique<firmware::Radar>(config, hal::Board{*source, *port, clock(), watchdog, console});
        radar->start();
    }

    [[nodiscard]] hal::Clock& clock() const {
        return real_clock ? static_cast<hal::Clock&>(*real_clock) : static_cast<hal::Clock&>(*virtual_clock);
    }

    hal::BeatSource& open_input() {
        const SimulationOptions& o = options;
        if (!o.replay.empty()) {
            recording = std::make_unique<hal::FrameFileSource>(o.replay);
            total = recording->frames();
            return *recording;
        }
        if (!o.detections.empty()) {
            detections = read_detections(o.detections, waveform);
            total = detections.size();
            return no_source;
        }
        if (o.scenario) {
            world.emplace(*o.scenario, o.seed);
        } else {
            Scenario scenario;
            scenario.waveform = waveform;
            world.emplace(scenario, o.seed, read_traffic(o.traffic), ego_speed);
        }
        const Scenario& scenario = world->scenario();
        waveform = scenario.waveform;
        total = world->frames();
        synthesis = std::make_unique<BeatSynthesis>(waveform, scenario.front_end, o.seed);
        front_end = std::make_unique<FrontEndSource>(*world, *synthesis, clock(), world->frames());
        return *front_end;
    }

    /// The car tells its speed at the start of the period, before the radar reads the bus.
    void report_ego() {
        const double time_s = static_cast<double>(done) * waveform.period_ms / 1000;
        ego.reset();
        if (options.scenario) {
            ego = world->ego_at(time_s);
        } else if (!ego_speed.empty()) {
            const double before = speed_at(ego_speed, time_s - 0.1);
            const double now = speed_at(ego_speed, time_s);
            ego = Ego{now, (now - before) / 0.1};
        }
        bus->car->begin_cycle();
        can::Frame heard;
        while (bus->car->receive(heard)) {
        }
        if (!ego) return;
        can::EgoMotion message;
        message.speed_mmps = static_cast<std::int32_t>(std::lround(ego->speed_mps * 1000));
        message.acceleration_mmps2 = static_cast<std::int32_t>(std::lround(ego->acceleration_mps2 * 1000));
        message.valid = true;
        // A bus that is down shows in the radar's own counters.
        (void)bus->car->send(car.frame(message));
    }

    bool step() {
        if (done == total) return false;
        report_ego();
        if (!options.detections.empty()) {
            radar->run_cycle(detections[static_cast<std::size_t>(done)]);
        } else if (!radar->run_cycle()) {
            total = done;
            return false;
        }
        ++done;
        truth.clear();
        if (world) truth = world->truth_at(world->frame_middle_s(source->last()));
        std::vector<TrackEstimate> tracks;
        for (const auto& t : radar->tracks()) {
            if (!t.is_confirmed()) continue;
            tracks.push_back(
                {t.id, tracking::scalar_from<double>(t.x[0]), tracking::scalar_from<double>(t.x[1])});
        }
        metrics.add_frame(view().time_s, truth, tracks);
        return true;
    }

    [[nodiscard]] CycleView view() const {
        const std::uint64_t frame = options.detections.empty() ? source->last() : done - 1;
        const double middle_s = dsp::kChirps / 2.0 * static_cast<double>(waveform.chirp_interval_ns) * 1e-9;
        return {frame,  static_cast<double>(frame) * waveform.period_ms / 1000 + middle_s, ego, truth,
                *radar, options.detections.empty() ? &radar->power_map() : nullptr};
    }
};

Simulation::Simulation(const SimulationOptions& options) {
    try {
        parts_ = std::make_unique<Parts>(options);
    } catch (const hal::FrameFileError& e) {
        throw InputError(e.what());
    }
}

Simulation::~Simulation() = default;

bool Simulation::step() {
    try {
        return parts_->step();
    } catch (const hal::FrameFileError& e) {
        throw InputError(e.what());
    }
}

CycleView Simulation::view() const {
    return parts_->view();
}
std::uint64_t Simulation::frames() const {
    return parts_->total;
}
const dsp::Waveform& Simulation::waveform() const {
    return parts_->waveform;
}

SimulationResult Simulation::result() {
    const Parts& p = *parts_;
    if (p.log) {
        if (const std::string problem = p.log->flush(); !problem.empty()) throw InputError(problem);
    }
    SimulationResult r;
    r.scenario = input_name(p.options);
    r.tracker = tracking::name_of(p.options.tracker);
    r.bus = p.options.bus;
    r.frames = p.done;
    const hal::CanCounters can = p.bus->radar->counters();
    r.can_frames = can.sent;
    r.dropped_frames = can.dropped;
    r.overruns = p.radar->counters().overruns;
    r.faults = p.radar->health().faults_seen();
    r.has_truth = p.world.has_value();
    r.metrics = p.metrics.summary();
    r.targets = p.metrics.targets();
    return r;
}

}  // namespace sim
