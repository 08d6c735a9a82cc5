#include "correlate/fit/noise_contrasts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/dense.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// The longest correlation time, in lengths of the longest series: over one of these such noise
// moves by less than half its standard deviation, sqrt(2 / kLongest). Slower noise is, to a record,
// a constant and a random walk, whose rate the variance takes up.
constexpr double kLongest = 10.0;
// An orthonormal basis of what the unknowns can do to a series: all that the free ones can, of any
// unit; of the calibration's directions, whose draws have variance 1, what they are felt by. Where
// a mark hardly moves these differ by next to nothing, and the rest of them is the samples' own
// scatter, at which they were evaluated: taking that out would take the noise out of the residuals.
Eigen::MatrixXd Touched(const Eigen::MatrixXd& free, const Eigen::MatrixXd& limited) {
  constexpr double kFelt = 3.0;  // norm over the series, in its samples' sigmas
  const Eigen::Index n = free.rows();
  const Eigen::VectorXd scale = free.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(free * scale.asDiagonal());
  qr.setThreshold(1e-7);
  const Eigen::Index rank = n > 0 ? qr.rank() : 0;
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(n, rank);
  if (n == 0) return basis;
  basis = qr.householderQ() * Eigen::MatrixXd::Identity(n, rank);
  if (limited.cols() == 0) return basis;
  Eigen::MatrixXd rest = limited;
  for (int twice = 0; twice < 2; ++twice) rest -= basis * (basis.transpose() * rest);
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(rest, Eigen::ComputeThinU);
  Eigen::Index felt = 0;
  while (felt < svd.singularValues().size() && svd.singularValues()(felt) > kFelt) ++felt;
  Eigen::MatrixXd both(n, rank + felt);
  both << basis, svd.matrixU().leftCols(felt);
  return both;
}

}  // namespace

double LargestRho(double length) { return 1.0 - 1.0 / (kLongest * length); }

FilterStep StepOfFilter(const MarkovNoise& noise, double gap, double* left) {
  FilterStep step;
  const double share = std::min(noise.share, kLargestShare);
  step.decay = gap > 0.0 ? std::pow(noise.rho, gap) : 0.0;
  const double before = step.decay * step.decay * *left + share * (1.0 - step.decay * step.decay);
  step.innovation = before + 1.0 - share;
  step.gain = before / step.innovation;
  *left = (1.0 - step.gain) * before;
  return step;
}

NoisePieces PiecesOf(const NoiseContrasts& s, const MarkovNoise& noise) {
  const Eigen::Index n = s.rows.rows(), q = s.rows.cols();
  NoisePieces out;
  Eigen::MatrixXd white = s.rows;
  if (!noise.white()) {
    std::vector<FilterStep> steps(static_cast<std::size_t>(n));
    double left = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      FilterStep& step = steps[static_cast<std::size_t>(i)];
      step = StepOfFilter(noise, s.gap[static_cast<std::size_t>(i)], &left);
      out.logdet += std::log(step.innovation);
    }
    for (Eigen::Index c = 0; c < q; ++c) {
      double state = 0.0;
      for (Eigen::Index i = 0; i < n; ++i) {
        const FilterStep& step = steps[static_cast<std::size_t>(i)];
        state *= step.decay;
        const double innovation = white(i, c) - state;
        state += step.gain * innovation;
        white(i, c) = innovation / std::sqrt(step.innovation);
      }
    }
  }
  out.squares = white.col(0).squaredNorm();
  if (q == 1) return out;
  const auto columns = white.rightCols(q - 1);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(q - 1, q - 1);
  normal.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> llt(normal.selfadjointView<Eigen::Lower>());
  const Eigen::VectorXd right = columns.transpose() * white.col(0);
  out.squares -= right.dot(llt.solve(right));
  for (Eigen::Index i = 0; i < q - 1; ++i) out.logdet += 2.0 * std::log(llt.matrixL()(i, i));
  out.squares = std::max(out.squares, 0.0);
  return out;
}

std::vector<NoiseContrasts> ContrastsOf(const Observations& o, const Eigen::VectorXd& residual,
                                        const Eigen::MatrixXd& A) {
  std::vector<NoiseContrasts> all;
  const Eigen::Index free = A.cols() - o.shared_rank;
  const RowLayout layout(o);
  for (std::size_t m = 0; m < layout.series.size(); ++m) {
    const RowSeries& mark = layout.series[m];
    const std::vector<double>& t = *mark.t;
    const double step = MedianStep(t);
    std::vector<Eigen::Index> row;
    std::vector<double> gap;
    for (std::size_t i = 0, last = 0; i < mark.size(); ++i) {
      if (!mark.Known(residual, i)) continue;
      gap.push_back(row.empty() || step <= 0.0 ? 0.0 : (t[i] - t[last]) / step);
      row.push_back(mark.Row(i));
      last = i;
    }
    const auto n = static_cast<Eigen::Index>(row.size());
    for (Eigen::Index axis = 0; axis < mark.axes; ++axis) {
      NoiseContrasts s;
      s.mark = m;
      s.gap = gap;
      Eigen::VectorXd y(n);
      Eigen::MatrixXd X(n, A.cols());
      for (Eigen::Index i = 0; i < n; ++i) {
        y(i) = residual(row[static_cast<std::size_t>(i)] + axis);
        X.row(i) = A.row(row[static_cast<std::size_t>(i)] + axis);
      }
      const Eigen::MatrixXd basis = Touched(X.leftCols(free), X.rightCols(o.shared_rank));
      s.rows.resize(n, 1 + basis.cols());
      s.rows.col(0) = y;
      s.rows.rightCols(basis.cols()) = basis;
      all.push_back(std::move(s));
    }
  }
  return all;
}

double RestrictedLogLikelihood(const NoisePieces& pieces, double dof, double* variance) {
  *variance = pieces.squares / dof;
  if (!(*variance > 0.0)) return -std::numeric_limits<double>::infinity();
  return -0.5 * (dof * std::log(*variance) + pieces.logdet + dof);
}

const char* Name(Pooling pooling) {
  switch (pooling) {
    case Pooling::kAll:
      return "all series";
    case Pooling::kByMark:
      return "each mark";
    case Pooling::kNone:
      break;
  }
  return "each series";
}

std::vector<std::vector<std::size_t>> GroupsOf(const std::vector<NoiseContrasts>& all,
                                               Pooling pooling) {
  constexpr double kFewest = 20.0;  // contrasts; fewer tell nothing of correlation
  std::vector<std::vector<std::size_t>> groups;
  for (std::size_t s = 0; s < all.size(); ++s) {
    if (all[s].dof() < kFewest) continue;
    const bool together =
        !groups.empty() &&
        (pooling == Pooling::kAll ||
         (pooling == Pooling::kByMark && all[groups.back().back()].mark == all[s].mark));
    if (!together) groups.emplace_back();
    groups.back().push_back(s);
  }
  return groups;
}

}  // namespace unfurl::correlate
