#include "campaign/statistics/subset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/probability.h"
#include "base/statistics.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign {

namespace {

constexpr std::uint32_t kScores = 16;     // streams of random numbers: candidates
constexpr std::uint32_t kShuffle = 17;    // and the order of seeds
constexpr double kBestAcceptance = 0.44;  // of a candidate in one direction [Papaioannou 2015]
// A level that holds more than this share of the one before is hardly a step; ties in the margin
// make such levels.
constexpr double kLargestLevel = 0.5;

double UnitOf(double score) { return std::clamp(NormalCdf(score), 0x1p-1000, 1.0 - 0x1p-53); }

void CheckOptions(const SubsetOptions& options) {
  const double seeds = options.level_probability * options.runs_per_level;
  constexpr double kFewestSeeds = 10.0;  // chains: with fewer, one that is stuck is the result
  if (options.dimensions < 1 || options.most_levels < 1 ||
      !(options.level_probability > 0.0 && options.level_probability <= kLargestLevel) ||
      !(options.confidence > 0.0 && options.confidence < 1.0)) {
    throw Error("a subset simulation with options that are none", "",
                "give dimensions and levels of 1 or more, and a level's probability up to 0.5");
  }
  if (seeds < kFewestSeeds) {
    throw Error(fmt::format("a subset simulation of {} runs a level", options.runs_per_level), "",
                fmt::format("give {:.0f} or more: a level's probability of {:g} leaves too few "
                            "chains",
                            std::ceil(kFewestSeeds / options.level_probability),
                            options.level_probability));
  }
}

}  // namespace

SubsetSimulation::SubsetSimulation(SubsetOptions options) : options_(options) {
  CheckOptions(options_);
  const int n = options_.runs_per_level;
  points_.resize(options_.dimensions, n);
  margins_.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    DrawScores(points_.col(i));
  }
  AskFor(points_);
}

void SubsetSimulation::DrawScores(Eigen::Ref<Eigen::VectorXd> scores) {
  CounterRandom(options_.seed, kScores)
      .Normals(drawn_++, {scores.data(), static_cast<std::size_t>(scores.size())});
}

void SubsetSimulation::AskFor(const Eigen::MatrixXd& scores) {
  asked_ = scores;
  batch_.assign(static_cast<std::size_t>(scores.cols()),
                std::vector<double>(static_cast<std::size_t>(scores.rows())));
  for (Eigen::Index i = 0; i < scores.cols(); ++i) {
    for (Eigen::Index d = 0; d < scores.rows(); ++d) {
      batch_[static_cast<std::size_t>(i)][static_cast<std::size_t>(d)] =
          options_.in_scores ? scores(d, i) : UnitOf(scores(d, i));
    }
  }
}

void SubsetSimulation::Answer(std::span<const double> margins) {
  if (margins.size() != batch_.size()) {
    throw Error(fmt::format("{} margins for {} points", margins.size(), batch_.size()), "",
                "give one for each point of the batch, in its order");
  }
  for (double m : margins) {
    if (std::isinf(m)) throw Error("an infinite margin", "", "give a failed run's as NaN");
    if (std::isnan(m)) ++level_failed_;
  }
  if (options_.keep_visited) Keep(margins);
  result_.runs += margins.size();
  level_runs_ += margins.size();
  if (chains_.empty()) {
    TakeInitial(margins);
  } else {
    TakeStep(margins);
  }
}

void SubsetSimulation::Keep(std::span<const double> margins) {
  for (std::size_t i = 0; i < margins.size(); ++i) {
    if (std::isnan(margins[i])) continue;
    const auto column = asked_.col(static_cast<Eigen::Index>(i));
    visited_.insert(visited_.end(), column.data(), column.data() + column.size());
    visited_margins_.push_back(margins[i]);
  }
}

Eigen::MatrixXd SubsetSimulation::Visited() const {
  return Eigen::Map<const Eigen::MatrixXd>(visited_.data(), options_.dimensions,
                                           static_cast<Eigen::Index>(visited_margins_.size()));
}

void SubsetSimulation::TakeInitial(std::span<const double> margins) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < margins.size(); ++i) {
    margins_[i] = std::isnan(margins[i]) ? kInfinity : margins[i];
  }
  count_ = margins.size();
  EndLevel();
}

