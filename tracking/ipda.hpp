/// Integrated probabilistic data association: PDA that also says whether the target exists.
///
/// Source: Musicki, Evans and Stankovic 1994. With amplitude information (Lerro and Bar-Shalom 1993) the
/// logarithm of the amplitude ratio is added to `log_ratio` when the row is made; nothing else changes, here
/// or in the multi-target forms, whose clutter modulation then contains it too.
#pragma once

#include "tracking/existence.hpp"

namespace tracking {

/// ln of the amplitude likelihood ratio, target against clutter, of a square-law detector output.
///
/// amplitude: in units of the mean clutter output, a > threshold. snr: mean target output is 1 + snr.
/// Clutter f0 = e^-a, target f1 = e^(-a/(1+snr)) / (1+snr) (Swerling 1), each normalised over a > threshold:
///     ln Lambda = (a - threshold) snr / (1 + snr) - ln(1 + snr).
/// The 2020 paper prints f1 with a factor a, which is not a density and contradicts its own
/// PD = e^(-threshold/(1+snr)); it is left out here. The threshold form of the paper's equation 22, f1/PD
/// against f0/Pfa, is the same expression.
template <class S>
S log_amplitude_ratio(S amplitude, S threshold, S snr) {
    const S spread = S(1) + snr;
    return (amplitude - threshold) * (snr / spread) - ln(spread);
}

/// Fills beta and missed (conditional on existence, summing to 1) of every row, each on its own, and updates
/// `existence`, one predicted probability a row.
///
/// No measurement in the gate: psi+ = (1-q) psi / (1 - q psi). In fixed point within 4 LSB of the exact
/// values. Cost one exponential and one division a candidate.
template <class S>
void ipda(std::span<AssociationRow<S>> rows, std::span<S> existence) {
    std::array<Weight<S>, kMaxGated> weight;
    for (std::size_t t = 0; t < rows.size(); ++t) {
        const auto count = static_cast<std::size_t>(rows[t].count);
        for (std::size_t c = 0; c < count; ++c) weight[c] = weight_exp(rows[t].item[c].log_ratio);
        detail::conclude_row<S>(rows[t], existence[t], weight_exp(rows[t].log_missed),
                                {weight.data(), count});
    }
}

}  // namespace tracking
