#include "hal/bare_metal/reset_record.hpp"

#include "hal/bare_metal/startup.hpp"
#include "hal/mps2/system_control.hpp"

namespace hal {

void reset_board(const ResetRecord& record) {
    write_reset_record(record);
    mps2::SystemControl::write(mps2::scs_reg::kAircr, mps2::scs_reg::kAircrSysresetreq);
    for (;;) {
    }
}

}  // namespace hal

/// What the processor pushes on an exception.
struct ExceptionFrame {
    std::uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
};

/// `frame`: the stack pointer at the exception. It is trusted only inside the stack.
extern "C" [[noreturn]] void record_fault(const ExceptionFrame* frame) {
    using namespace hal;
    using mps2::SystemControl;
    extern std::uint32_t _stack_bottom, _stack_top;
    constexpr std::uint32_t kNmi = 2;
    constexpr std::uint32_t kFirstInterrupt = 16;
    const std::uint32_t exception = SystemControl::read(mps2::scs_reg::kIcsr) & 0x1FF;
    ResetRecord record{.cause = exception == kNmi              ? ResetCause::watchdog
                                : exception >= kFirstInterrupt ? ResetCause::unexpected_interrupt
                                                               : ResetCause::hard_fault,
                       .status = SystemControl::read(mps2::scs_reg::kCfsr),
                       .address = SystemControl::read(mps2::scs_reg::kBfar)};
    const auto at = reinterpret_cast<std::uintptr_t>(frame);
    if (at >= reinterpret_cast<std::uintptr_t>(&_stack_bottom) &&
        at + sizeof(ExceptionFrame) <= reinterpret_cast<std::uintptr_t>(&_stack_top)) {
        record.pc = frame->pc;
    }
    reset_board(record);
}
