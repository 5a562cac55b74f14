/// The CAN controller of the Zynq UltraScale+, polled.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/common/mmio.hpp"
#include "hal/contract/can_port.hpp"
#include "hal/zcu102/registers.hpp"

namespace hal::zcu102 {

/// Lengths in time quanta of a bit: 1 (synchronisation) + time_segment_1 + time_segment_2.
struct BitTiming {
    std::uint32_t prescaler = 0;       ///< reference clocks a quantum, 1..256
    std::uint32_t time_segment_1 = 0;  ///< 1..16
    std::uint32_t time_segment_2 = 0;  ///< 2..8, at least the jump width
    std::uint32_t jump_width = 0;      ///< 1..4

    [[nodiscard]] constexpr std::uint32_t quanta() const { return 1 + time_segment_1 + time_segment_2; }
    [[nodiscard]] constexpr std::uint32_t sample_point_permille() const {
        return 1000 * (1 + time_segment_1) / quanta();
    }
    /// Exactly this bit rate, within the controller's fields, and between 8 and 25 quanta (ISO 11898-1).
    [[nodiscard]] constexpr bool valid(std::uint32_t reference_hz, std::uint32_t bit_rate) const {
        return prescaler >= 1 && prescaler <= 256 && time_segment_1 >= 1 && time_segment_1 <= 16 &&
               time_segment_2 >= 2 && time_segment_2 <= 8 && jump_width >= 1 && jump_width <= 4 &&
               jump_width <= time_segment_2 && quanta() >= 8 &&
               prescaler * quanta() * bit_rate == reference_hz;
    }
};

/// The exact timing whose sample point is nearest to the wanted one; the one with most quanta of several. An
/// invalid one (all zero) when the clock cannot be divided to the bit rate.
constexpr BitTiming bit_timing(std::uint32_t reference_hz, std::uint32_t bit_rate,
                               std::uint32_t sample_permille) {
    BitTiming best;
    std::uint32_t best_error = 1000;
    for (std::uint32_t prescaler = 1; prescaler <= 256; ++prescaler) {
        for (std::uint32_t segment_2 = 2; segment_2 <= 8; ++segment_2) {
            const std::uint32_t clocks = prescaler * bit_rate;
            if (reference_hz % clocks != 0) continue;
            const std::uint32_t quanta = reference_hz / clocks;
            if (quanta < 8 || quanta > 1 + 16 + segment_2) continue;
            const BitTiming t{prescaler, quanta - 1 - segment_2, segment_2, segment_2 < 4 ? segment_2 : 4};
            const std::uint32_t at = t.sample_point_permille();
            const std::uint32_t error = at > sample_permille ? at - sample_permille : sample_permille - at;
            if (t.valid(reference_hz, bit_rate) && error < best_error) {
                best = t;
                best_error = error;
            }
        }
    }
    return best;
}

struct CanConfig {
    std::uint32_t reference_hz = kReferenceHz;  ///< CAN_REF_CLK
    std::uint32_t bit_rate = 500'000;           ///< bit/s, of the whole bus
    /// CiA 301 asks for 875; 100 MHz allows 850 with three quanta left behind the sample point.
    std::uint32_t sample_point_permille = 875;
    /// Bus off to the next try, at least the 128 x 11 bit times of ISO 11898-1. Longer spares a broken bus,
    /// shorter loses fewer lists.
    std::uint32_t recovery_us = 100'000;
    /// How long begin_cycle waits for a gap between frames before it discards an old list; one frame of 8
    /// bytes takes up to 135 bit times, 270 us.
    std::uint32_t gap_us = 300;
    std::array<std::uint16_t, 2> accept{0x431, 0x432};  ///< identifiers we listen to: ego motion, command

    [[nodiscard]] constexpr BitTiming timing() const {
        return bit_timing(reference_hz, bit_rate, sample_point_permille);
    }
    [[nodiscard]] constexpr bool valid() const {
        return timing().valid(reference_hz, bit_rate) &&
               std::uint64_t{recovery_us} * bit_rate >= std::uint64_t{128 * 11} * 1'000'000 &&
               gap_us <= 1000 && accept[0] < 0x800 && accept[1] < 0x800;
    }
};
inline constexpr CanConfig kDefaultCanConfig{};
static_assert(kDefaultCanConfig.valid());
static_assert(kDefaultCanConfig.timing().prescaler == 10 && kDefaultCanConfig.timing().quanta() == 20);
static_assert(kDefaultCanConfig.timing().sample_point_permille() == 850);

struct CanErrors {
    std::uint8_t transmit = 0;  ///< TEC
    std::uint8_t receive = 0;   ///< REC
};

/// Registers: the controller's. Timer: `now_us()`.
template <RegisterBlock Registers, class Timer>
class CanController final : public CanPort {
  public:
    CanController(Registers registers, Timer& timer, const CanConfig& config = kDefaultCanConfig)
        : registers_(registers), timer_(timer), config_(config) {}

