/// Why the board was reset.
#pragma once

#include "hal/bare_metal/reset_record.hpp"

namespace hal::zcu102 {

/// What ended the last run, from memory, from the PMU's persistent registers, or from its error status. Once
/// a start.
ResetRecord begin_run();

}  // namespace hal::zcu102
