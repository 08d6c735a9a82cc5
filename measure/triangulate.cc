#include "measure/triangulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include "base/dense.h"
#include "base/error.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kMaxCameras = CameraBank::kMaxCameras;
using Lanes = std::array<double, kMaxCameras>;

Eigen::Matrix3d Symmetric(const double* s) {
  Eigen::Matrix3d M;
  M << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
  return M;
}

double FloorSquare(const data::Rig& rig, std::size_t camera) {
  const double floor = data::FloorOf(rig, camera);
  return floor * floor;
}

// What a reading's sigma is about, where only its ratio to the model floors matters: 0.01 px of a
// row of 2000 [px].
std::vector<double> TypicalSigmas(const data::Rig& rig) {
  constexpr double kShare = 5e-6;  // of the row
  std::vector<double> s;
  for (const data::RigCamera& camera : rig.cameras) s.push_back(kShare * camera.pixels);
  return s;
}

}  // namespace

void TriangulateOptions::Check() const {
  const RefuseOption refuse("TriangulateOptions");
  const auto positive = [&](const char* name, double value, double below) {
    if (value > 0.0 && value < below) return;
    refuse(name, fmt::format("{} is not between 0 and {:g}", value, below),
           "give a number between them");
  };
  constexpr double kAny = std::numeric_limits<double>::infinity();
  positive("residual_level", residual_level, 1.0);
  positive("max_condition", max_condition, kAny);
  positive("volume_margin", volume_margin, kAny);
  positive("twin_margin", twin_margin, kAny);
  if (shared_tolerance != 0.0) positive("shared_tolerance", shared_tolerance, 1.0);
}

static_assert(static_cast<int>(PointOutcome::kOffPath) + 1 == data::kSampleReasons);

const char* Name(PointOutcome outcome) {
  return outcome == PointOutcome::kSolved ? "solved" : data::Name(ReasonOf(outcome));
}

Triangulator::Triangulator(const data::Rig& rig, const TriangulateOptions& options)
    : rig_(rig),
      options_(options),
      centre_(0.5 * (rig.volume_low + rig.volume_high)),
      size_((rig.volume_high - rig.volume_low).norm()),
      bank_(rig.cameras) {
  assert(rig.cameras.size() <= kMaxCameras);
  options.Check();
  const Eigen::Vector3d size = rig.volume_high - rig.volume_low;
  low_ = rig.volume_low - options.volume_margin * size;
  high_ = rig.volume_high + options.volume_margin * size;
  near_low_ = rig.volume_low - options.twin_margin * size;
  near_high_ = rig.volume_high + options.twin_margin * size;
  limit_.push_back(0.0);
  for (std::size_t dof = 1; dof <= kMaxCameras; ++dof) {
    limit_.push_back(ChiSquareQuantile(1.0 - options.residual_level, static_cast<double>(dof)));
  }

  const auto rows = static_cast<Eigen::Index>(rig.cameras.size()) * data::kCameraParameters;
  if (rig.covariance.rows() != rows || rig.covariance.isZero(0.0)) return;
  // Parameters have units; scaling by their sigmas keeps the small ones from drowning.
  const Eigen::VectorXd sigma = rig.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd inverse = sigma.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(inverse.asDiagonal() * rig.covariance *
                                                             inverse.asDiagonal());
  whole_ = sigma.asDiagonal() * eigen.eigenvectors() *
           eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  // Terms that no camera uses come last and have rows of zeros.
  for (Eigen::Index k = 0; k < rows; ++k) {
    if (sigma(k) > 0.0) {
      parameters_ =
          std::max(parameters_, static_cast<std::size_t>(k % data::kCameraParameters) + 1);
    }
  }
  const std::vector<PointSolution> grid = GridOfVolume();
  ReduceShared(grid);
  FindReadingVariances(grid);
}