    /// Resets and programs the controller. False: it did not answer within kPatience reads; state() is then
    /// `down`, and begin_cycle tries again after the recovery time.
    bool start() {
        using namespace can_reg;
        in_flight_ = 0;
        bus_off_ = false;
        running_ = false;
        retry_us_ = timer_.now_us() + config_.recovery_us;
        registers_.write(kSrr, kSrrSrst);
        if (!wait_for(kSrConfig, kSrConfig)) return false;
        const BitTiming timing = config_.timing();
        registers_.write(kMsr, 0);
        registers_.write(kBrpr, timing.prescaler - 1);
        registers_.write(kBtr, (timing.jump_width - 1) << 7 | (timing.time_segment_2 - 1) << 4 |
                                   (timing.time_segment_1 - 1));
        registers_.write(kIer, 0);
        registers_.write(kAfr, 0);  // a filter may be written only while it is not in use
        if (!wait_for(kSrAcfbsy, 0)) return false;
        for (std::uint32_t i = 0; i < config_.accept.size(); ++i) {
            registers_.write(kAfmr1 + 8 * i, kIdMask | kIdRtr | kIdIde);
            registers_.write(kAfir1 + 8 * i, std::uint32_t{config_.accept[i]} << kIdShift);
        }
        registers_.write(kAfr, (1U << config_.accept.size()) - 1);
        registers_.write(kIcr, kIsrAll);
        registers_.write(kSrr, kSrrCen);
        // Normal mode begins with 11 recessive bits on the bus, which may not come for long: only leaving the
        // configuration mode is waited for.
        running_ = wait_for(kSrConfig, 0);
        return running_;
    }

    bool send(const can::Frame& frame) override {
        using namespace can_reg;
        look_for_bus_off();
        if (!running_ || bus_off_ || (registers_.read(kSr) & kSrTxfll) != 0) {
            ++counters_.dropped;
            return false;
        }
        // One frame under way is known to be through by TXOK, several by the FIFO being empty again.
        if (in_flight_ == 0) registers_.write(kIcr, kIsrTxok);
        registers_.write(kTxfifoId, std::uint32_t{frame.id} << kIdShift);
        registers_.write(kTxfifoDlc, std::uint32_t{frame.length} << kDlcShift);
        registers_.write(kTxfifoData1, word(frame, 0));
        registers_.write(kTxfifoData2, word(frame, 4));
        ++in_flight_;
        if (in_flight_ > 1) registers_.write(kIcr, kIsrTxfemp);
        return true;
    }

    bool receive(can::Frame& frame) override {
        if (held_next_ < held_count_) {
            frame = held_[held_next_++];
            return true;
        }
        return running_ && receive_from_fifo(frame);
    }

    /// A list that is still under way when the next one is due is discarded as a whole: the controller does
    /// not tell how much of it is through, so all of it counts as dropped. The FIFOs can only be emptied by a
    /// reset, before which received frames are put aside and a gap on the bus is waited for, for gap_us at
    /// most.
    void begin_cycle() override {
        using namespace can_reg;
        look_for_bus_off();
        passive_ = (registers_.read(kSr) & kSrEstat) == kSrEstatPassive;
        if (!running_) {
            if (timer_.now_us() >= retry_us_) start();
            return;
        }
        if (delivered()) {
            counters_.sent += in_flight_;
            in_flight_ = 0;
            return;
        }
        counters_.dropped += in_flight_;
        hold_received();
        const std::uint64_t deadline_us = timer_.now_us() + config_.gap_us;
        while ((registers_.read(kSr) & kSrBidle) == 0 && timer_.now_us() < deadline_us) {
        }
        start();
    }

    CanState state() override {
        using namespace can_reg;
        look_for_bus_off();
        if (bus_off_) return CanState::bus_off;
        const std::uint32_t status = registers_.read(kSr);
        if (!running_ || (status & kSrConfig) != 0) return CanState::down;
        // Discarding an old list clears the controller's error counters; what they said before holds for the
        // cycle.
        return passive_ || (status & kSrEstat) == kSrEstatPassive ? CanState::passive : CanState::active;
    }

