#include "measure/health_view.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

double FloorSquare(const Triangulator& triangulator, std::size_t camera) {
  const double floor = data::FloorOf(triangulator.rig(), camera);
  return floor * floor;
}

}  // namespace

CameraView ViewOf(const HealthEvidence& evidence, const Triangulator& triangulator, int camera,
                  std::size_t marks) {
  CameraView view;
  view.camera = camera;
  const auto c = static_cast<std::size_t>(camera);
  const std::size_t cameras = triangulator.cameras();
  std::vector<Eigen::Vector3d> last(marks, triangulator.centre());
  std::array<double, CameraBank::kMaxCameras> u{}, s{};
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence.mark(i) < 0) continue;
    for (std::size_t k = 0; k < cameras; ++k) {
      u[k] = evidence.At(i, k).u_px;
      s[k] = evidence.At(i, k).s_px;
    }
    Eigen::Vector3d& start = last[static_cast<std::size_t>(evidence.mark(i))];
    const auto solve = [&](const Eigen::Vector3d& from) {
      return triangulator.Solve({u.data(), cameras}, {s.data(), cameras}, from, ~(1U << c));
    };
    PointSolution point = solve(start);
    const auto solved = [&] {
      return point.outcome == PointOutcome::kSolved || point.outcome == PointOutcome::kDisagree;
    };
    if (!solved()) point = solve(triangulator.centre());
    if (!solved()) continue;
    Projection seen;
    if (!Project(triangulator.rig().cameras[c], point.p, &seen)) continue;
    start = point.p;
    view.line.push_back(i);
    view.t.push_back(evidence.t(i));
    view.predicted.push_back(seen.u_px);
    view.variance.push_back(seen.du_dp * point.cov * seen.du_dp.transpose());
    view.rest.push_back(point.chi_square);
  }
  return view;
}

Residuals ResidualsOf(const HealthEvidence& evidence, const Triangulator& triangulator,
                      const CameraView& view, int lag, double wild) {
  const auto c = static_cast<std::size_t>(view.camera);
  const double row = triangulator.rig().cameras[c].pixels;
  const double floor = FloorSquare(triangulator, c);
  Residuals out;
  for (std::size_t i = 0; i < view.size(); ++i) {
    const std::ptrdiff_t from = evidence.After(view.line[i], lag);
    const HealthEvidence::Reading reading =
        from < 0 ? HealthEvidence::Reading{} : evidence.At(static_cast<std::size_t>(from), c);
    const bool any = !std::isnan(reading.u_px);
    const double s = reading.s_px;
    const double variance = view.variance[i] + s * s + floor;
    out.r.push_back(any ? reading.u_px - view.predicted[i] : 0.0);
    out.weight.push_back(any ? 1.0 / variance : 0.0);
    // Where a wrong reading, anywhere in the row, is as likely as a good one so far off.
    const double peak = (1.0 - wild) * row / (wild * std::sqrt(2.0 * M_PI * variance));
    out.cap.push_back(2.0 * std::log(std::max(peak, 1.0)));
  }
  return out;
}

}  // namespace unfurl::measure
