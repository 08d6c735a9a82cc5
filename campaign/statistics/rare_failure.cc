#include "campaign/statistics/rare_failure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/probability.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

// Runs a level are a tenth of all: five levels, as a probability of 1e-4 with the one that samples
// failures has, take half of the runs, and the rest gains more by importance sampling.
constexpr int kLevels = 10;
constexpr int kFewestRuns = 1000;          // a hundred runs a level, ten chains
constexpr double kLevelProbability = 0.1;  // [Au and Beck 2001; Zuev et al. 2012: 0.1 to 0.3]
// Runs of a level beyond its seeds, of which ties may leave half.
constexpr double kLevelCost = 1.0 - kLevelProbability / 2.0;
// Of what is left after the subset simulation, for the pilot that corrects the proposal.
constexpr double kPilot = 0.2;
constexpr double kWide = 0.2;  // weight of the component that looks everywhere
// Failures that weights must be worth: the estimate's variation is then 10%, and known to a tenth
// or so of itself; with fewer the variation itself is a guess.
constexpr double kEffective = 100.0;
// Streams of random numbers; seeds of repeated subset simulations are hashed from the first.
constexpr std::uint32_t kPilotDraws = 24, kImportanceDraws = 25, kRandomDraws = 26;
constexpr std::uint64_t kSurrogateSeed = 1000;  // beyond those of repeats

// `freedom`: of the variation.
Interval LogNormalInterval(double p, double variation, double confidence, double freedom) {
  const double t = StudentQuantile(0.5 + confidence / 2.0, freedom);
  const double width = std::exp(t * std::sqrt(std::log1p(variation * variation)));
  return {p / width, std::min(1.0, p * width)};
}

}  // namespace

RareFailure::RareFailure(RareFailureOptions options) : options_(options) {
  if (options_.runs < kFewestRuns || options_.dimensions < 1 ||
      !(options_.confidence > 0.0 && options_.confidence < 1.0)) {
    throw Error(fmt::format("a rare failure in {} runs of {} inputs, confidence {}", options_.runs,
                            options_.dimensions, options_.confidence),
                "",
                fmt::format("give {} runs or more, 5000 for a probability of 1e-4, an input or "
                            "more, and a confidence between 0 and 1",
                            kFewestRuns));
  }
  StartSubset();
}

void RareFailure::StartSubset() {
  SubsetOptions options;
  options.dimensions = options_.dimensions;
  options.runs_per_level = options_.runs / kLevels;
  if (!subsets_.empty()) {  // with room for a level more than the first took
    const double levels = static_cast<double>(subsets_[0].levels.size());
    options.runs_per_level =
        static_cast<int>(static_cast<double>(Left()) / (1.0 + kLevelCost * levels));
  }
  options.level_probability = kLevelProbability;
  options.seed = subsets_.empty() ? options_.seed : SplitMix(options_.seed, subsets_.size());
  options.confidence = options_.confidence;
  options.sample_failures = options.keep_visited = subsets_.empty();
  // As many levels as the runs that are left pay for.
  const int extra = options.sample_failures ? 1 : 0;
  const double more = static_cast<double>(Left()) / options.runs_per_level - 1.0 - extra;
  options.most_levels = 1 + static_cast<int>(more / kLevelCost + 1e-9);
  subset_ = std::make_unique<SubsetSimulation>(options);
}

const std::vector<std::vector<double>>& RareFailure::Batch() const {
  const bool chains = stage_ == Stage::kSubset || stage_ == Stage::kRepeat;
  return chains ? subset_->Batch() : batch_;
}

void RareFailure::Answer(std::span<const double> margins) {
  if (margins.size() != Batch().size()) {
    throw Error(fmt::format("{} margins for {} points", margins.size(), Batch().size()), "",
                "give one for each point of the batch, in its order");
  }
  switch (stage_) {
    case Stage::kSubset:
    case Stage::kRepeat:
      subset_->Answer(margins);
      result_.runs += margins.size();
      if (subset_->Done()) EndSubset();
      return;
    case Stage::kPilot:
      result_.runs += margins.size();
      return EndPilot(margins);
    case Stage::kImportance:
      result_.runs += margins.size();
      return EndImportance(margins);
    case Stage::kRandom:
      result_.runs += margins.size();
      return EndRandom(margins);
    case Stage::kDone:
      return;
  }
}

