#include "calib/model_floor.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::calib {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr int kDoublings = 12;    // of a start that was too small
constexpr int kBisections = 20;   // of the floor's logarithm
constexpr double kCloseTo = 0.1;  // of chi-square per degree of freedom, in its standard deviations
constexpr double kNegligible = 0.02;  // of the least reading's sigma: such a floor changes nothing

}  // namespace

FlooredBundle SolveWithFloor(const Observations& data, const std::vector<CameraPrior>& priors,
                             double start_px, const BundleOptions& options, BundleState state,
                             double discard_share) {
  double least_sigma = kInfinite;
  for (const Reading& r : data.readings) least_sigma = std::min(least_sigma, r.s_px);

  FlooredBundle high;
  high.state = std::move(state);
  const auto solve = [&](double floor_px, const BundleState& from) {
    FlooredBundle out{floor_px, from, {}};
    out.summary = SolveBundle(data, priors, floor_px, options, &out.state);
    return out;
  };
  int gross_at_start = 0;
  // Positive: the floor is too low.
  const auto excess = [&](const FlooredBundle& bundle) {
    const double dof = std::max(1.0, bundle.summary.degrees_of_freedom);
    const double discarded = bundle.summary.gross_readings() - gross_at_start;
    if (discarded > discard_share * static_cast<double>(data.readings.size())) return kInfinite;
    return (bundle.summary.chi_square / dof - 1.0) / std::sqrt(2.0 / dof);
  };

  high = solve(std::max(start_px, least_sigma), high.state);
  gross_at_start = high.summary.gross_readings();
  for (int k = 0; k < kDoublings && excess(high) > 0.0; ++k) {
    high = solve(2.0 * high.floor_px, high.state);
    gross_at_start = std::min(gross_at_start, high.summary.gross_readings());
  }
  const double negligible = kNegligible * least_sigma;
  double low = negligible;
  // Down in quarters first: each solution is the next one's start, and few readings change sides.
  while (high.floor_px > negligible) {
    FlooredBundle lower = solve(0.25 * high.floor_px, high.state);
    if (excess(lower) > 0.0) {
      low = lower.floor_px;
      break;
    }
    high = std::move(lower);
  }
  if (high.floor_px <= negligible) return solve(0.0, high.state);

  for (int k = 0; k < kBisections && excess(high) < -kCloseTo; ++k) {
    FlooredBundle middle = solve(std::sqrt(low * high.floor_px), high.state);
    if (excess(middle) > 0.0) {
      low = middle.floor_px;
    } else {
      high = std::move(middle);
    }
  }
  return high;
}

}  // namespace unfurl::calib
