/// Nearest neighbour association.
#pragma once

#include <cstddef>
#include <span>

#include "tracking/association.hpp"

namespace tracking {

/// The likeliest measurement in the gate is taken as the track's, without doubt; each track for itself, so
/// two tracks may take the same one. With one R for all measurements the likeliest is the one of least nu'
/// S^-1 nu; Lee and Kim 2000 print nu' nu, which would add metres to metres per second. A tie goes to the
/// lower index. Cost: one pass.
template <class S>
void nearest_neighbour(std::span<AssociationRow<S>> rows) {
    for (AssociationRow<S>& row : rows) {
        const Candidate<S>* nearest = nullptr;
        for (const Candidate<S>& c : row.candidates()) {
            if (nearest == nullptr || c.log_ratio > nearest->log_ratio) nearest = &c;
        }
        for (Candidate<S>& c : row.candidates()) c.beta = &c == nearest ? S(1) : S(0);
        row.missed = nearest == nullptr ? S(1) : S(0);
        use_betas_as_weights(row);
    }
}

}  // namespace tracking