void Triangulator::Weights(std::span<const double> u_px, std::span<const double> s_px,
                           std::uint32_t use, double* u, double* w, PointSolution* point) const {
  const std::size_t count = rig_.cameras.size();
  for (std::size_t c = 0; c < bank_.lanes(); ++c) {
    const bool in = c < count && (use >> c & 1U) != 0 && !std::isnan(u_px[c]);
    u[c] = in ? u_px[c] : 0.0;
    w[c] = in ? 1.0 / (s_px[c] * s_px[c] + FloorSquare(rig_, c)) : 0.0;
    if (!in) continue;
    point->cameras |= 1U << c;
    ++point->readings;
  }
}

PointSolution Triangulator::Solve(std::span<const double> u_px, std::span<const double> s_px,
                                  const Eigen::Vector3d& start, std::uint32_t use) const {
  // At most four of the longest lead across the volume; the rest are for converging.
  constexpr int kMaxSteps = 15;
  // Over the volume's size. The step that would come next: a hundredth of the error of a reading of
  // 0.001 px in a row of thousands. The longest step: the surfaces bend, but not much.
  const double converged_at = 3e-9 * size_, longest = 0.25 * size_;

  PointSolution point;
  Lanes u, w;
  Weights(u_px, s_px, use, u.data(), w.data(), &point);
  if (point.readings < 3) return point;

  point.p = start;
  point.outcome = PointOutcome::kOutside;
  CameraBank::Sums sums;
  Eigen::Matrix3d inverse;
  double before = 0.0;
  bool converged = false;
  for (int step = 0; step < kMaxSteps && !converged; ++step) {
    bank_.Accumulate(point.p.data(), u.data(), w.data(), &sums);
    if (!sums.in_front) return point;
    const Eigen::Matrix3d A = Symmetric(sums.JwJ);
    bool invertible = false;
    double determinant = 0.0;
    A.computeInverseAndDetWithCheck(inverse, determinant, invertible, 0.0);
    const Eigen::Vector3d g(sums.Jwr[0], sums.Jwr[1], sums.Jwr[2]);
    Eigen::Vector3d dp = inverse * g;
    const double length = dp.norm();
    if (!(determinant > 0.0) || !std::isfinite(length)) {
      point.outcome = PointOutcome::kParallel;
      return point;
    }
    if (length > longest) {
      dp *= longest / length;
    } else {
      // Steps shrink by a factor that itself shrinks, so the next is shorter than this estimate;
      // over a last step as short as that, residuals change by J dp and J not at all.
      converged = length < converged_at || length * length < converged_at * before;
      point.chi_square = std::max(0.0, sums.chi_square - g.dot(dp));
    }
    point.p += dp;
    before = std::min(length, longest);
  }

  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(Symmetric(sums.JJ), Eigen::EigenvaluesOnly);
  const double weakest = eigen.eigenvalues()(0);
  point.dilution = weakest > 0.0 ? 1.0 / std::sqrt(weakest) : HUGE_VAL;
  point.condition = weakest > 0.0 ? std::sqrt(eigen.eigenvalues()(2) / weakest) : HUGE_VAL;
  if (!(point.condition <= options_.max_condition)) {
    point.outcome = PointOutcome::kParallel;
    return point;
  }
  if (!converged || !(point.p.array() >= low_.array()).all() ||
      !(point.p.array() <= high_.array()).all()) {
    return point;
  }
  point.cov = inverse;
  const int dof = point.readings - 3;
  const double limit = limit_[static_cast<std::size_t>(dof)];
  if (dof > 0 && point.chi_square > limit) {
    point.chi_square = ChiSquareWithCalibration(u.data(), w.data(), point, limit);
  }
  point.outcome =
      dof > 0 && point.chi_square > limit ? PointOutcome::kDisagree : PointOutcome::kSolved;
  return point;
}

bool Triangulator::NearVolume(const Eigen::Vector3d& p) const {
  return (p.array() >= near_low_.array()).all() && (p.array() <= near_high_.array()).all();
}