// Each chain that was asked for goes to its candidate if that lies in the level, or stays.
void SubsetSimulation::TakeStep(std::span<const double> margins) {
  std::size_t accepted = 0;
  for (std::size_t c = 0; c < margins.size(); ++c) {
    const std::size_t last = chains_[c].states.back();
    const bool inside = margins[c] <= threshold_ && (!failures_only_ || margins[c] < 0.0);
    points_.col(static_cast<Eigen::Index>(count_)) =
        inside ? Eigen::VectorXd(asked_.col(static_cast<Eigen::Index>(c)))
               : Eigen::VectorXd(points_.col(static_cast<Eigen::Index>(last)));
    margins_[count_] = inside ? margins[c] : margins_[last];
    chains_[c].states.push_back(count_++);
    accepted += inside ? 1 : 0;
  }
  proposed_ += margins.size();
  accepted_ += accepted;
  // The spread follows the acceptance, by less and less [Papaioannou et al. 2015, eq. (19)].
  const double share = static_cast<double>(accepted) / static_cast<double>(margins.size());
  log_spread_ += (share - kBestAcceptance) / std::sqrt(static_cast<double>(++step_));
  log_spread_ = std::min(log_spread_, 0.0);
  if (count_ < margins_.size()) return Propose();
  EndLevel();
}

void SubsetSimulation::EndLevel() {
  if (failures_only_) return Finish(SubsetEnd::kReached);
  const std::size_t n = count_;
  std::vector<double> sorted = margins_;
  std::sort(sorted.begin(), sorted.end());
  const auto wanted =
      static_cast<std::size_t>(std::llround(options_.level_probability * static_cast<double>(n)));
  const auto failures = static_cast<std::size_t>(
      std::lower_bound(sorted.begin(), sorted.end(), 0.0) - sorted.begin());
  if (failures >= wanted) {  // margin < 0, strictly: the largest negative one is the threshold
    AddLevel(sorted[failures - 1], failures);
    if (!options_.sample_failures) return Finish(SubsetEnd::kReached);
    failures_only_ = true;
    return StartChains(sorted[failures - 1]);
  }
  double threshold = sorted[wanted - 1];
  auto inside = static_cast<std::size_t>(std::upper_bound(sorted.begin(), sorted.end(), threshold) -
                                         sorted.begin());
  if (static_cast<double>(inside) > kLargestLevel * static_cast<double>(n)) {
    // Ties: take what lies below them, if that is enough for chains.
    const auto below = static_cast<std::size_t>(
        std::lower_bound(sorted.begin(), sorted.end(), threshold) - sorted.begin());
    if (2 * below < wanted) return Finish(SubsetEnd::kStalled);
    inside = below;
    threshold = sorted[below - 1];
  }
  if (!std::isfinite(threshold)) return Finish(SubsetEnd::kStalled);
  AddLevel(threshold, inside);
  if (result_.levels.size() >= static_cast<std::size_t>(options_.most_levels)) {
    return Finish(SubsetEnd::kOutOfRuns);
  }
  StartChains(threshold);
}

void SubsetSimulation::AddLevel(double threshold, std::size_t inside) {
  SubsetLevel level;
  level.threshold = threshold;
  level.probability = static_cast<double>(inside) / static_cast<double>(count_);
  level.error = VariationOf(threshold);
  level.acceptance =
      proposed_ == 0 ? 1.0 : static_cast<double>(accepted_) / static_cast<double>(proposed_);
  level.spread = std::exp(log_spread_);
  level.failed = level_failed_;
  level.runs = level_runs_;
  result_.levels.push_back(level);
}

