#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/margin_surrogate.h"
#include "campaign/statistics/score_mixture.h"
#include "campaign/statistics/subset.h"

namespace unfurl::campaign {

struct RareFailureOptions {
  int dimensions = 1;
  int runs = 5000;  // at most
  std::uint64_t seed = 1;
  double confidence = 0.95;
};

/// What the probability rests on.
enum class RareMethod { kSubset, kImportance, kRandom };

struct RareFailureResult {
  RareMethod method = RareMethod::kSubset;
  double probability = 0.0;
  double variation = 0.0;  // coefficient of variation [-]
  Interval interval;
  double with_failed = 0.0;  // if every run without a margin were a failure: an upper estimate
  std::size_t runs = 0, failed = 0;
  SubsetResult subset;      // the first
  double importance = 0.0;  // estimate by importance sampling, 0 where there is none
  double effective = 0.0;   // independent failures that its weights are worth
  int components = 0;       // regions that its proposal draws from
  bool usable = false;
  std::vector<std::string> notes;  // why not, or with what care
};

/// Probability of a negative margin in a given number of runs: a subset simulation finds where
/// failures lie (half of the runs), a mixture is fitted to them, and what is left goes into
/// importance sampling from it; where a pilot shows that its weights are too uneven, into further
/// subset simulations instead. The two ways are independent, and are held against each other.
///
/// A state machine as SubsetSimulation: Batch(), Answer(), Done(), result().
class RareFailure {
 public:
  explicit RareFailure(RareFailureOptions options);

  const std::vector<std::vector<double>>& Batch() const;
  void Answer(std::span<const double> margins);
  bool Done() const { return stage_ == Stage::kDone; }
  const RareFailureResult& result() const { return result_; }

 private:
  enum class Stage { kSubset, kPilot, kImportance, kRepeat, kRandom, kDone };
  struct Weighted {
    double sum = 0.0, square = 0.0;  // of the weights of failures
    double failed = 0.0;             // weight of runs without a margin
    std::size_t n = 0;
    double Effective() const { return square > 0.0 ? sum * sum / square : 0.0; }
  };

  std::size_t Left() const {
    const auto all = static_cast<std::size_t>(options_.runs);
    return result_.runs < all ? all - result_.runs : 0;
  }
  void EndSubset();
  void EndPilot(std::span<const double> margins);
  void EndImportance(std::span<const double> margins);
  void StartSubset();
  void Repeat();
  double Independent() const;
  void StartDraws(Stage stage, std::size_t n);
  void MakeSurrogate();
  double Weight(const Eigen::VectorXd& z, double share) const;
  Weighted WeightsOf(std::span<const double> margins) const;
  void FitAgain(const Eigen::MatrixXd& hits, const Eigen::VectorXd& weights,
                std::span<const double> margins);
  double BestShare(const Eigen::MatrixXd& hits, const Eigen::VectorXd& weights, std::size_t n);
  void Combine();
  void Judge();
  void JudgeChains();
  void EndRandom(std::span<const double> margins);

  RareFailureOptions options_;
  Stage stage_ = Stage::kSubset;
  std::unique_ptr<SubsetSimulation> subset_;
  std::vector<SubsetResult> subsets_;  // that reached failures, and the first
  bool lost_repeat_ = false;
  Eigen::MatrixXd failures_;  // normal scores of failures that the subset simulation found
  Eigen::MatrixXd visited_;   // of all points with a margin
  std::vector<double> visited_margins_;
  std::unique_ptr<ScoreMixture> mixture_;
  std::optional<SurrogateProposal> surrogate_;
  double share_ = 0.0;     // of the draws that are the surrogate's
  std::size_t used_ = 0;   // of the surrogate's draws
  Eigen::MatrixXd drawn_;  // normal scores of the batch
  std::vector<std::vector<double>> batch_;
  std::optional<Weighted> importance_;
  RareFailureResult result_;
};

}  // namespace unfurl::campaign