bool Triangulator::SecondSolution(std::span<const double> u_px, std::span<const double> s_px,
                                  const PointSolution& point, PointSolution* twin) const {
  // Along the curve on which two of the surfaces meet, the third reading is nearly a parabola. Its
  // slope is the weakest singular value of J, its bend is what three points on the chord show; so
  // the second root is known to first order, and Newton's method does the rest.
  // Over the volume's size: half the chord; and what is nearer than this is the same solution.
  const double reach = 0.05 * size_, same = 3e-6 * size_;
  constexpr double kFarthest =
      3.0;  // in sizes of the volume; beyond that the parabola tells nothing
  if (point.readings != 3) return false;
  const CameraBank& bank = bank_;
  Eigen::Matrix3d J;
  std::array<std::size_t, 3> used{};
  for (std::size_t c = 0, k = 0; c < rig_.cameras.size(); ++c) {
    if ((point.cameras >> c & 1U) == 0) continue;
    Projection here;
    if (!Project(rig_.cameras[c], point.p, &here)) return false;
    J.row(static_cast<Eigen::Index>(k)) = here.du_dp;
    used[k++] = c;
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(J.transpose() * J);
  const Eigen::Vector3d along = eigen.eigenvectors().col(0);
  const Eigen::Vector3d left = J * along;  // its length is the singular value
  Lanes ahead, behind, here;
  bank.Readings(Eigen::Vector3d(point.p + reach * along).data(), ahead.data());
  bank.Readings(Eigen::Vector3d(point.p - reach * along).data(), behind.data());
  bank.Readings(point.p.data(), here.data());
  double bend = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t c = used[k];
    bend += left(static_cast<Eigen::Index>(k)) * (ahead[c] + behind[c] - 2.0 * here[c]) /
            (reach * reach);
  }
  const double root = -2.0 * left.squaredNorm() / bend;
  const double farthest = kFarthest * size_;
  if (!(std::abs(root) < farthest)) return false;
  for (const double part : {1.0, 0.6, 1.6, 0.3}) {  // should the curve be no parabola out there
    const Eigen::Vector3d start = (point.p + part * root * along).cwiseMax(low_).cwiseMin(high_);
    *twin = Solve(u_px, s_px, start, point.cameras);
    if (twin->outcome != PointOutcome::kSolved || (twin->p - point.p).norm() < same) continue;
    return NearVolume(twin->p) || !NearVolume(point.p);
  }
  return false;
}

void Triangulator::Residuals(std::span<const double> u_px, const PointSolution& point,
                             std::span<double> out) const {
  Lanes at;
  bank_.Readings(point.p.data(), at.data());
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    out[c] =
        (point.cameras >> c & 1U) != 0 ? u_px[c] - at[c] : std::numeric_limits<double>::quiet_NaN();
  }
}

void Triangulator::SharedFactor(const PointSolution& point, std::span<const double> s_px,
                                Eigen::Ref<Eigen::Matrix3Xd> F, Eigen::Matrix3d* rest) const {
  // The readings are held; the point moves with the rig: A dp = -sum w du_dp^T du_dc dc.
  constexpr std::size_t kColumnsAtOnce = 128;
  const std::size_t columns = rest == nullptr ? rank_ : columns_;
  F.setZero();
  if (rest != nullptr) rest->setZero();
  std::array<Projection, kMaxCameras> here;
  std::array<Eigen::Vector3d, kMaxCameras> lever;
  std::uint32_t used = 0;
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    if ((point.cameras >> c & 1U) == 0 || !Project(rig_.cameras[c], point.p, &here[c])) continue;
    used |= 1U << c;
    const double w = 1.0 / (s_px[c] * s_px[c] + FloorSquare(rig_, c));
    lever[c] = -w * (point.cov * here[c].du_dp.transpose());
  }
  std::array<double, kColumnsAtOnce> row;
  std::array<double, 3 * kColumnsAtOnce> part;
  for (std::size_t first = 0; first < columns; first += kColumnsAtOnce) {
    const std::size_t count = std::min(kColumnsAtOnce, columns - first);
    std::fill_n(part.begin(), 3 * count, 0.0);
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      if ((used >> c & 1U) == 0) continue;
      std::fill_n(row.begin(), count, 0.0);
      AddWeightedRows(&rows_[c * data::kCameraParameters * columns_ + first], columns_,
                      here[c].du_dc.data(), parameters_, count, row.data());
      AddOuter(lever[c].data(), row.data(), count, part.data());
    }
    const Eigen::Map<const Eigen::Matrix3Xd> block(part.data(), 3,
                                                   static_cast<Eigen::Index>(count));
    const std::size_t kept = rank_ > first ? std::min(count, rank_ - first) : 0;
    const auto at = static_cast<Eigen::Index>(first), n = static_cast<Eigen::Index>(kept);
    if (n > 0)
      F.middleCols(at, n) = block.leftCols(n);  // beyond the rank `at` is none of its columns
    if (rest != nullptr) {
      const auto left = block.rightCols(static_cast<Eigen::Index>(count) - n);
      rest->noalias() += left * left.transpose();
    }
  }
}

