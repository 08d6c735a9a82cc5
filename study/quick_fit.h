#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "correlate/shifted_model.h"
#include "study/fit_study.h"

namespace unfurl::study {

/// A fit of a study on the lowest rung of its ladder, what the finer rungs add to the study as it
/// is being added as it stands.
struct QuickFit {
  BoundStudy binding;  ///< as it was fitted
  correlate::FitResult result;
  /// By trial, what the finer rungs really add at the estimate less what was added, in the samples'
  /// own sigmas, in rows as those of a registration; empty: not known.
  std::vector<Eigen::VectorXd> stale;
};

/// Fits of versions of one study that differ from it by an effect or two, at a third of the price
/// of a fit that climbs its own ladder. They tell as much as that one where what they leave in the
/// residuals is large beside `stale`: with rows r of such a fit, no parameters of the finest rung
/// bring the residuals below |r| - |stale|.
class QuickFits {
 public:
  /// `as_is` must outlive it, and its fit must be usable.
  explicit QuickFits(const StudyFit& as_is);

  /// Nothing where the study has no ladder, or the version another one, or a model fails there.
  std::optional<QuickFit> Fit(const data::Study& version, std::size_t workers) const;

 private:
  struct Motions {
    std::shared_ptr<const correlate::SampledModel> coarse, fine;
  };
  const StudyFit& as_is_;
  std::vector<Motions> motions_;  // by trial; empty: no ladder
};

}  // namespace unfurl::study
