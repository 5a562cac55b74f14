// The radar on the real-time processor of the ZCU102. UART0: console, 115200 baud. UART1: beat frames, 1
// Mbaud (see hal/common/beat_link.hpp). CAN1, the controller with a transceiver on the board: 500 kbit/s.

#include "firmware/run_board.hpp"
#include "hal/common/beat_input.hpp"
#include "hal/common/receiving_clock.hpp"
#include "hal/common/uart_console.hpp"
#include "hal/zcu102/can.hpp"
#include "hal/zcu102/reset.hpp"
#include "hal/zcu102/ttc_clock.hpp"
#include "hal/zcu102/uart.hpp"
#include "hal/zcu102/watchdog.hpp"

namespace {

using hal::Mmio;
using namespace hal::zcu102;

constexpr firmware::RadarConfig kConfig = firmware::radar_config(dsp::kDefaultWaveform);

using Timer = TtcClock<Mmio<kTtc0>>;

/// Where the front end's DMA writes. The processor sees it in its tightly-coupled memory; to the DMA that is
/// 0xFFE20000 + (address - 0x20000).
hal::RingMemory front_end_ring;

Timer timer({}, {.reference_hz = timer_reference_hz()});
Uart<Mmio<kUart0>> console_uart({});
Uart<Mmio<kUart1>> beat_uart({});
hal::UartConsole console(console_uart);
CanController<Mmio<kCan1>, Timer> can_port({}, timer);
SystemWatchdog<Mmio<kSwdt>, Mmio<kPmuGlobal>> watchdog({}, {});
hal::BeatInput beat(front_end_ring, beat_uart, timer, kConfig.waveform.period_ms * 1000U);
hal::ReceivingClock loop_clock(timer, beat, 400);  // of the 640 us that its FIFO holds

const hal::Board board{beat, can_port, loop_clock, watchdog, console};
firmware::Radar radar(kConfig, board);

}  // namespace

int main() {
    const hal::ResetRecord last = begin_run();
    timer.start();
    console_uart.start(baud_rate(kReferenceHz, 115'200));
    beat_uart.start(baud_rate(kReferenceHz, hal::kBeatLinkBaud));
    can_port.start();

    firmware::run_board(RADAR_BOARD_NAME, last, radar, board);
}