void RareFailure::EndSubset() {
  const SubsetResult& last = subset_->result();
  result_.failed += last.failed;
  if (stage_ == Stage::kRepeat) {
    if (last.end == SubsetEnd::kReached) {
      subsets_.push_back(last);
    } else {
      lost_repeat_ = true;
    }
    return Combine();
  }
  subsets_.push_back(last);
  result_.subset = last;
  if (last.end == SubsetEnd::kStalled && Left() > 0) {
    return StartDraws(Stage::kRandom, Left());
  }
  failures_ = subset_->Failures();
  const auto pilot = static_cast<std::size_t>(kPilot * static_cast<double>(Left()));
  if (last.end != SubsetEnd::kReached || failures_.cols() == 0 ||
      static_cast<double>(Left() - pilot) < kEffective) {
    return Combine();
  }
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(failures_.cols());
  mixture_ = std::make_unique<ScoreMixture>(failures_, ones, Independent(), kWide, options_.seed);
  visited_ = subset_->Visited();
  visited_margins_ = subset_->VisitedMargins();
  MakeSurrogate();
  share_ = surrogate_ ? 0.5 : 0.0;  // the pilot tells which of the two is better
  StartDraws(Stage::kPilot, pilot);
}

// Fitted to all runs so far; those of the last two levels decide on its form.
void RareFailure::MakeSurrogate() {
  const auto& levels = result_.subset.levels;
  const double near = levels.size() > 2 ? levels[levels.size() - 3].threshold
                                        : std::numeric_limits<double>::infinity();
  const auto& components = mixture_->components();
  const auto regions = static_cast<Eigen::Index>(components.size()) - 1;
  Eigen::MatrixXd centres(options_.dimensions, regions);
  for (Eigen::Index k = 0; k < regions; ++k) {
    centres.col(k) = components[static_cast<std::size_t>(k)].mean;
  }
  surrogate_.reset();
  used_ = 0;
  auto surrogate = MarginSurrogate::Fit(visited_, visited_margins_, near, centres);
  if (!surrogate) return;
  // The normalisation's error is then some 6% for the pilot, where it does not count, and 3%.
  const int evaluations = stage_ == Stage::kPilot ? 100000 : 20000;
  surrogate_ =
      SurrogateProposal::Make(std::move(*surrogate), options_.dimensions, options_.runs,
                              evaluations, SplitMix(options_.seed, kSurrogateSeed + result_.runs));
}

// What the failures of the chains are worth in independent points: those that began the last
// levels.
double RareFailure::Independent() const {
  const double seeds = kLevelProbability * options_.runs / kLevels;
  return std::min(seeds, static_cast<double>(subset_->chains()));
}

// Another subset simulation, with all runs that are left.
void RareFailure::Repeat() {
  batch_.clear();
  stage_ = Stage::kRepeat;
  const double levels = static_cast<double>(subsets_[0].levels.size());
  const double runs = static_cast<double>(Left()) / (1.0 + kLevelCost * levels);
  if (runs < static_cast<double>(kFewestRuns) / kLevels) return Combine();
  StartSubset();
}

void RareFailure::StartDraws(Stage stage, std::size_t n) {
  stage_ = stage;
  const CounterRandom random(options_.seed, stage == Stage::kPilot        ? kPilotDraws
                                            : stage == Stage::kImportance ? kImportanceDraws
                                                                          : kRandomDraws);
  drawn_.resize(options_.dimensions, static_cast<Eigen::Index>(n));
  batch_.assign(n, std::vector<double>(static_cast<std::size_t>(options_.dimensions)));
  for (std::size_t i = 0; i < n; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    for (int d = 0; stage == Stage::kRandom && d < options_.dimensions; ++d) {
      drawn_(d, column) = NormalQuantile(random.Uniform(i, static_cast<std::uint32_t>(d)));
    }
    if (stage != Stage::kRandom) {
      const bool from_surrogate = static_cast<double>(i) < share_ * static_cast<double>(n);
      drawn_.col(column) = from_surrogate
                               ? surrogate_->draws().col(static_cast<Eigen::Index>(used_++))
                               : mixture_->Draw(random, i);
    }
    for (int d = 0; d < options_.dimensions; ++d) {
      batch_[i][static_cast<std::size_t>(d)] =
          std::clamp(NormalCdf(drawn_(d, column)), 0x1p-1000, 1.0 - 0x1p-53);
    }
  }
}

