// Records that begin at the release, after it, or before a model that starts in motion.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "correlate/align/align.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate::beginning_test {
namespace {

// The two-link arm from `start` on, when it swings already: nothing is known of what was before.
class InMotion : public Model {
 public:
  explicit InMotion(double start) : start_(start) {}
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Stamps later = stamps;
    for (auto& list : later.t) {
      for (double& t : list) t += start_;
    }
    Prediction out = arm_.Evaluate(theta, later);
    out.held_before = false;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      out.marks[m].known.assign(stamps.t[m].size(), 1);
      for (std::size_t i = 0; i < stamps.t[m].size(); ++i) {
        if (stamps.t[m][i] >= 0.0) continue;
        out.marks[m].known[i] = 0;
        out.marks[m].p.col(static_cast<Eigen::Index>(i)).setZero();
        out.marks[m].v.col(static_cast<Eigen::Index>(i)).setZero();
      }
    }
    return out;
  }

 private:
  TwoLink arm_;
  double start_;
};

// Of so many seeds: in how many offset and both values are within 4.5 standard errors (one in
// 100 000), and how many are told that the model does not explain the data.
struct Tally {
  int right = 0, unexplained = 0;
  std::string words;  // of the others
};

Tally Repeat(const Model& model, double expected_offset,
             const std::function<Observations(std::uint64_t seed)>& data, int seeds) {
  Tally out;
  for (int seed = 0; seed < seeds; ++seed) {
    const Observations observations = data(static_cast<std::uint64_t>(seed));
    const FitResult fit = FitTwoLink(model, observations, false);
    if (!fit.Usable()) {
      out.words += fmt::format("seed {}: {}\n", seed, fit.message);
      continue;
    }
    out.unexplained += fit.trials[0].goodness.outcome == Explained::kNo ? 1 : 0;
    const auto names = NamesOf(fit.trials[0].nuisances);
    const auto at = std::find(names.begin(), names.end(), "time offset") - names.begin();
    double most =
        std::abs(fit.trials[0].at.offset - expected_offset) / fit.trials[0].nuisance_sigma(at);
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      most = std::max(most, std::abs(e.value - TwoLink::Truth()[j]) / e.sigma);
    }
    constexpr double kMost = 4.5;
    out.right += most < kMost ? 1 : 0;
    if (!(most < kMost)) out.words += fmt::format("seed {}: {:.3g} sigma\n", seed, most);
  }
  return out;
}

void ExpectRight(const Tally& tally, int seeds) {
  EXPECT_EQ(tally.right, seeds) << tally.words;
  EXPECT_LE(tally.unexplained, 2);  // of 20, at one in a hundred each
}

constexpr int kSeeds = 20;

TEST(Beginning, AtTheRelease) {
  Trial trial = SparseTrial();
  trial.before = 0.0;
  ExpectRight(
      Repeat(
          TwoLink(), trial.offset,
          [&](std::uint64_t seed) {
            Rng rng(900 + seed);
            return Record(TwoLink(), TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
          },
          kSeeds),
      kSeeds);
}

TEST(Beginning, AfterTheRelease) {
  const Trial trial = SparseTrial();
  ExpectRight(Repeat(
                  TwoLink(), trial.offset,
                  [&](std::uint64_t seed) {
                    Rng rng(900 + seed);
                    const Observations all =
                        Record(TwoLink(), TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
                    return Cut(all, {trial.offset + 0.7, 100.0});
                  },
                  kSeeds),
              kSeeds);
}

TEST(Beginning, OfAModelThatStartsInMotion) {
  const Trial trial = SparseTrial();
  const double start = 0.5;
  ExpectRight(
      Repeat(
          InMotion(start), trial.offset + start,
          [&](std::uint64_t seed) {
            Rng rng(900 + seed);
            return Record(TwoLink(), TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
          },
          kSeeds),
      kSeeds);
}

}  // namespace
}  // namespace unfurl::correlate::beginning_test
