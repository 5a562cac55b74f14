#include "tracking/associator.hpp"

namespace tracking {

template AssociationStatus associate(std::span<AssociationRow<dsp::Real>>, const AssociationInput<dsp::Real>&,
                                     Associator, const OrderStatisticsConfig<dsp::Real>&, const IjipdaConfig&,
                                     AssociatorWorkspace<dsp::Real>&);

}  // namespace tracking
