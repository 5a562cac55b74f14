#include "hal/zcu102/reset.hpp"

#include "hal/common/mmio.hpp"
#include "hal/zcu102/registers.hpp"

namespace hal {

using zcu102::kCrlApb;
using zcu102::kPmuGlobal;
namespace crl = zcu102::crl_reg;
namespace pmu = zcu102::pmu_reg;
using Crl = Mmio<kCrlApb>;
using Pmu = Mmio<kPmuGlobal>;

namespace {

/// Upper half of PERS_GLOB_GEN_STORAGE0 when it holds a record; the cause is in the lower half.
constexpr std::uint32_t kStorageMagic = 0x52AD'0000;
constexpr std::uint32_t kStorageMagicMask = 0xFFFF'0000;

extern "C" [[noreturn]] void reset_handler();

}  // namespace

void reset_board(const ResetRecord& record) {
    write_reset_record(record);
    // A system reset lets the boot loader clear the tightly-coupled memory: these four registers outlast it.
    Pmu::write(pmu::kPersGlobGenStorage0, kStorageMagic | static_cast<std::uint32_t>(record.cause));
    Pmu::write(pmu::kPersGlobGenStorage0 + 4, record.pc);
    Pmu::write(pmu::kPersGlobGenStorage0 + 8, record.status);
    Pmu::write(pmu::kPersGlobGenStorage0 + 12, record.address);
    Crl::write(crl::kResetCtrl, crl::kResetCtrlSoftReset);
    for (int i = 0; i < 1'000'000; ++i) static_cast<void>(Crl::read(crl::kResetCtrl));
    // The emulator has no reset register. Starting over is the next best thing there.
    reset_handler();
}

ResetRecord zcu102::begin_run() {
    ResetRecord record = begin_reset_record();
    const std::uint32_t storage = Pmu::read(pmu::kPersGlobGenStorage0);
    if (record.cause == ResetCause::power_on && (storage & kStorageMagicMask) == kStorageMagic) {
        record = {static_cast<ResetCause>(storage & 0xFF), Pmu::read(pmu::kPersGlobGenStorage0 + 4),
                  Pmu::read(pmu::kPersGlobGenStorage0 + 8), Pmu::read(pmu::kPersGlobGenStorage0 + 12)};
    }
    Pmu::write(pmu::kPersGlobGenStorage0, 0);
    if ((Pmu::read(pmu::kErrorStatus1) & pmu::kErrorLpdSwdt) != 0) record = {.cause = ResetCause::watchdog};
    return record;
}

}  // namespace hal

/// Entered by the vectors with the cause and the address of the instruction.
extern "C" [[noreturn]] void record_fault(std::uint32_t cause, std::uint32_t pc) {
    hal::ResetRecord record{.cause = static_cast<hal::ResetCause>(cause), .pc = pc};
    if (record.cause == hal::ResetCause::data_abort) {
        asm volatile("mrc p15, 0, %0, c5, c0, 0" : "=r"(record.status));   // DFSR
        asm volatile("mrc p15, 0, %0, c6, c0, 0" : "=r"(record.address));  // DFAR
    } else if (record.cause == hal::ResetCause::prefetch_abort) {
        asm volatile("mrc p15, 0, %0, c5, c0, 1" : "=r"(record.status));   // IFSR
        asm volatile("mrc p15, 0, %0, c6, c0, 2" : "=r"(record.address));  // IFAR
    }
    hal::reset_board(record);
}
