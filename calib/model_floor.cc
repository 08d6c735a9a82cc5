#include "calib/model_floor.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::calib {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr int kDoublings = 12;    // of a start that was too small
constexpr int kSearch = 25;       // solves between a floor too low and one too high
constexpr double kCloseTo = 0.1;  // of chi-square per degree of freedom, in its standard deviations
constexpr double kNegligible = 0.02;  // of the least reading's sigma: such a floor changes nothing

// A floor's square and what is left of  dof / chi-square - 1, which is nearly linear in it and
// negative where the floor is too low; -infinity where the loss had to discard too much.
struct Trial {
  double square = 0.0;
  double balance = 0.0;
};

// The next square to try between a floor too low and one too high: by the straight line through
// both, kept away from either end, or their geometric mean where there is no line.
double Between(const Trial& low, const Trial& high, double least) {
  if (low.balance == -kInfinite) return std::sqrt(std::max(low.square, least) * high.square);
  const double share = low.balance / (low.balance - high.balance);
  return low.square + std::clamp(share, 0.02, 0.98) * (high.square - low.square);
}

}  // namespace

FlooredBundle SolveWithFloor(const Observations& data, const std::vector<CameraPrior>& priors,
                             double start_px, const BundleOptions& options,
                             const BundleState& state, double discard_share) {
  double least_sigma = kInfinite;
  for (const Reading& r : data.readings) least_sigma = std::min(least_sigma, r.s_px);
  const auto solve = [&](double floor_px, const BundleState& from) {
    FlooredBundle out{floor_px, from, {}};
    out.summary = SolveBundle(data, priors, EqualWeighting(data, floor_px), options, &out.state);
    return out;
  };
  int gross_at_start = 0;
  const auto judge = [&](const FlooredBundle& bundle) {
    Trial trial{bundle.floor_px * bundle.floor_px, -kInfinite};
    const double discarded = bundle.summary.gross_readings() - gross_at_start;
    if (discarded > discard_share * static_cast<double>(data.readings.size())) return trial;
    const double per_dof =
        bundle.summary.chi_square / std::max(1.0, bundle.summary.degrees_of_freedom);
    trial.balance = 1.0 / std::max(per_dof, 1e-12) - 1.0;
    return trial;
  };

  FlooredBundle best = solve(std::max(start_px, least_sigma), state);
  gross_at_start = best.summary.gross_readings();
  for (int k = 0; k < kDoublings && judge(best).balance < 0.0; ++k) {
    best = solve(2.0 * best.floor_px, best.state);
    gross_at_start = std::min(gross_at_start, best.summary.gross_readings());
  }
  Trial high = judge(best);
  FlooredBundle without = solve(0.0, best.state);
  Trial low = judge(without);
  if (low.balance >= 0.0) return without;

  const double negligible = kNegligible * kNegligible * least_sigma * least_sigma;
  for (int k = 0; k < kSearch && high.square > negligible; ++k) {
    const double dof = std::max(1.0, best.summary.degrees_of_freedom);
    if (high.balance < kCloseTo * std::sqrt(2.0 / dof)) break;
    FlooredBundle middle = solve(std::sqrt(Between(low, high, negligible)), best.state);
    const Trial trial = judge(middle);
    if (trial.balance < 0.0) {
      low = trial;
    } else {
      high = trial;
      best = std::move(middle);
    }
  }
  return best;
}

}  // namespace unfurl::calib
