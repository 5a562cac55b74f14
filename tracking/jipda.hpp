/// Joint integrated probabilistic data association: exact existence and association of targets that share
/// measurements.
#pragma once

#include "tracking/existence.hpp"
#include "tracking/jpda.hpp"

namespace tracking {

/// Fills beta and missed (conditional on existence, summing to 1) of every row and updates `existence`, one
/// predicted probability a row. The joint posterior of a row is
///     absent               1 - existence
///     present and missed   existence * missed
///     present and z_j      existence * beta_j.
///
/// Source: Musicki and Evans 2004, as JPDA with q psi in place of q: a track is without a measurement with
/// weight 1 - q psi, has z_j with weight psi PD N / lambda. jpda solves it; its limits, its fallback
/// and its fixed-point error are those stated there.
/// `log_ratio` and `log_missed` are changed on the way and do not come back.
template <class S, class Workspace>
JpdaStatus jipda(std::span<AssociationRow<S>> rows, std::span<S> existence, Workspace& work) {
    std::array<S, kMaxTracks> present_of_missed;
    for (std::size_t t = 0; t < rows.size(); ++t) {
        AssociationRow<S>& row = rows[t];
        const S log_psi = ln(existence[t]);
        for (Candidate<S>& c : row.candidates()) c.log_ratio += log_psi;
        const S present = existence[t] * exp(row.log_missed);
        const S without = (S(1) - existence[t]) + present;
        present_of_missed[t] = without > S(0) ? share_of<S>(weight_of(present), weight_of(without)) : S(1);
        row.log_missed = ln(without);
    }
    const JpdaStatus status = jpda(rows, work);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        AssociationRow<S>& row = rows[t];
        const Weight<S> missed = weight_of(row.missed) * weight_of(present_of_missed[t]);
        Weight<S> present = missed;
        for (const Candidate<S>& c : row.candidates()) present += weight_of(c.beta);
        const Weight<S> absent = weight_of(row.missed) * weight_of(S(1) - present_of_missed[t]);
        if (!(Weight<S>{} < present)) {
            existence[t] = S(0);
            row.missed = row.missed_weight = S(1);
            for (Candidate<S>& c : row.candidates()) c.beta = c.weight = S(0);
            continue;
        }
        existence[t] = share_of<S>(present, present + absent);
        row.missed = row.missed_weight = share_of<S>(missed, present);
        for (Candidate<S>& c : row.candidates()) c.beta = c.weight = share_of<S>(weight_of(c.beta), present);
    }
    return status;
}

}  // namespace tracking
