// The radar on the Arm MPS2 boards. UART0: console, 115200 baud. UART1: CAN as SLCAN text, 1 Mbaud. UART2:
// beat frames, 1 Mbaud (see hal/common/beat_link.hpp).

#include "firmware/run_board.hpp"
#include "hal/bare_metal/reset_record.hpp"
#include "hal/common/beat_input.hpp"
#include "hal/common/receiving_clock.hpp"
#include "hal/common/slcan.hpp"
#include "hal/common/uart_console.hpp"
#include "hal/mps2/system_control.hpp"
#include "hal/mps2/systick_clock.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"

namespace {

using hal::Mmio;
using namespace hal::mps2;

constexpr firmware::RadarConfig kConfig = firmware::radar_config(dsp::kDefaultWaveform);

constexpr std::uint32_t kSlcanBaud = 1'000'000;

using Timer = SysTickClock<SystemControl, Mmio<kTimer0>>;

hal::RingMemory front_end_ring;  ///< where a front end's DMA would write

Timer timer({}, {});
Uart<Mmio<kUart0>, 64> console_uart({});
Uart<Mmio<kUart1>, 1024> can_uart({});
Uart<Mmio<kUart2>, 2048> beat_uart({});
hal::UartConsole console(console_uart);
hal::SlcanPort can_port(can_uart);
CmsdkWatchdog<Mmio<kWatchdog>> watchdog({});
hal::BeatInput beat(front_end_ring, beat_uart, timer, kConfig.waveform.period_ms * 1000U);
hal::ReceivingClock loop_clock(timer, beat, 10'000);  // of the 20 ms that its queue holds

const hal::Board board{beat, can_port, loop_clock, watchdog, console};
firmware::Radar radar(kConfig, board);

}  // namespace

extern "C" {
void uart0_receive_handler() {
    console_uart.on_receive();
}
void uart1_receive_handler() {
    can_uart.on_receive();
}
void uart2_receive_handler() {
    beat_uart.on_receive();
}
void timer0_handler() {
    timer.on_alarm();
}
}

int main() {
    const hal::ResetRecord last = hal::begin_reset_record();
    timer.start();
    console_uart.start(115'200);
    can_uart.start(kSlcanBaud);
    beat_uart.start(hal::kBeatLinkBaud);
    for (const std::uint32_t irq : {kUart0RxIrq, kUart1RxIrq, kUart2RxIrq, kTimer0Irq})
        SystemControl::enable_irq(irq);

    firmware::run_board(RADAR_BOARD_NAME, last, radar, board);
}