// Coefficient of variation of a level's probability, from the correlation along its chains of
// whether a point is inside [Au and Beck 2001, eqs. (25) to (29)].
double SubsetSimulation::VariationOf(double threshold) const {
  const double n = static_cast<double>(count_);
  double inside = 0.0;
  for (std::size_t i = 0; i < count_; ++i) inside += margins_[i] <= threshold ? 1.0 : 0.0;
  const double p = inside / n;
  if (p >= 1.0 || p <= 0.0) return 0.0;
  std::size_t longest = 0;
  for (const Chain& chain : chains_) longest = std::max(longest, chain.states.size());
  double gamma = 0.0;
  for (std::size_t lag = 1; lag < longest; ++lag) {
    double both = 0.0, pairs = 0.0;
    for (const Chain& chain : chains_) {
      for (std::size_t i = lag; i < chain.states.size(); ++i) {
        pairs += 1.0;
        both +=
            margins_[chain.states[i]] <= threshold && margins_[chain.states[i - lag]] <= threshold;
      }
    }
    // Pairs at this lag over n is (1 - lag n_s / n), the weight of its correlation in the sum.
    if (pairs > 0.0) gamma += 2.0 * pairs / n * (both / pairs - p * p) / (p * (1.0 - p));
  }
  return std::sqrt((1.0 - p) / (p * n) * std::max(1.0 + gamma, 1.0));
}

// The points within the threshold are the seeds of this level's chains.
void SubsetSimulation::StartChains(double threshold) {
  std::vector<std::size_t> seeds;
  for (std::size_t i = 0; i < count_; ++i) {
    if (margins_[i] <= threshold) seeds.push_back(i);
  }
  // In an order of no meaning: where lengths differ, the first chains are the longer ones.
  const CounterRandom shuffle(options_.seed, kShuffle);
  const KeyedPermutation order(seeds.size(), shuffle.Bits(result_.levels.size(), 0));
  Eigen::MatrixXd points(points_.rows(), points_.cols());
  std::vector<double> margins(margins_.size());
  chains_.assign(seeds.size(), {});
  for (std::size_t c = 0; c < seeds.size(); ++c) {
    const std::size_t seed = seeds[order(c)];
    points.col(static_cast<Eigen::Index>(c)) = points_.col(static_cast<Eigen::Index>(seed));
    margins[c] = margins_[seed];
    chains_[c].states = {c};
  }
  points_ = std::move(points);
  margins_ = std::move(margins);
  count_ = seeds.size();
  threshold_ = threshold;
  step_ = proposed_ = accepted_ = level_failed_ = level_runs_ = 0;
  // Spread at first: as the last level had it, or 0.6, the middle of what is found best.
  if (result_.levels.size() == 1) log_spread_ = std::log(0.6);
  if (count_ == margins_.size()) return EndLevel();  // all points are seeds
  Propose();
}

void SubsetSimulation::Propose() {
  const std::size_t n = std::min(chains_.size(), margins_.size() - count_);
  const double spread = std::exp(log_spread_), keep = std::sqrt(1.0 - spread * spread);
  Eigen::MatrixXd scores(options_.dimensions, static_cast<Eigen::Index>(n));
  for (std::size_t c = 0; c < n; ++c) {
    const auto last = static_cast<Eigen::Index>(chains_[c].states.back());
    auto candidate = scores.col(static_cast<Eigen::Index>(c));
    DrawScores(candidate);
    candidate = keep * points_.col(last) + spread * candidate;
  }
  AskFor(scores);
}

void SubsetSimulation::Finish(SubsetEnd end) {
  batch_.clear();
  result_.end = end;
  double square = 0.0, reached = 1.0;
  result_.failed = level_failed_;
  for (const SubsetLevel& level : result_.levels) {
    result_.with_failed += reached * static_cast<double>(level.failed) /
                           static_cast<double>(std::max<std::size_t>(level.runs, 1));
    reached *= level.probability;
    square += level.error * level.error;
    result_.failed += level.failed;
  }
  result_.probability = result_.levels.empty() ? 1.0 : reached;
  result_.with_failed = std::min(1.0, result_.with_failed + result_.probability);
  result_.variation = std::sqrt(square);
  const double z = NormalQuantile(0.5 + options_.confidence / 2.0);
  const double width = std::exp(z * std::sqrt(std::log1p(square)));
  result_.interval = {result_.probability / width, std::min(1.0, result_.probability * width)};
}

Eigen::MatrixXd SubsetSimulation::Failures() const {
  std::vector<Eigen::Index> failures;
  for (std::size_t i = 0; i < count_; ++i) {
    if (margins_[i] < 0.0) failures.push_back(static_cast<Eigen::Index>(i));
  }
  return points_(Eigen::all, failures);
}

}  // namespace unfurl::campaign
