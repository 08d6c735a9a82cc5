#include <algorithm>

#include "data/trial_health.h"
#include "measure/health.h"

namespace unfurl::measure {

data::TrialHealth RecordOf(const HealthReport& report, const std::vector<std::string>& cameras,
                           const std::vector<std::string>& marks, bool corrected,
                           std::span<const KeptDistance> distances) {
  data::TrialHealth out;
  out.unvouched = Describe(report.unvouched, cameras);
  out.distances = Describe(report.distances, distances, cameras);
  out.distances_kept = report.distances.kept;
  out.unknown = report.unknown;
  out.corrected = corrected;
  out.cameras = cameras;
  const std::size_t slices = report.cameras.empty() ? 0 : report.cameras[0].size();
  const auto n = static_cast<Eigen::Index>(slices), c = static_cast<Eigen::Index>(cameras.size());
  for (Eigen::MatrixXd* one : {&out.offset_px, &out.sigma_px, &out.gain, &out.width_px}) {
    one->resize(n, c);
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    for (Eigen::Index j = 0; j < c; ++j) {
      const HealthSlice& slice =
          report.cameras[static_cast<std::size_t>(j)][static_cast<std::size_t>(k)];
      if (j == 0) out.t.push_back(slice.t);
      out.offset_px(k, j) = slice.offset_px;
      out.sigma_px(k, j) = slice.sigma_px;
      out.gain(k, j) = slice.gain;
      out.width_px(k, j) = slice.width_px;
    }
  }
  for (const Fault& fault : report.faults) {
    const bool late = fault.kind == FaultKind::kLate;
    out.words.push_back(Describe(fault, cameras));
    out.kind.push_back(static_cast<std::int32_t>(fault.kind));
    out.camera.push_back(fault.camera);
    out.certain.push_back(fault.certain() ? 1 : 0);
    out.from.push_back(fault.earliest);
    out.to.push_back(fault.latest);
    out.size.push_back(late ? fault.lag : fault.offset_px);
    out.sigma.push_back(late ? 0.0 : fault.sigma_px);
    out.slope.push_back(fault.slope);
    out.slope_sigma.push_back(fault.slope_sigma);
    out.at.push_back(fault.at);
  }
  const ScatterReport& scatter = report.scatter;
  out.scatter_words = Describe(scatter, cameras, marks);
  out.scatter_unknown = scatter.unknown;
  out.misfit_words = Describe(report.misfit);
  if (report.misfit.wide) {
    out.misfit = report.misfit.all_px;
    out.camera_misfit.assign(cameras.size(), 0.0);
    for (std::size_t k = 0; k < report.misfit.px.size(); ++k) {
      double& most = out.camera_misfit[k % cameras.size()];
      most = std::max(most, report.misfit.px[k]);
    }
  }
  out.wrong_words = DescribeWrong(scatter.wrong, cameras);
  out.wrong.assign(cameras.size(), 0);
  for (const WrongReading& one : scatter.wrong) ++out.wrong[static_cast<std::size_t>(one.camera)];
  out.scatter_wide = scatter.wide;
  if (scatter.unknown.empty()) {
    out.scatter = scatter.all.factor;
    out.scatter_sigma = scatter.all.sigma;
  }
  for (const Scatter& one : scatter.cameras) {
    out.camera_scatter.push_back(one.factor);
    out.camera_scatter_sigma.push_back(one.sigma);
  }
  out.mark_scatter.resize(static_cast<Eigen::Index>(scatter.marks.size()), c);
  for (Eigen::Index m = 0; m < out.mark_scatter.rows(); ++m) {
    for (Eigen::Index k = 0; k < c; ++k) {
      out.mark_scatter(m, k) = scatter.cells[static_cast<std::size_t>(m * c + k)].factor;
    }
  }
  out.marks = marks;
  for (const LightFault& change : report.light) {
    out.light.push_back({.words = Describe(change, cameras, marks),
                         .kind = static_cast<std::int32_t>(change.subject.kind),
                         .camera = change.subject.camera,
                         .mark = change.subject.mark,
                         .certain = change.certain() ? 1 : 0,
                         .from = change.earliest,
                         .to = change.latest,
                         .until = change.until,
                         .size = change.size,
                         .sigma = change.sigma});
  }
  return out;
}

}  // namespace unfurl::measure
