#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/explain.h"
#include "calib/observations.h"
#include "calib/refine.h"

namespace unfurl::calib {

/// What the explanations of points and of readings have in common: the data, the fit, and the
/// findings so far. Holds references.
class Findings {
 public:
  Findings(const Observations& data, const RefinedBundle& bundle) : data_(data), bundle_(bundle) {}

  const Observations& data() const { return data_; }
  const RefinedBundle& bundle() const { return bundle_; }
  /// Covariance of a surveyed place, with the factor on the survey's sigmas [m^2].
  Eigen::Matrix3d SurveyCov(int point) const;
  /// Names as messages have them; of many points the first eight.
  std::string Id(int point) const;
  std::string Ids(const std::vector<int>& points) const;
  std::string CameraName(int camera) const;
  /// One more; unsure where another datum of its points may be the wrong one.
  void Add(GrossKind kind, std::vector<int> points, int camera, double size, std::string text);
  std::vector<GrossFinding> Take() { return std::move(findings_); }

 private:
  const Observations& data_;
  const RefinedBundle& bundle_;
  std::vector<GrossFinding> findings_;
};

/// Explains surveyed points that were left out: labels, prism constants, axes.
void ExplainPoints(const ExplainOptions& options, Findings* findings);
/// Explains readings that were left out: swapped, mirrored, off together, wild.
void ExplainReadings(Findings* findings);

}  // namespace unfurl::calib
