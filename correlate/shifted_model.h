#pragma once

#include <memory>

#include "correlate/sampled_model.h"

namespace unfurl::correlate {

/// A model with the difference between two others added, `to` less `from`, as a function of time
/// alone: what a finer mesh does to a motion, say, on top of a coarse one that differs from it a
/// little. Marks, quantities and times of events that either has not stay as they are.
class ShiftedModel : public Model {
 public:
  /// `base` must outlive it.
  ShiftedModel(const Model& base, std::shared_ptr<const SampledModel> from,
               std::shared_ptr<const SampledModel> to)
      : base_(base), from_(std::move(from)), to_(std::move(to)) {}

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override;

 private:
  const Model& base_;
  std::shared_ptr<const SampledModel> from_, to_;
};

}  // namespace unfurl::correlate
