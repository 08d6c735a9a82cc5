#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/correlation.h"
#include "campaign/statistics/design.h"
#include "campaign/statistics/distribution.h"
#include "data/campaign.h"

namespace unfurl::campaign {

/// The values of a plan's variables in every run, each a function of the plan and the run's index
/// alone.
class Inputs {
 public:
  /// Throws Error (file:line:key) for distributions, correlations or a design that are none.
  explicit Inputs(data::Campaign plan);

  /// The plan it was made from.
  const data::Campaign& plan() const { return plan_; }
  /// Runs that the design has; of one that is grown, so far.
  std::uint64_t runs() const;
  /// The same plan with another number of runs, for designs that can be extended.
  Inputs WithRuns(std::uint64_t runs) const;

  /// The design's point in the unit cube, before variables are correlated, d numbers.
  void Point(std::uint64_t run, std::span<double> u) const;
  /// Values of the variables, d numbers [units].
  void Values(std::uint64_t run, std::span<double> x) const;
  /// The same at any point of the unit cube.
  void ValuesAt(std::span<const double> u, std::span<double> x) const;
  /// Medians, which a job can be tried with.
  std::vector<double> Typical() const;

  /// Whether points are drawn from the distributions: not those of a grid, a file or Morris, from
  /// which no probability follows.
  bool Drawn() const;
  const Design& design() const { return design_; }  ///< not of a plan whose runs are rows
  const std::vector<Distribution>& distributions() const { return distributions_; }

 private:
  bool HasRows() const;

  data::Campaign plan_;
  std::vector<Distribution> distributions_;  // none of a plan whose runs come from a file
  Correlation correlation_;
  Design design_;
};

/// Whether runs can be added to a design without changing those that are there.
bool Extendable(data::CampaignDesign::Kind kind);

}  // namespace unfurl::campaign
