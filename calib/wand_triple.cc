#include "calib/wand_triple.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/dense.h"
#include "base/log_silence.h"
#include "base/pose.h"
#include "base/statistics.h"

namespace unfurl::calib {
namespace {

using Parameters = Eigen::Matrix<double, 7, 3>;
using Block = Eigen::Map<const Parameters>;

constexpr int kOfTriple = 21;        // of three pinholes, seven each
constexpr int kTripleSubsets = 300;  // 30% gross errors leave 99.9% chance of a clean subset of 10
constexpr int kSubset = 10;          // 6 unknowns, and some for perspective to average out
constexpr double kLensShare = 0.03;  // of lengths, what lens error and perspective leave [-]
constexpr double kRowOffset = 0.1;   // of the row, as kOffsetShare of the bundle's prior [-]
constexpr double kWideAngle = 0.8, kAngleSpread = 0.6;  // row over f: 45 degrees, +- half an octave
constexpr double kWidest = 2.0;        // of random views about one axis: nearly any direction
constexpr double kLeastDepth = 0.05;   // over that of the middle: nearer, no lens is in focus [-]
constexpr double kLost = 0.5;          // of a bar: more, and most bars were not found at all
constexpr double kSame = 0.15;         // bars: lens errors make as much of one rig, see kLensShare
constexpr int kTripleIterations = 40;  // a search that needs more is on no good way

// The planes of three readings: rows (a - u b), right-hand sides u - alpha.
bool Meet(const Block& x, const Eigen::Vector3d& u, Eigen::Matrix3d* inverse, Eigen::Vector3d* p) {
  Eigen::Matrix3d planes;
  Eigen::Vector3d right;
  double scale = 1.0;
  for (int j = 0; j < 3; ++j) {
    planes.row(j) = (x.col(j).head<3>() - u(j) * x.col(j).tail<3>()).transpose();
    right(j) = u(j) - x(3, j);
    scale *= planes.row(j).norm();
  }
  const double determinant = planes.determinant();
  if (!(std::abs(determinant) > 1e-6 * scale)) return false;
  *inverse = planes.inverse();
  *p = *inverse * right;
  for (int j = 0; j < 3; ++j) {
    if (!(1.0 + x.col(j).tail<3>().dot(*p) > kLeastDepth)) return false;
  }
  return true;
}

// The length of one bar less 1, by the 21 numbers.
class LengthCost : public ceres::SizedCostFunction<1, kOfTriple> {
 public:
  LengthCost(const Eigen::Vector3d& from, const Eigen::Vector3d& to) : u_{from, to} {}

  bool Evaluate(double const* const* block, double* residual, double** jacobians) const override {
    const Block x(block[0]);
    Eigen::Vector3d p[2];
    Eigen::Matrix3d inverse[2];
    for (int end = 0; end < 2; ++end) {
      if (!Meet(x, u_[end], &inverse[end], &p[end])) return false;
    }
    const Eigen::Vector3d bar = p[1] - p[0];
    const double length = bar.norm();
    if (!(length > 1e-6)) return false;  // of a bar of 1: a direction is divided by it
    residual[0] = (length - 1.0) / kLensShare;
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Map<Parameters> J(jacobians[0]);
    J.setZero();
    for (int end = 0; end < 2; ++end) {
      const Eigen::RowVector3d along =
          (end == 0 ? -1.0 : 1.0) / (length * kLensShare) * bar.transpose() * inverse[end];
      for (int j = 0; j < 3; ++j) {
        J.col(j).head<3>() -= along(j) * p[end];
        J(3, j) -= along(j);
        J.col(j).tail<3>() += along(j) * u_[end](j) * p[end];
      }
    }
    return true;
  }

 private:
  Eigen::Vector3d u_[2];
};

// What is believed of a pinhole: its axis meets the row near the middle, a . b about 0; and its
// field is that of a usual lens, |b| / |a| = row / f.
class PinholeCost : public ceres::SizedCostFunction<6, kOfTriple> {
 public:
  bool Evaluate(double const* const* block, double* residual, double** jacobians) const override {
    const Block x(block[0]);
    Eigen::Map<Eigen::Matrix<double, 6, kOfTriple, Eigen::RowMajor>> J(
        jacobians != nullptr && jacobians[0] != nullptr ? jacobians[0] : scratch_);
    J.setZero();
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d a = x.col(j).head<3>(), b = x.col(j).tail<3>();
      const double aa = a.squaredNorm(), ab = a.dot(b);
      // The square root's derivative at b = 0 is held finite.
      const double size = std::sqrt(b.squaredNorm() / aa + 1e-6);
      residual[2 * j] = ab / (kRowOffset * aa);
      residual[2 * j + 1] = (size - kWideAngle) / kAngleSpread;
      J.block<1, 3>(2 * j, 7 * j) = (b - 2.0 * ab / aa * a).transpose() / (kRowOffset * aa);
      J.block<1, 3>(2 * j, 7 * j + 4) = a.transpose() / (kRowOffset * aa);
      J.block<1, 3>(2 * j + 1, 7 * j) =
          -b.squaredNorm() / (aa * aa * size * kAngleSpread) * a.transpose();
      J.block<1, 3>(2 * j + 1, 7 * j + 4) = b.transpose() / (aa * size * kAngleSpread);
    }
    return true;
  }

