#include "tracking/collision_warning.hpp"

namespace tracking {

static_assert(CollisionWarningConfig<dsp::Real>{}.valid());

template class CollisionWarning<dsp::Real>;

}  // namespace tracking
