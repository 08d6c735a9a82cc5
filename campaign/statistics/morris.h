#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/design.h"

namespace unfurl::campaign {

/// Elementary effects of one input: changes of the response over the change of the input's
/// probability, in the response's unit (1 would be from one end of the input to the other).
struct MorrisEffect {
  double mu = 0.0, mu_error = 0.0;            // mean
  double mu_star = 0.0, mu_star_error = 0.0;  // mean of absolute values [Campolongo et al. 2007]
  double sigma = 0.0;                         // scatter: interaction or curvature
  double sigma_error = 0.0;
  std::size_t n = 0;  // effects whose two runs have a value
  int rank = 0;       // by mu_star, from 1
  /// Inputs of worse rank from which mu_star is not told apart (two standard errors).
  int tied = 0;
};

/// Effects of all inputs.
struct MorrisScreening {
  std::vector<MorrisEffect> inputs;
  std::size_t trajectories = 0;
  std::size_t dropped = 0;  // effects lost to failed runs
  bool usable = false;
  std::vector<std::string> notes;
};

/// From the runs of a Morris design in the order of their index; NaN: failed. Fewer than four
/// trajectories, or an input with fewer than four effects, are not usable.
MorrisScreening ScreenMorris(const Design& design, std::span<const double> values);

}  // namespace unfurl::campaign