 private:
  mutable double scratch_[6 * kOfTriple] = {};
};

// Symmetric Q of d' Q d = 1 by least squares, or false where it is not positive definite.
bool FitMetric(const Eigen::Matrix3Xd& d, const std::vector<Eigen::Index>& use,
               Eigen::Matrix3d* Q) {
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(use.size()), 6);
  for (std::size_t k = 0; k < use.size(); ++k) {
    const Eigen::Vector3d v = d.col(use[k]);
    rows.row(static_cast<Eigen::Index>(k)) << v(0) * v(0), v(1) * v(1), v(2) * v(2),
        2.0 * v(0) * v(1), 2.0 * v(0) * v(2), 2.0 * v(1) * v(2);
  }
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(rows.rows());
  const Eigen::VectorXd q = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(rows).solve(one);
  *Q << q(0), q(3), q(4), q(3), q(1), q(5), q(4), q(5), q(2);
  return Eigen::LLT<Eigen::Matrix3d>(*Q).info() == Eigen::Success;
}

double MetricMisfit(const Eigen::Matrix3Xd& d, const Eigen::Matrix3d& Q) {
  std::vector<double> off;
  for (Eigen::Index k = 0; k < d.cols(); ++k) {
    off.push_back(std::abs(d.col(k).dot(Q * d.col(k)) - 1.0));
  }
  return Median(off);
}

// The positive definite Q of a random subset that fits most poses best.
bool AffineMetric(const Eigen::Matrix3Xd& d, Rng* rng, Eigen::Matrix3d* best) {
  double least = std::numeric_limits<double>::infinity();
  const auto n = static_cast<std::uint64_t>(d.cols());
  for (int trial = 0; trial <= kTripleSubsets; ++trial) {
    std::vector<Eigen::Index> use;
    if (trial == 0) {
      for (Eigen::Index k = 0; k < d.cols(); ++k) use.push_back(k);
    } else {
      for (int k = 0; k < kSubset; ++k) use.push_back(static_cast<Eigen::Index>(rng->Integer(n)));
    }
    Eigen::Matrix3d Q;
    if (!FitMetric(d, use, &Q)) continue;
    const double misfit = MetricMisfit(d, Q);
    if (!(misfit < least)) continue;
    least = misfit;
    *best = Q;
  }
  return std::isfinite(least);
}

Eigen::Vector3d RandomVector(Rng* rng) {
  const double x = rng->Normal(), y = rng->Normal();
  return {x, y, rng->Normal()};
}

double LengthMisfit(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to,
                    const TriplePinholes& triple) {
  std::vector<double> off;
  for (Eigen::Index k = 0; k < from.cols(); ++k) {
    Eigen::Vector3d a, b;
    const bool found = triple.Find(from.col(k), &a) && triple.Find(to.col(k), &b);
    off.push_back(found ? std::abs((b - a).norm() - 1.0) : 1.0);
  }
  return Median(off);
}

