#include "correlate/fit/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/dense.h"
#include "base/error.h"

namespace unfurl::correlate {

namespace {

// Of a direction's information: below, differences of sums of squares are rounding.
constexpr double kRoundOff = 1e-10;

// Sensitivities to combinations of the unknowns that all rows together know to one unit each; what
// they do not determine is left out.
Eigen::MatrixXd Orthonormal(const Eigen::MatrixXd& A) {
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = A * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(scaled.transpose() * scaled));
  const Eigen::VectorXd& values = eigen.eigenvalues();
  Eigen::Index known = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    known += values(i) > kRoundOff * values(values.size() - 1) ? 1 : 0;
  }
  const Eigen::VectorXd unit = values.tail(known).cwiseSqrt().cwiseInverse();
  return scaled * eigen.eigenvectors().rightCols(known) * unit.asDiagonal();
}

}  // namespace

HeldOut PredictHeldOut(const Eigen::VectorXd& r, const Eigen::MatrixXd& A,
                       const std::vector<int>& stretch, double scale) {
  HeldOut out;
  const int count = stretch.empty() ? 0 : *std::max_element(stretch.begin(), stretch.end()) + 1;
  out.score.assign(static_cast<std::size_t>(std::max(0, count)),
                   std::numeric_limits<double>::quiet_NaN());
  out.rows.assign(out.score.size(), 0);
  // Without unknowns, or where none moves anything, the model predicts what it predicts.
  const Eigen::MatrixXd Q = A.cols() > 0 ? Orthonormal(A) : Eigen::MatrixXd(A.rows(), 0);
  const Eigen::Index q = Q.cols();
  const Eigen::VectorXd slope = Q.transpose() * r;
  for (int k = 0; k < count; ++k) {
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < r.size(); ++i) {
      if (stretch[static_cast<std::size_t>(i)] == k && r(i) != 0.0) rows.push_back(i);
    }
    out.rows[static_cast<std::size_t>(k)] = rows.size();
    if (rows.empty()) continue;
    Eigen::VectorXd e = r(rows);
    double squares = e.squaredNorm(), volume = 0.0;
    if (q > 0) {
      const Eigen::MatrixXd own = Q(rows, Eigen::all);
      const Eigen::MatrixXd others = Eigen::MatrixXd::Identity(q, q) - own.transpose() * own;
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(others);
      if (!(eigen.eigenvalues()(0) > kRoundOff)) continue;
      // Where the fit to the others comes out, and the stretch's rows there.
      e -= own * others.ldlt().solve(Eigen::VectorXd(slope - own.transpose() * e));
      squares = e.squaredNorm() - (own.transpose() * e).squaredNorm();
      volume = -eigen.eigenvalues().array().log().sum();
    }
    const auto n = static_cast<double>(rows.size());
    out.score[static_cast<std::size_t>(k)] =
        -0.5 * (n * std::log(2.0 * std::numbers::pi * scale) + volume + squares / scale);
  }
  return out;
}

PredictiveGain CompareHeldOut(const HeldOut& a, const HeldOut& b) {
  if (a.score.size() != b.score.size()) {
    throw Error("fits to unlike records", "CompareHeldOut", "score both on the same stretches");
  }
  PredictiveGain out;
  double squares = 0.0;
  for (std::size_t k = 0; k < a.score.size(); ++k) {
    const double gain = a.score[k] - b.score[k];
    if (std::isnan(gain) || a.rows[k] != b.rows[k]) continue;
    out.gain += gain;
    squares += gain * gain;
    ++out.stretches;
  }
  if (out.stretches < 2) return out;
  const double n = out.stretches, mean = out.gain / n;
  out.sigma = std::sqrt(n * std::max(0.0, squares - n * mean * mean) / (n - 1.0));
  return out;
}

}  // namespace unfurl::correlate
