#include "correlate/fit/quantised.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/statistics.h"
#include "correlate/fit/autocorrelation.h"
#include "correlate/fit/goodness.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// More noise than this makes what steps do white, to 1%: exp(-2 (pi / 2)^2) [in steps].
constexpr double kDither = 0.5;

}  // namespace

QuantisedRows::QuantisedRows(const Observations& observations, const Eigen::VectorXd& residual,
                             const Eigen::Ref<const Eigen::MatrixXd>& parameters,
                             const Eigen::Ref<const Eigen::MatrixXd>& nuisances) {
  const RowLayout layout(observations);
  std::vector<double> steps;
  for (const RowSeries& s : layout.series) {
    // With so much noise and a step, residuals of one sigma are smaller than this.
    const double least = 1.0 / std::sqrt(kDither * kDither + 1.0 / 12.0);
    if (!(s.step > least)) {
      all_ = false;
      continue;
    }
    for (std::size_t i = 0; i < s.size(); ++i) {
      if (!s.Known(residual, i)) continue;
      rows_.push_back(s.Row(i));
      steps.push_back(s.step);
    }
  }
  if (rows_.empty()) return;
  residual_ = residual;
  step_ = Eigen::Map<const Eigen::VectorXd>(steps.data(), static_cast<Eigen::Index>(steps.size()));
  moves_.resize(step_.size(), parameters.cols() + nuisances.cols());
  moves_ << parameters(rows_, Eigen::all), nuisances(rows_, Eigen::all);
  for (Eigen::Index c = 0; c < moves_.cols(); ++c) {
    const double most = moves_.col(c).cwiseQuotient(step_).cwiseAbs().maxCoeff();
    if (most > 0.0) moves_.col(c) *= 0.5 / most;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(moves_);
  basis_ = qr.householderQ() * Eigen::MatrixXd::Identity(moves_.rows(), qr.rank());
  noise_ = NoiseBeside(residual);
  if (noise_ >= kDither) rows_.clear();
}

Eigen::VectorXd QuantisedRows::Fitted(const Eigen::VectorXd& own) const {
  return own - basis_ * (basis_.transpose() * own);
}

double QuantisedRows::NoiseBeside(const Eigen::VectorXd& residual) const {
  constexpr int kDraws = 40;     // give the scatter to 11%
  constexpr double kSure = 2.0;  // standard deviations: noise that is not there hides what repeats
  std::vector<double> squares;
  Eigen::VectorXd drawn = residual;
  for (int i = 0; i < kDraws; ++i) {
    Rng rng = Rng(static_cast<std::uint64_t>(i) + 1).Stream("steps");
    Draw(&rng, &drawn);
    squares.push_back(Fitted(drawn(rows_)).cwiseQuotient(step_).squaredNorm());
  }
  const double own = residual(rows_).cwiseQuotient(step_).squaredNorm();
  const double beyond = own - Mean(squares) - kSure * std::sqrt(Variance(squares));
  return std::sqrt(std::max(beyond / static_cast<double>(rows_.size()), 0.0));
}

void QuantisedRows::Draw(Rng* rng, Eigen::VectorXd* residual) const {
  Eigen::VectorXd by(moves_.cols());
  for (double& x : by) x = rng->Uniform(-1.0, 1.0);
  const Eigen::VectorXd moved = moves_ * by;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    // Where the motion lies beside a reading, which is a step of the instrument.
    const double at = (moved(k) - residual_(rows_[i])) / step_(k);
    (*residual)(rows_[i]) = step_(k) * (std::round(at + noise_ * rng->Normal()) - at);
  }
}

Eigen::MatrixXd QuantisedRows::Middle(const Eigen::MatrixXd& whitened,
                                      const RowWhitening* whitening) const {
  constexpr int kDraws = 400;  // give a standard error to 3.5%
  Eigen::MatrixXd middle = Eigen::MatrixXd::Zero(whitened.cols(), whitened.cols());
  for (int i = 0; i < kDraws; ++i) {
    Rng rng = Rng(static_cast<std::uint64_t>(i) + 1).Stream("read again");
    Eigen::VectorXd drawn = Eigen::VectorXd::Zero(residual_.size());
    Draw(&rng, &drawn);
    Eigen::MatrixXd e = drawn;
    if (whitening != nullptr) whitening->Apply(e);
    const Eigen::VectorXd score = whitened.transpose() * e.col(0);
    middle += score * score.transpose() / kDraws;
  }
  return middle;
}

QuantisedRows::PValues QuantisedRows::Ask(const Observations& observations,
                                          const RowWhitening* whitening, int sections) const {
  constexpr int kDraws = 599;  // the least is 1/600, a third of kGoodnessLevel's third
  struct Answers {
    double white, found, steady;
  };
  auto ask = [&](const Eigen::VectorXd& rows) {
    Eigen::MatrixXd whitened = rows;
    if (whitening != nullptr) whitening->Apply(whitened);
    const Eigen::VectorXd w = whitened.col(0);
    return Answers{EstimateResidualNoise(observations, rows).p_together,
                   EstimateResidualNoise(observations, w).p_together,
                   SteadyPValue(observations, w, sections)};
  };
  const Answers own = ask(residual_);
  PValues out;
  Answers worse{1.0, 1.0, 1.0};
  Eigen::VectorXd drawn = residual_;
  for (int i = 0; i < kDraws; ++i) {
    Rng rng = Rng(static_cast<std::uint64_t>(i) + 1).Stream("asked");
    Draw(&rng, &drawn);
    drawn(rows_) = Fitted(drawn(rows_));
    const Answers a = ask(drawn);
    worse.white += a.white <= own.white ? 1.0 : 0.0;
    worse.found += a.found <= own.found ? 1.0 : 0.0;
    worse.steady += a.steady <= own.steady ? 1.0 : 0.0;
  }
  out.white = worse.white / (kDraws + 1.0);
  out.found = worse.found / (kDraws + 1.0);
  out.steady = worse.steady / (kDraws + 1.0);
  return out;
}

}  // namespace unfurl::correlate