// Density of the scores over that of all draws together, those of the surrogate being `share`.
double RareFailure::Weight(const Eigen::VectorXd& z, double share) const {
  double proposal = (1.0 - share) * std::exp(-mixture_->LogWeight(z));
  if (share > 0.0) proposal += share * surrogate_->Ratio(z);
  return 1.0 / proposal;
}

// The share of the surrogate's draws with the most even weights, by the pilot's failures with the
// weights that they had. Returns what one draw is then worth in independent failures.
double RareFailure::BestShare(const Eigen::MatrixXd& hits, const Eigen::VectorXd& weights,
                              std::size_t n) {
  double best = 0.0;
  for (const double share : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
    if (share > 0.0 && !surrogate_) break;
    double square = 0.0;
    for (Eigen::Index i = 0; i < hits.cols(); ++i)
      square += weights[i] * Weight(hits.col(i), share);
    const double worth =
        square > 0.0 ? weights.sum() * weights.sum() / (static_cast<double>(n) * square) : 0.0;
    if (worth <= best) continue;
    best = worth;
    share_ = share;
  }
  return best;
}

RareFailure::Weighted RareFailure::WeightsOf(std::span<const double> margins) const {
  Weighted w;
  w.n = margins.size();
  for (std::size_t i = 0; i < margins.size(); ++i) {
    if (margins[i] >= 0.0) continue;
    const double weight = Weight(drawn_.col(static_cast<Eigen::Index>(i)), share_);
    if (std::isnan(margins[i])) {
      w.failed += weight;
      continue;
    }
    w.sum += weight;
    w.square += weight * weight;
  }
  return w;
}

void RareFailure::EndPilot(std::span<const double> margins) {
  result_.failed += static_cast<std::size_t>(
      std::count_if(margins.begin(), margins.end(), [](double m) { return std::isnan(m); }));
  std::vector<Eigen::Index> which;
  for (std::size_t i = 0; i < margins.size(); ++i) {
    if (margins[i] < 0.0) which.push_back(static_cast<Eigen::Index>(i));
  }
  if (which.empty()) return Repeat();
  const Eigen::MatrixXd hits = drawn_(Eigen::all, which);
  Eigen::VectorXd weights(hits.cols());
  for (Eigen::Index i = 0; i < hits.cols(); ++i) weights[i] = Weight(hits.col(i), share_);
  FitAgain(hits, weights, margins);
  const double each = BestShare(hits, weights, margins.size());
  // Too uneven weights: better another subset simulation.
  if (each * static_cast<double>(Left()) < kEffective) return Repeat();
  StartDraws(Stage::kImportance, Left());
}

// The proposal, again: to the failures of the chains and the weighted ones of the pilot, each in
// proportion to the independent points they are worth.
void RareFailure::FitAgain(const Eigen::MatrixXd& hits, const Eigen::VectorXd& weights,
                           std::span<const double> margins) {
  const Eigen::Index chains = failures_.cols();
  const double independent = Independent();
  const double worth = weights.sum() * weights.sum() / weights.squaredNorm();
  Eigen::MatrixXd points(options_.dimensions, chains + hits.cols());
  points << failures_, hits;
  Eigen::VectorXd all(points.cols());
  all.head(chains).setConstant(independent / static_cast<double>(chains));
  all.tail(hits.cols()) = weights * (worth / weights.sum());
  mixture_ =
      std::make_unique<ScoreMixture>(points, all, independent + worth, kWide, options_.seed + 1);
  const Eigen::Index before = visited_.cols();
  visited_.conservativeResize(Eigen::NoChange, before + drawn_.cols());
  Eigen::Index n = before;
  for (std::size_t i = 0; i < margins.size(); ++i) {
    if (std::isnan(margins[i])) continue;
    visited_.col(n++) = drawn_.col(static_cast<Eigen::Index>(i));
    visited_margins_.push_back(margins[i]);
  }
  visited_.conservativeResize(Eigen::NoChange, n);
  MakeSurrogate();
}