// Levenberg-Marquardt from a start, over the poses that it finds in front.
void Search(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to, TriplePinholes* triple) {
  ceres::Problem problem;
  double* x = triple->x.data();
  Eigen::Index used = 0;
  problem.AddResidualBlock(new PinholeCost, nullptr, x);
  for (Eigen::Index k = 0; k < from.cols(); ++k) {
    Eigen::Vector3d a, b;
    if (!triple->Find(from.col(k), &a) || !triple->Find(to.col(k), &b)) continue;
    ++used;
    problem.AddResidualBlock(new LengthCost(from.col(k), to.col(k)), new ceres::CauchyLoss(1.0), x);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = kTripleIterations;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  triple->misfit = LengthMisfit(from, to, *triple);
  // Poses that were not found count as a bar that is off by its whole length.
  const double lost = std::log1p(1.0 / (kLensShare * kLensShare));
  triple->cost = summary.final_cost + 0.5 * lost * static_cast<double>(from.cols() - used);
}

// How far two searches' ends put the bars from each other, RMS after the best motion or mirror
// image [bars]; infinite where they have few in common.
double Apart(const BarReadings& bars, const TriplePinholes& a, const TriplePinholes& b) {
  std::vector<Eigen::Vector3d> by_a, by_b;
  for (const Eigen::Matrix3Xd* end : {&bars.from, &bars.to}) {
    for (Eigen::Index k = 0; k < end->cols(); ++k) {
      Eigen::Vector3d p, q;
      if (!a.Find(end->col(k), &p) || !b.Find(end->col(k), &q)) continue;
      by_a.push_back(p);
      by_b.push_back(q);
    }
  }
  if (by_a.size() < static_cast<std::size_t>(bars.from.cols())) {
    return std::numeric_limits<double>::infinity();
  }
  Eigen::Matrix3Xd p(3, static_cast<Eigen::Index>(by_a.size())), q = p;
  for (std::size_t k = 0; k < by_a.size(); ++k) {
    p.col(static_cast<Eigen::Index>(k)) = by_a[k];
    q.col(static_cast<Eigen::Index>(k)) = by_b[k];
  }
  return std::min(FitRigid(p, q).rms, FitRigid(p, -q).rms);
}

// Where searches begin.
class StartViews {
 public:
  StartViews(const BarReadings& bars, Rng* rng) {
    const Eigen::Matrix3Xd d = bars.to - bars.from;
    // Readings u = A p + alpha with A A' = Q^-1, the frame's turn left open.
    Eigen::Matrix3d Q;
    affine_ = AffineMetric(d, rng, &Q);
    if (affine_) A_ = Eigen::LLT<Eigen::Matrix3d>(Q.inverse()).matrixL();
    size_ = (3.0 * d.rowwise().squaredNorm() / static_cast<double>(d.cols())).cwiseSqrt();
    alpha_ = 0.5 * (bars.from.rowwise().mean() + bars.to.rowwise().mean());
  }

  // The first is by parallel projection. Strong perspective hides the parallel part, or bends it:
  // every other start has views about an axis, near to it or not, with rows of the size that a bar
  // of any direction gives, a third of its square along each.
  TriplePinholes Draw(int start, Rng* rng) const {
    TriplePinholes triple;
    const bool parallel = affine_ && (start % 2 == 1 || start == 0);
    const double spread = kWidest * rng->Uniform();
    for (int j = 0; j < 3; ++j) {
      Eigen::Vector3d a = A_.row(j), view;
      if (parallel) {
        view = a.cross(RandomVector(rng)).normalized();
      } else {
        view = (Eigen::Vector3d::UnitZ() + spread * RandomVector(rng)).normalized();
        a = size_(j) * view.cross(RandomVector(rng)).normalized();
      }
      const bool flat = parallel && start == 0;
      const double wide = flat ? 0.0 : kWideAngle * rng->Uniform(0.3, 1.5);
      triple.x.col(j) << a, alpha_(j), wide * a.norm() * view;
    }
    return triple;
  }

 private:
  bool affine_ = false;
  Eigen::Matrix3d A_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d size_, alpha_;
};

}  // namespace

bool TriplePinholes::Find(const Eigen::Vector3d& u, Eigen::Vector3d* p) const {
  Eigen::Matrix3d inverse;
  return Meet(Block(x.data()), u, &inverse, p);
}

std::vector<TriplePinholes> FitTriple(const BarReadings& bars, int starts, int most,
                                      const std::vector<TriplePinholes>& tried, Rng rng) {
  const LogSilence silence;
  const StartViews views(bars, &rng);
  std::vector<TriplePinholes> ends;
  for (int start = 0; start <= starts; ++start) {
    TriplePinholes triple = views.Draw(start, &rng);
    Search(bars.from, bars.to, &triple);
    if (triple.misfit < kLost) ends.push_back(triple);
  }
  std::stable_sort(ends.begin(), ends.end(), [](const TriplePinholes& a, const TriplePinholes& b) {
    return a.cost < b.cost;
  });
  std::vector<TriplePinholes> out;
  const auto same = [&](const TriplePinholes& end) {
    const auto as_end = [&](const TriplePinholes& other) {
      return Apart(bars, end, other) < kSame;
    };
    return std::any_of(tried.begin(), tried.end(), as_end) ||
           std::any_of(out.begin(), out.end(), as_end);
  };
  for (const TriplePinholes& end : ends) {
    if (static_cast<int>(out.size()) == most) break;
    if (!same(end)) out.push_back(end);
  }
  return out;
}

}  // namespace unfurl::calib
