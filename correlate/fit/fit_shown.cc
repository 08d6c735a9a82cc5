// Where samples of a stated size hide the motion: whether the estimate rests on them.
#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/random.h"
#include "correlate/fit/fit_run.h"
#include "correlate/fit/normal_matrix.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

Eigen::MatrixXd FitRun::CovarianceOfWhatShows(bool with_bounds) const {
  Eigen::MatrixXd sensitivity = result_.sensitivity;
  std::vector<Eigen::MatrixXd> jacobian;
  for (std::size_t t = 0; t < trials_; ++t) {
    jacobian.push_back(result_.trials[t].registration.jacobian);
    const BetweenSamples& between = result_.trials[t].between;
    const RowLayout layout(weighed_[t]);
    for (std::size_t s = 0; s < between.hidden.size(); ++s) {
      const RowSeries& series = layout.series[s];
      for (std::size_t i = 0; i < series.size(); ++i) {
        if (between.hidden[s][i] == 0) continue;
        const Eigen::Index first = best_->reduced().first_row(t) + series.Row(i);
        sensitivity.middleRows(first, series.axes).setZero();
        jacobian[t].middleRows(series.Row(i), series.axes).setZero();
      }
    }
  }
  Eigen::MatrixXd information = Gram(StackRows(sensitivity, jacobian).A);
  for (std::size_t j = 0; with_bounds && j < problem_.parameters.size(); ++j) {
    const Parameter& p = problem_.parameters[j];
    const double value = result_.parameters[j].value;
    double range = (ToInternal(p, p.high) - ToInternal(p, SearchLow(p))) * Slope(p, value);
    if (!std::isfinite(range)) range = std::max(std::abs(value), std::abs(p.start));
    if (!(range > 0.0)) continue;
    const auto k = static_cast<Eigen::Index>(j);
    information(k, k) += 12.0 / (range * range);  // of what lies anywhere between the bounds
  }
  Eigen::MatrixXd open;
  const Eigen::MatrixXd inverse = InverseOfNormal(information, &open);
  return inverse + open;
}

std::vector<std::vector<double>> FitRun::PlacesByWhatShows() const {
  // A minimum as wide as the estimate's is missed by all of so many once in 2^6.
  constexpr int kPlaces = 6;
  const auto p = static_cast<Eigen::Index>(problem_.parameters.size());
  const Eigen::LLT<Eigen::MatrixXd> root(CovarianceOfWhatShows(true).topLeftCorner(p, p));
  Rng rng = Rng(options_.search.seed).Stream("what the samples show");
  std::vector<std::vector<double>> out = {Values(problem_.parameters, best_->u().data())};
  for (int k = 0; k < kPlaces; ++k) {
    Eigen::VectorXd z(p);
    for (double& x : z) x = rng.Normal();
    const Eigen::VectorXd step = root.matrixL() * z;
    std::vector<double> theta = out.front();
    for (std::size_t j = 0; j < theta.size(); ++j) {
      const Parameter& q = problem_.parameters[j];
      const double by_slope = step(static_cast<Eigen::Index>(j)) / Slope(q, theta[j]);
      theta[j] = FromInternal(q, StepByValue(q, ToInternal(q, theta[j]), by_slope));
    }
    out.push_back(std::move(theta));
  }
  return out;
}

bool FitRun::ComesBack() {
  constexpr double kSigmas = 3.0;  // as in DropTwins: one minimum's ends lie within one or two
  StageRunner* own = nullptr;      // led from the estimate
  bool all = true;
  for (const std::vector<double>& theta : PlacesByWhatShows()) {
    StageRunner* led = LeadAlong(PlaceAt(theta));
    all = all && led != nullptr;
    if (led == nullptr) continue;
    if (own == nullptr) own = led;
    bool same = true;
    for (std::size_t j = 0; j < theta.size(); ++j) {
      const double off = std::abs(led->result().to[j] - own->result().to[j]);
      same = same && off <= kSigmas * result_.parameters[j].sigma;
    }
    all = all && same;
    const double deviance = DevianceByWay(*led) - DevianceByWay(*own);
    if (!same && deviance <= kDeviance95) as_good_.push_back({led, deviance, false});
  }
  return all;
}

bool FitRun::RestsOnWhatHides(bool searched, Eigen::MatrixXd* doubt) {
  if (HidesMotion() || !MostIsHidden()) return false;
  using Told = BetweenSamples::Told;
  const Eigen::MatrixXd shown = CovarianceOfWhatShows(false);
  bool known = true;
  for (std::size_t j = 0; j < problem_.parameters.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    const double limit = KnownWithin(problem_.parameters[j], result_.parameters[j].value);
    known = known && (std::sqrt(shown(k, k)) < limit || result_.parameters[j].sigma >= limit);
  }
  const Told told = ComesBack()          ? Told::kOneMinimum
                    : known || !searched ? Told::kByWhatShows
                                         : Told::kBySearch;
  for (TrialResult& t : result_.trials) t.between.told = told;
  if (told != Told::kByWhatShows) return false;
  // Twice: the minimum may lie as far from what these samples say as the truth does.
  *doubt += 2.0 * shown;
  for (ParameterEstimate& e : result_.parameters) e.profile = {};  // of one minimum alone
  return true;
}

bool FitRun::WantsSearch() const {
  return std::any_of(result_.trials.begin(), result_.trials.end(), [](const TrialResult& t) {
    return t.between.samples > 0 && t.between.told == BetweenSamples::Told::kBySearch;
  });
}

}  // namespace unfurl::correlate
