#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "measure/health.h"

namespace unfurl::measure {

// Of one flash: what is left of readings once the mark may be anywhere, to first order about where
// they put it.
struct FlashTerms {
  std::size_t line = 0;
  int readings = 0;
  double chi_square = 0.0;  // of the place, as PointSolution's
  Eigen::VectorXd r;        // readings less those of the place [px]
  Eigen::MatrixXd P;        // C x C, weights without what a place explains [1/px^2]
  Eigen::MatrixXd G;        // C x r, what the calibration's errors do to readings [px]
};

// The calibration's errors, and each camera's floor as a constant: the model's own error may be the
// same wherever marks go.
class FlashErrors {
 public:
  explicit FlashErrors(const Triangulator& triangulator);
  Eigen::Index columns() const;
  // Of line i, with `taken` px taken off each camera's reading; nothing where no place is near or
  // no reading is left over. `last`: where the mark was, and is.
  std::optional<FlashTerms> TermsOf(const HealthEvidence& evidence, std::size_t i,
                                    std::span<const double> taken, Eigen::Vector3d* last) const;

 private:
  const Triangulator& triangulator_;
  Eigen::MatrixXd factor_;  // of the rig's parameters, without columns that do nothing [unit]
};

// How much wider than white what is left scatters, averaged over a while mark by mark: what the
// lens model misses stays the same for a while. At least 1. `left`: of a flash [px].
double Overdispersion(const HealthEvidence& evidence, std::span<const FlashTerms> flashes,
                      const std::function<Eigen::VectorXd(const FlashTerms&)>& left);

}  // namespace unfurl::measure