// Points on a grid over the volume, with all cameras and with each one missing.
std::vector<PointSolution> Triangulator::GridOfVolume() const {
  constexpr int kGrid = 5;  // points along each edge: what is sought varies little between them
  std::vector<PointSolution> points;
  std::vector<double> u(rig_.cameras.size());
  const std::vector<double> s = TypicalSigmas(rig_);
  const Eigen::Vector3d span = rig_.volume_high - rig_.volume_low;
  for (int i = 0; i < kGrid * kGrid * kGrid; ++i) {
    const int plane = i / (kGrid * kGrid), row = i / kGrid % kGrid;
    const Eigen::Vector3d at(i % kGrid, row, plane);
    const Eigen::Vector3d p = rig_.volume_low + span.cwiseProduct(at) / (kGrid - 1.0);
    bool in_front = true;
    for (std::size_t c = 0; c < u.size(); ++c) {
      in_front = in_front && Project(rig_.cameras[c], p, &u[c]);
    }
    if (!in_front) continue;
    const int missing = rig_.cameras.size() > 3 ? static_cast<int>(rig_.cameras.size()) : 0;
    for (int m = -1; m < missing; ++m) {
      const PointSolution point = Solve(u, s, p, m < 0 ? ~0U : ~(1U << m));
      if (point.outcome == PointOutcome::kSolved) points.push_back(point);
    }
  }
  return points;
}

void Triangulator::ReduceShared(std::span<const PointSolution> points) {
  if (whole_.size() == 0 || points.empty()) return;
  const auto store = [this](const Eigen::MatrixXd& turned) {
    columns_ = static_cast<std::size_t>(turned.cols());
    rows_.resize(static_cast<std::size_t>(turned.size()));
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        rows_.data(), turned.rows(), turned.cols()) = turned;
  };
  store(whole_);
  rank_ = columns_;
  const std::vector<double> s = TypicalSigmas(rig_);
  // Three rows a sample, of a norm of one together.
  Eigen::MatrixXd samples(3 * static_cast<Eigen::Index>(points.size()), whole_.cols());
  Eigen::Index count = 0;
  Eigen::Matrix3Xd F(3, whole_.cols());
  for (const PointSolution& point : points) {
    SharedFactor(point, s, F);
    const double norm = F.norm();
    if (norm > 0.0) samples.middleRows(3 * count++, 3) = F / norm;
  }
  samples.conservativeResize(3 * count, Eigen::NoChange);
  Eigen::MatrixXd moment = Eigen::MatrixXd::Zero(whole_.cols(), whole_.cols());
  moment.selfadjointView<Eigen::Lower>().rankUpdate(samples.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> space(moment);
  const Eigen::MatrixXd basis = space.eigenvectors().rowwise().reverse();
  // What each sample has left after the first k directions, tracked as k grows.
  const Eigen::MatrixXd turned = (samples * basis).cwiseAbs2();
  std::vector<double> left(static_cast<std::size_t>(count), 1.0);
  Eigen::Index k = 0;
  while (k < basis.cols() && !left.empty() &&
         *std::max_element(left.begin(), left.end()) > options_.shared_tolerance) {
    for (Eigen::Index i = 0; i < count; ++i) {
      left[static_cast<std::size_t>(i)] -= turned.col(k).segment<3>(3 * i).sum();
    }
    ++k;
  }
  store(whole_ * basis);
  rank_ = static_cast<std::size_t>(k);
}

}  // namespace unfurl::measure
