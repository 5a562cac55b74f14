#include "tracking/tracker.hpp"

namespace tracking {

static_assert(TrackerConfig<dsp::Real>{}.valid());

template class Tracker<dsp::Real>;

}  // namespace tracking