void RareFailure::EndImportance(std::span<const double> margins) {
  importance_ = WeightsOf(margins);
  result_.failed += static_cast<std::size_t>(
      std::count_if(margins.begin(), margins.end(), [](double m) { return std::isnan(m); }));
  Combine();
}

void RareFailure::EndRandom(std::span<const double> margins) {
  std::size_t failures = 0, counted = 0;
  for (double m : margins) {
    if (std::isnan(m)) ++result_.failed;
    failures += m < 0.0 ? 1 : 0;
    counted += std::isnan(m) ? 0 : 1;
  }
  batch_.clear();
  stage_ = Stage::kDone;
  result_.method = RareMethod::kRandom;
  const double n = static_cast<double>(std::max<std::size_t>(counted, 1));
  result_.probability = static_cast<double>(failures) / n;
  result_.variation = failures == 0 ? 1.0 : std::sqrt((1.0 - result_.probability) / failures);
  const auto [low, high] =
      BinomialInterval(failures, std::max<std::size_t>(counted, 1), options_.confidence);
  result_.interval = {low, high};
  result_.with_failed = static_cast<double>(failures + margins.size() - counted) /
                        static_cast<double>(margins.size());
  Judge();
}

void RareFailure::Combine() {
  batch_.clear();
  stage_ = Stage::kDone;
  const double repeats = static_cast<double>(subsets_.size());
  double square = 0.0, bounds = 0.0;
  for (const SubsetResult& s : subsets_) {
    result_.probability += s.probability / repeats;
    result_.with_failed += s.with_failed / repeats;
    square += std::pow(s.probability * s.variation / repeats, 2.0);
    double bound = 0.0;
    for (const SubsetLevel& level : s.levels) bound += level.error;
    bounds += std::pow(s.probability * bound / repeats, 2.0);
  }
  result_.variation = result_.probability > 0.0 ? std::sqrt(square) / result_.probability : 1.0;
  constexpr double kMany = 1e6;  // degrees of freedom: Student's t is then a normal variable
  double freedom = kMany;
  // The interval of chains is that of levels which depend on each other in full, the upper bound of
  // [Au and Beck 2001]: margins with noise come near it.
  double width = result_.probability > 0.0 ? std::sqrt(bounds) / result_.probability : 1.0;
  if (importance_) {
    const double n = static_cast<double>(importance_->n);
    result_.importance = importance_->sum / n;
    result_.effective = importance_->Effective();
    result_.components = static_cast<int>(mixture_->components().size()) - 1;
    if (result_.effective >= kEffective) {
      result_.method = RareMethod::kImportance;
      result_.probability = std::min(1.0, result_.importance);
      // The draws see failed runs only where they are; the levels saw them everywhere.
      result_.with_failed =
          std::max(result_.with_failed, (importance_->sum + importance_->failed) / n);
      // Variance of the mean of n independent weights, 0 where a draw did not fail.
      // n equal weights leave what the rule of three does: a share of 3.7 / n not seen, at 95%.
      result_.variation =
          std::max(2.0 / n, std::sqrt(std::max(1.0 / result_.effective - 1.0 / n, 0.0)));
      if (share_ > 0.0) {
        const double own = share_ * surrogate_->variation();
        result_.variation = std::hypot(result_.variation, own);
        // Degrees of freedom of the sum, of which only this part has few [Satterthwaite 1946].
        freedom = std::min(
            kMany, (SurrogateProposal::kReplicates - 1) * std::pow(result_.variation / own, 4.0));
      }
      width = result_.variation;
    }
  }
  result_.interval = LogNormalInterval(result_.probability, width, options_.confidence, freedom);
  Judge();
}

}  // namespace unfurl::campaign
