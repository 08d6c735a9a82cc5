#include "calib/explain.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/text.h"
#include "calib/explain_parts.h"

namespace unfurl::calib {

std::string Findings::Id(int point) const {
  return "\"" + data_.ids[static_cast<std::size_t>(point)] + "\"";
}

std::string Findings::Ids(const std::vector<int>& points) const {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < points.size() && k < 8; ++k) names.push_back(Id(points[k]));
  if (points.size() > 8) names.push_back(fmt::format("{} more", points.size() - 8));
  return JoinWords(names);
}

std::string Findings::CameraName(int camera) const {
  return "\"" + data_.cameras[static_cast<std::size_t>(camera)] + "\"";
}

void Findings::Add(GrossKind kind, std::vector<int> points, int camera, double size,
                   std::string text) {
  GrossFinding finding{kind, std::move(points), camera, size, std::move(text), true};
  for (const int point : finding.points) {
    const auto& unsure = bundle_.ambiguous;
    if (std::find(unsure.begin(), unsure.end(), point) != unsure.end()) finding.sure = false;
  }
  if (!finding.sure) finding.text += " (or another of its data is wrong)";
  findings_.push_back(std::move(finding));
}

Eigen::Matrix3d Findings::SurveyCov(int point) const {
  const double factor = bundle_.weighting.survey_factor;
  return factor * factor * data_.cov[static_cast<std::size_t>(point)];
}

const char* Name(GrossKind kind) {
  switch (kind) {
    case GrossKind::kSwappedPoints:
      return "swapped points";
    case GrossKind::kShiftedLabels:
      return "shifted labels";
    case GrossKind::kMislabelled:
      return "mislabelled";
    case GrossKind::kExchangedAxes:
      return "exchanged axes";
    case GrossKind::kMirroredAxis:
      return "wrong sign";
    case GrossKind::kAlongOneAxis:
      return "one coordinate";
    case GrossKind::kPrismConstant:
      return "prism constant";
    case GrossKind::kDisplacedPoint:
      return "displaced point";
    case GrossKind::kSwappedReadings:
      return "swapped readings";
    case GrossKind::kSwappedCameras:
      return "swapped cameras";
    case GrossKind::kMirroredReading:
      return "mirrored reading";
    case GrossKind::kSameOffset:
      return "same offset";
    case GrossKind::kWildReading:
      return "wild reading";
  }
  return "";
}

std::vector<GrossFinding> ExplainGross(const Observations& data, const RefinedBundle& bundle,
                                       const ExplainOptions& options) {
  Findings findings(data, bundle);
  ExplainPoints(options, &findings);
  ExplainReadings(&findings);
  return findings.Take();
}

}  // namespace unfurl::calib
