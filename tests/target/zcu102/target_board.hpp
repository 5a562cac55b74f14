/// What the replay needs of a ZCU102: the real CAN driver on CAN1, and on CAN0, at the same emulated bus, the
/// rest of the car.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "can/frame.hpp"
#include "hal/common/uart_console.hpp"
#include "hal/zcu102/can.hpp"
#include "hal/zcu102/uart.hpp"

namespace target {

using hal::Mmio;
using namespace hal::zcu102;

/// Lets instructions() count: the cycle counter on, from zero, not divided.
inline void start_counting() {
    asm volatile("mcr p15, 0, %0, c9, c12, 0" ::"r"(1U | 1U << 2));
    asm volatile("mcr p15, 0, %0, c9, c12, 1" ::"r"(1U << 31));
}

/// Instructions since start_counting(), modulo 2^32: the cycle counter, under -icount shift=0.
inline std::uint32_t instructions() {
    std::uint32_t count = 0;
    asm volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(count)::"memory");
    return count;
}

/// A CAN node that accepts everything; registers as in can.hpp.
class Car {
  public:
    void start() {
        using namespace can_reg;
        Can::write(kSrr, kSrrSrst);
        Can::write(kBrpr, 9);
        Can::write(kBtr, 2 << 7 | 2 << 4 | 15);
        Can::write(kAfr, 0);
        Can::write(kSrr, kSrrCen);
    }
    static void send(const can::Frame& frame) {
        using namespace can_reg;
        Can::write(kTxfifoId, std::uint32_t{frame.id} << kIdShift);
        Can::write(kTxfifoDlc, std::uint32_t{frame.length} << kDlcShift);
        Can::write(kTxfifoData1, word(frame, 0));
        Can::write(kTxfifoData2, word(frame, 4));
    }
    static bool receive(can::Frame& frame) {
        using namespace can_reg;
        if ((Can::read(kIsr) & kIsrRxnemp) == 0) return false;
        frame.id = static_cast<std::uint16_t>(Can::read(kRxfifoId) >> kIdShift);
        frame.length = static_cast<std::uint8_t>(Can::read(kRxfifoDlc) >> kDlcShift);
        const std::uint32_t words[2] = {Can::read(kRxfifoData1), Can::read(kRxfifoData2)};
        Can::write(kIcr, kIsrRxnemp);
        for (std::size_t i = 0; i < 8; ++i) {
            frame.data[i] = i < frame.length ? static_cast<std::uint8_t>(words[i / 4] >> (24 - 8 * (i % 4)))
                                             : std::uint8_t{0};
        }
        return true;
    }

  private:
    using Can = Mmio<kCan0>;
    static std::uint32_t word(const can::Frame& frame, std::size_t from) {
        std::uint32_t w = 0;
        for (std::size_t i = from; i < from + 4; ++i) w = w << 8 | frame.data[i];
        return w;
    }
};

/// The radar's side of the bus, and the car's.
class TestBus {
  public:
    template <class Timer>
    using Port = CanController<Mmio<kCan1>, Timer>;

    template <class Timer>
    explicit TestBus(Timer&) {}

    template <class Timer>
    static Port<Timer> make_port(TestBus&, Timer& timer) {
        return Port<Timer>({}, timer);
    }
    template <class Timer>
    void start(Port<Timer>& port) {
        start_counting();
        car_.start();
        port.start();
    }
    void to_radar(const can::Frame& frame) { car_.send(frame); }
    bool from_radar(can::Frame& frame) { return car_.receive(frame); }

  private:
    Car car_;
};

inline Uart<Mmio<kUart0>> uart({});
inline hal::UartConsole uart_console(uart);
inline void start_uart() {
    uart.start(baud_rate(kReferenceHz, 115'200));
}

}  // namespace target