    CanCounters counters() override {
        if (running_ && delivered()) {
            counters_.sent += in_flight_;
            in_flight_ = 0;
        }
        return counters_;
    }

    [[nodiscard]] CanErrors errors() {
        const std::uint32_t ecr = registers_.read(can_reg::kEcr);
        return {static_cast<std::uint8_t>(ecr & 0xFF), static_cast<std::uint8_t>((ecr >> 8) & 0xFF)};
    }

  private:
    static constexpr int kPatience = 10'000;       ///< reads of SR before a controller counts as dead
    static constexpr std::size_t kFifoDepth = 64;  ///< frames in the receive FIFO

    static std::uint32_t word(const can::Frame& frame, std::size_t from) {
        std::uint32_t w = 0;
        for (std::size_t i = from; i < from + 4; ++i) w = w << 8 | (i < frame.length ? frame.data[i] : 0U);
        return w;
    }

    bool wait_for(std::uint32_t mask, std::uint32_t value) {
        for (int i = 0; i < kPatience; ++i) {
            if ((registers_.read(can_reg::kSr) & mask) == value) return true;
        }
        return false;
    }

    bool delivered() {
        using namespace can_reg;
        return in_flight_ == 0 || (registers_.read(kIsr) & (in_flight_ == 1 ? kIsrTxok : kIsrTxfemp)) != 0;
    }

    void look_for_bus_off() {
        using namespace can_reg;
        if (!running_) return;
        if ((registers_.read(kIsr) & kIsrBsoff) == 0 && (registers_.read(kSr) & kSrEstat) != kSrEstatBusOff)
            return;
        ++counters_.bus_off;
        counters_.dropped += in_flight_;
        in_flight_ = 0;
        hold_received();
        registers_.write(kSrr,
                         kSrrSrst);  // configuration mode: off the bus until begin_cycle starts it again
        running_ = false;
        bus_off_ = true;
        retry_us_ = timer_.now_us() + config_.recovery_us;
    }

    void hold_received() {
        can::Frame frame;
        held_count_ = held_next_ == held_count_ ? 0 : held_count_;
        if (held_count_ == 0) held_next_ = 0;
        while (receive_from_fifo(frame)) {
            if (held_count_ < held_.size()) {
                held_[held_count_++] = frame;
            } else {
                ++counters_.receive_overflow;
            }
        }
    }

    bool receive_from_fifo(can::Frame& frame) {
        using namespace can_reg;
        for (std::size_t i = 0; i < kFifoDepth; ++i) {
            const std::uint32_t pending = registers_.read(kIsr);
            if ((pending & kIsrRxoflw) != 0) {
                ++counters_.receive_overflow;
                registers_.write(kIcr, kIsrRxoflw);
            }
            if ((pending & kIsrRxnemp) == 0) return false;
            const std::uint32_t id = registers_.read(kRxfifoId);
            const std::uint32_t dlc = registers_.read(kRxfifoDlc) >> kDlcShift;
            const std::uint32_t data_1 = registers_.read(kRxfifoData1);
            const std::uint32_t data_2 = registers_.read(kRxfifoData2);
            registers_.write(kIcr, kIsrRxnemp);  // comes back by itself while the FIFO is not empty
            if ((id & (kIdRtr | kIdIde)) != 0) {
                ++counters_.rejected;
                continue;
            }
            frame.id = static_cast<std::uint16_t>(id >> kIdShift);
            frame.length = static_cast<std::uint8_t>(dlc < 8 ? dlc : 8);
            for (std::size_t b = 0; b < 8; ++b) {
                const std::uint32_t w = b < 4 ? data_1 : data_2;
                frame.data[b] =
                    b < frame.length ? static_cast<std::uint8_t>(w >> (24 - 8 * (b % 4))) : std::uint8_t{0};
            }
            ++counters_.received;
            return true;
        }
        return false;
    }

    Registers registers_;
    Timer& timer_;
    CanConfig config_;
    CanCounters counters_;
    std::uint32_t in_flight_ = 0;  ///< frames handed to the controller and not known to be through
    bool running_ = false;
    bool bus_off_ = false;
    bool passive_ = false;        ///< as begin_cycle found it
    std::uint64_t retry_us_ = 0;  ///< when to start again after bus off or a dead controller
    std::array<can::Frame, 8> held_{};
    std::size_t held_count_ = 0;
    std::size_t held_next_ = 0;
};

}  // namespace hal::zcu102
