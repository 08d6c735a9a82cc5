// The last steps of a way where the cost is rough: by draws instead of differences.
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/dense.h"
#include "base/random.h"
#include "correlate/fit/search.h"
#include "correlate/fit/solver.h"

namespace unfurl::correlate {

// Slopes that were bought on this record, and foretold each step since, tell as well as ones bought
// here; what is rough is looked at here.
bool StageRunner::IsRough(const std::vector<Evaluator::Request>& beside) {
  auto rough = [&] {
    const std::vector<double>& kinks = slopes_.kinks();
    return *std::max_element(kinks.begin(), kinks.end()) > kKink;
  };
  if (!slopes_.kinks().empty() && !rough()) return false;
  slopes_.StartAt(*reduced_, u_, point_);
  if (!slopes_.fresh() && !slopes_.Buy(*reduced_, u_, point_, beside)) return false;
  return rough();
}

bool StageRunner::Polish(const std::vector<Evaluator::Request>& beside) {
  if (!reduced_->At(u_, &point_, "trial")) return false;
  if (!IsRough(beside)) return true;
  if (std::exchange(alone_, false)) {  // the last stage is not at its end
    if (!Lead(ends_.size() - 1)) return false;
    if (!IsRough({})) return true;
  }
  Draw();
  if (!reduced_->At(u_, &point_, "trial")) return false;
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) at_[t] = point_.registration[t].at;
  result_.cost = point_.cost;
  result_.to = Values(problem_.parameters, u_.data());
  return true;
}

void StageRunner::Draw() {
  constexpr int kRounds = 14;    // kForget^14 < 1e-3: the spread has left its start behind
  constexpr double kWide = 3.0;  // standard errors drawn at first
  // Of the best quarter's costs: below, the floor is reached. Sigmas are to be scaled by a misfit,
  // so that its mean square is the scale of the costs.
  constexpr double kSpread = 1.0;
  constexpr double kForget = 0.6;  // of the old spread, each round
  const auto p = static_cast<Eigen::Index>(u_.size());
  const Eigen::MatrixXd projected = reduced_->Project(point_, slopes_.Rows(*reduced_));
  const GaussNewton newton = StepAndSigma(projected, point_.residual);
  Eigen::VectorXd range(p);
  for (Eigen::Index j = 0; j < p; ++j) {
    const Parameter& q = problem_.parameters[static_cast<std::size_t>(j)];
    range(j) =
        std::isfinite(q.high - q.low) ? ToInternal(q, q.high) - ToInternal(q, SearchLow(q)) : 1.0;
  }
  const Eigen::VectorXd sigma = (kWide * newton.sigma).cwiseMin(0.05 * range);
  Eigen::MatrixXd cov = sigma.cwiseAbs2().asDiagonal();
  Eigen::VectorXd mean = Eigen::Map<const Eigen::VectorXd>(u_.data(), p);
  const auto count = static_cast<std::size_t>(16 + 6 * p), elite = count / 4;
  Rng rng = Rng(options_.search.seed).Stream("polish");
  double best = point_.cost;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::MatrixXd root = cov.llt().matrixL();
    std::vector<std::vector<double>> points;
    for (std::size_t i = 0; i < count; ++i) {
      Eigen::VectorXd z(p);
      for (Eigen::Index j = 0; j < p; ++j) z(j) = rng.Normal();
      const Eigen::VectorXd at = mean + root * z;
      std::vector<double> u(u_.size());
      for (std::size_t j = 0; j < u.size(); ++j) {
        const Parameter& q = problem_.parameters[j];
        u[j] = ToInternal(q, FromInternal(q, at(static_cast<Eigen::Index>(j))));
      }
      points.push_back(std::move(u));
    }
    std::vector<ReducedProblem::Point> found;
    const std::vector<bool> good = reduced_->AtAll(points, &found, "polish");
    std::vector<std::pair<double, const std::vector<double>*>> order = {{best, &u_}};
    for (std::size_t i = 0; i < count; ++i) {
      if (good[i]) order.emplace_back(found[i].cost, &points[i]);
    }
    std::stable_sort(order.begin(), order.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    if (order.size() > elite) order.resize(elite);
    Eigen::MatrixXd members(p, static_cast<Eigen::Index>(order.size()));
    for (std::size_t i = 0; i < order.size(); ++i) {
      members.col(static_cast<Eigen::Index>(i)) =
          Eigen::Map<const Eigen::VectorXd>(order[i].second->data(), p);
    }
    mean = members.rowwise().mean();
    const Eigen::MatrixXd away = members.colwise() - mean;
    cov = kForget * (away * away.transpose()) / static_cast<double>(order.size()) +
          (1.0 - kForget) * cov;
    cov.diagonal().array() += 1e-24;
    const double spread = order.back().first - order.front().first;
    best = order.front().first;
    u_ = std::vector<double>(*order.front().second);
    if (on_best) on_best(best, Values(problem_.parameters, u_.data()));
    const double mean_square = 2.0 * best / static_cast<double>(point_.residual.size());
    if (spread < kSpread * std::max(1.0, mean_square)) break;
  }
}

}  // namespace unfurl::correlate
