// What the calibration's errors do to the residuals of one point's readings.
#include <algorithm>
#include <array>

#include "base/dense.h"
#include "measure/camera_model.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

namespace {

constexpr auto kMostReadingsOfPoint = static_cast<int>(CameraBank::kMaxCameras);
// By what a reading's variance beyond the grid over the volume may exceed the largest on it: twice
// the error. It only spares points that are far from any the work of finding out [-].
constexpr double kBeyondGrid = 4.0;

// Of fixed size: nothing is allocated.
using ByReading = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostReadingsOfPoint,
                                kMostReadingsOfPoint>;
using OfReading = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostReadingsOfPoint, 1>;
using ByPlace = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMostReadingsOfPoint, 3>;

}  // namespace

void Triangulator::FindReadingVariances(std::span<const PointSolution> points) {
  reading_variance_.assign(rig_.cameras.size(), 0.0);
  for (const PointSolution& point : points) {
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      Projection here;
      if (!Project(rig_.cameras[c], point.p, &here)) continue;
      const auto rows = whole_.middleRows(static_cast<Eigen::Index>(c) * data::kCameraParameters,
                                          data::kCameraParameters);
      reading_variance_[c] =
          std::max(reading_variance_[c], kBeyondGrid * (here.du_dc * rows).squaredNorm());
    }
  }
}

// With r the residuals and W the weights, G what a unit of each of the calibration's errors does to
// readings and P what is left of whitened readings once the point is found:
//   (P W^1/2 r)^T (1 + P W^1/2 G G^T W^1/2 P)^-1 (P W^1/2 r).
double Triangulator::ChiSquareWithCalibration(const double* u, const double* w,
                                              const PointSolution& point, double limit) const {
  if (reading_variance_.empty()) return point.chi_square;
  // No variance of the whitened residuals is larger than the sum of all of the readings'.
  double most = 1.0;
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    if ((point.cameras >> c & 1U) != 0) most += w[c] * reading_variance_[c];
  }
  if (point.chi_square > limit * most) return point.chi_square;
  const int n = point.readings;
  OfReading r(n), root(n);
  ByPlace J(n, 3);
  std::array<Projection, CameraBank::kMaxCameras> here;
  std::array<std::size_t, CameraBank::kMaxCameras> camera{};
  int k = 0;
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    if ((point.cameras >> c & 1U) == 0) continue;
    if (!Project(rig_.cameras[c], point.p, &here[c])) return point.chi_square;
    camera[static_cast<std::size_t>(k)] = c;
    root(k) = std::sqrt(w[c]);
    r(k) = root(k) * (u[c] - here[c].u_px);
    J.row(k) = root(k) * here[c].du_dp;
    ++k;
  }
  constexpr std::size_t kColumnsAtOnce = 64;  // 16 kB for 32 readings: stays in the cache
  Eigen::Matrix<double, Eigen::Dynamic, kColumnsAtOnce, Eigen::RowMajor, kMostReadingsOfPoint> G(
      n, kColumnsAtOnce);
  ByReading S = ByReading::Zero(n, n);
  for (std::size_t first = 0; first < columns_; first += kColumnsAtOnce) {
    const std::size_t count = std::min(kColumnsAtOnce, columns_ - first);
    G.setZero();
    for (k = 0; k < n; ++k) {
      const std::size_t c = camera[static_cast<std::size_t>(k)];
      AddWeightedRows(&rows_[c * data::kCameraParameters * columns_ + first], columns_,
                      here[c].du_dc.data(), parameters_, count, G.row(k).data());
      G.row(k) *= root(k);
    }
    S.noalias() += G * G.transpose();
  }
  ByReading P = ByReading::Identity(n, n);
  P.noalias() -= J * point.cov * J.transpose();
  S = (P * S * P).eval();
  S.diagonal().array() += 1.0;
  const OfReading left = P * r;
  return left.dot(S.llt().solve(left));
}

}  // namespace unfurl::measure
