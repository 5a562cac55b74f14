/// The firmware on the PC beside a board that runs the same: given what the board was given, every byte must
/// be equal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "can/frame.hpp"
#include "dsp/beat_frame.hpp"
#include "firmware/radar.hpp"
#include "hal/contract/beat_source.hpp"

namespace sim {

/// What one cycle of a radar depends on, apart from its own state.
struct CycleInputs {
    hal::BeatResult beat = hal::BeatResult::missing;
    const dsp::BeatFrame* frame = nullptr;  ///< for BeatResult::ok
    std::uint32_t sequence = 0;
    bool overrun = false;                  ///< the cycle began late
    std::span<const can::Frame> bus = {};  ///< received since the last cycle
};

/// A radar whose every input is given. Copies go their own ways.
class FirmwareReplica {
  public:
    explicit FirmwareReplica(const firmware::RadarConfig& config);

    /// What the radar sends in this cycle, in order.
    std::vector<can::Frame> run(const CycleInputs& inputs);

    /// True only if both will answer the same inputs with the same frames for ever. (False may be wrong:
    /// bytes that no longer matter are compared too.)
    [[nodiscard]] bool same_state(const FirmwareReplica& other) const;

  private:
    struct World;

    std::shared_ptr<World> world_;  ///< of all copies: keeps nothing from one cycle to the next
    firmware::Radar radar_;
    std::uint64_t next_start_us_ = 0;
};

/// The judgement on what a board sent in one cycle.
struct ListVerdict {
    bool identical = false;
    hal::BeatResult beat = hal::BeatResult::missing;  ///< what the board must have had for it
    std::uint32_t sequence = 0;                       ///< for BeatResult::ok
    /// Of a list that is not identical: the first frame that differs, as it came and as it should have been.
    std::string difference = {};
};

struct BoardTwinCounters {
    std::uint64_t lists = 0;
    std::uint64_t different = 0;
    std::uint64_t can_frames = 0;
    std::uint64_t processed = 0;  ///< beat frames that a list shows to have been processed
    std::uint64_t missing = 0;    ///< cycles without a beat frame
    std::uint64_t invalid = 0;    ///< cycles in which a beat frame came damaged
    std::uint64_t overruns = 0;   ///< cycles that began late
};

/// Takes what the PC sends to a board and what the board says on the bus, and judges cycle by cycle.
///
/// When a board looks at its inputs the bus does not tell: a beat frame or an ego motion that the PC sent at
/// about the start of a cycle may belong to it or to the next, and it may take some cycles until that makes a
/// difference. So replicas for all inputs the board can have had go on side by side: frames in the order they
/// were sent, none taken twice. A damaged one is one of them too, but for a single one that bytes from before
/// the run can have spoilt. A list is identical if one of them says the same in every byte; those that do
/// not are dropped, and those that came to the same state are one. A wrong byte cannot hide in this: CRC,
/// counter and cycle of every frame follow from the state, and there is a handful of inputs against 2^64
/// values of a frame. What the board took shows in the counters.
class BoardTwin {
  public:
    explicit BoardTwin(const firmware::RadarConfig& config);

    /// The PC has sent a beat frame whole; / a CAN frame to the radar.
    void beat_sent(std::uint32_t sequence, const dsp::BeatFrame& frame);
    void bus_sent(const can::Frame& frame);

    /// A frame from the board; those of other nodes are passed over. A verdict when it settles a list: when
    /// it is the last frame of the list, or the first one that is wrong. What then still comes of a wrong
    /// list is passed over.
    std::optional<ListVerdict> receive(const can::Frame& frame);
    /// Nothing has come for long, and nothing will: judges what there is of the current list.
    std::optional<ListVerdict> give_up_list();

    /// By the most likely inputs.
    [[nodiscard]] BoardTwinCounters counters() const;
    /// Beat frames sent and not taken yet.
    [[nodiscard]] std::size_t outstanding() const { return histories_.front().beats.size(); }

  private:
    /// Beat frames, CAN frames and histories kept at most. Of what is older the board has none left.
    static constexpr std::size_t kMaxBeats = 64;
    static constexpr std::size_t kMaxBus = 12;
    static constexpr std::size_t kMaxHistories = 24;
    /// Beat frames the board may have taken next; all of kMaxBeats only when these explain nothing.
    static constexpr std::size_t kLikelyBeats = 2;

    struct SentBeat {
        std::uint32_t sequence;
        dsp::BeatFrame frame;
    };
    /// What the board may have done so far.
    struct History {
        std::shared_ptr<const FirmwareReplica> replica;
        std::deque<std::shared_ptr<const SentBeat>> beats;  ///< not taken yet
        std::deque<can::Frame> bus;                         ///< not read yet
        bool met_old_bytes = false;                         ///< a damaged frame was none of `beats`
        BoardTwinCounters counters = {};                    ///< those of the inputs
    };
    /// What it may have done in the current cycle.
    struct Candidate {
        History after;
        std::vector<can::Frame> list;
        hal::BeatResult beat;
        std::uint32_t sequence;
    };

    [[nodiscard]] bool header_and_objects_there() const;
    void find_candidates(std::size_t beats);
    /// `beats_gone`: so many of the beat frames sent the board will not take any more; the last of them is
    /// the one it took, or had damaged.
    void add_candidate(const History& before, hal::BeatResult beat, std::size_t beats_gone, bool overrun,
                       std::size_t bus_count);
    std::optional<ListVerdict> judge(bool whole);
    ListVerdict settle(const std::vector<const Candidate*>& chosen, std::string difference);

    std::vector<History> histories_;  ///< most likely first; never empty
    std::vector<can::Frame> list_;
    std::vector<Candidate> candidates_;  ///< for list_; emptied when the inputs change
    bool settled_ = true;                ///< nothing more is expected of list_
    bool pass_over_rest_ = false;        ///< of list_, which has been reported already
    std::uint8_t overruns_before_ = 0;   ///< as the last status said
    std::uint64_t lists_ = 0;
    std::uint64_t different_ = 0;
    std::uint64_t can_frames_ = 0;
};

/// "411#0102030405060708", as cansend takes it.
std::string to_text(const can::Frame& frame);

}  // namespace sim
