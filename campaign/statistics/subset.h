#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/intervals.h"

namespace unfurl::campaign {

/// How a subset simulation ended.
enum class SubsetEnd {
  kRunning,
  kReached,    // the last level holds enough failures
  kStalled,    // margins do not tell nearer from farther: ties, or nothing new accepted
  kOutOfRuns,  // more levels than allowed: the probability is below the last level's
};

/// One level: probability of margin <= threshold given the level before.
struct SubsetLevel {
  double threshold = 0.0;    // of the margin [its unit]
  double probability = 0.0;  // conditional
  double error = 0.0;        // coefficient of variation, with the chains' correlation [-]
  double acceptance = 1.0;   // of the candidates that led to this level's points
  double spread = 1.0;       // of a candidate about its predecessor, in normal scores, at the end
  std::size_t failed = 0;    // runs without a margin
  std::size_t runs = 0;
};

struct SubsetResult {
  SubsetEnd end = SubsetEnd::kRunning;
  double probability = 0.0;
  double variation = 0.0;  // coefficient of variation of the estimate [-]
  Interval interval;       // log-normal, with the confidence of the options
  /// The probability if each run without a margin were a failure: an upper estimate.
  double with_failed = 0.0;
  std::vector<SubsetLevel> levels;
  std::size_t runs = 0, failed = 0;
};

struct SubsetOptions {
  int dimensions = 1;
  int runs_per_level = 1000;
  double level_probability = 0.1;
  std::uint64_t seed = 1;
  int most_levels = 12;  // each a factor of level_probability
  double confidence = 0.95;
  /// One level more, of points that fail: costs its runs, and tells where failures lie.
  bool sample_failures = false;
  bool in_scores = false;  // Batch() gives normal scores in the place of points of the unit cube
  bool keep_visited = false;
};

/// Probability that a margin is negative, by subset simulation [Au and Beck 2001]: levels of
/// falling margin, each reached from the last by Markov chains of conditional sampling with
/// adapted spread [Papaioannou et al. 2015]. Inputs are points of the unit cube.
///
/// No callback: run the points of Batch(), give their margins to Answer(), until Done(). All chains
/// go one step in a batch, so that it can be shared among workers; results depend on the options
/// and margins alone. A margin that is NaN is a failed run: a chain does not go there, it counts as
/// no failure, and `with_failed` tells what if it were one.
class SubsetSimulation {
 public:
  explicit SubsetSimulation(SubsetOptions options);
  SubsetSimulation(int dimensions, int runs_per_level, double level_probability, std::uint64_t seed)
      : SubsetSimulation(SubsetOptions{dimensions, runs_per_level, level_probability, seed}) {}

  /// Points wanted now; empty when done.
  const std::vector<std::vector<double>>& Batch() const { return batch_; }
  /// Their margins, in the same order; Error where the count differs or one is infinite.
  void Answer(std::span<const double> margins);
  bool Done() const { return batch_.empty(); }

  const SubsetResult& result() const { return result_; }
  /// Normal scores of points that failed, one a column, repeated as often as a chain stayed there.
  Eigen::MatrixXd Failures() const;
  /// With keep_visited: all points that were run and have a margin, one a column, and their
  /// margins.
  Eigen::MatrixXd Visited() const;
  const std::vector<double>& VisitedMargins() const { return visited_margins_; }
  /// Chains that they are of: what they are worth in independent points is no less than this.
  std::size_t chains() const { return chains_.size(); }

 private:
  struct Chain {
    std::vector<std::size_t> states;  // indices into points_ of this level
  };

  void Keep(std::span<const double> margins);
  void TakeInitial(std::span<const double> margins);
  void TakeStep(std::span<const double> margins);
  void EndLevel();
  void AddLevel(double threshold, std::size_t inside);
  double VariationOf(double threshold) const;
  void StartChains(double threshold);
  void Propose();
  void AskFor(const Eigen::MatrixXd& scores);
  void Finish(SubsetEnd end);
  void DrawScores(Eigen::Ref<Eigen::VectorXd> scores);

  SubsetOptions options_;
  SubsetResult result_;
  std::vector<std::vector<double>> batch_;
  Eigen::MatrixXd asked_;  // normal scores of the batch, one a column

  Eigen::MatrixXd points_;       // of this level, one a column
  std::vector<double> margins_;  // of them
  std::size_t count_ = 0;        // points of this level so far
  std::vector<Chain> chains_;    // of this level; empty in the first
  double threshold_ = 0.0;       // below which this level's points lie
  double log_spread_ = 0.0;      // adapted scale of candidates
  std::size_t step_ = 0, proposed_ = 0, accepted_ = 0, level_failed_ = 0, level_runs_ = 0;
  std::uint64_t drawn_ = 0;      // points drawn so far: the counter of random numbers
  bool failures_only_ = false;   // the extra level
  std::vector<double> visited_;  // dimensions x points
  std::vector<double> visited_margins_;
};

}  // namespace unfurl::campaign
