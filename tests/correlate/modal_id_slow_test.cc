// Modes from free decays against the Cramer-Rao bound, 1000 draws each.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/modes/modal_id.h"
#include "tests/correlate/free_decay.h"

namespace unfurl::correlate::modal_id_slow_test {
namespace {

constexpr std::size_t kDraws = 1000;
constexpr double kOverBound = 1.2;  // issue: RMSE over the Cramer-Rao bound, at most
// Draws with another number of modes than planted, at most: failures count as misses.
constexpr std::size_t kMisses = 10;

class ModalIdRepeats : public testing::TestWithParam<int> {};

TEST_P(ModalIdRepeats, ThousandDrawsAtTwentyDecibels) {
  const PlantedDecay planted = StrobedDecay(GetParam(), 10.0);
  const Eigen::VectorXd bound = planted.Bound();
  std::vector<DecayFit> fits(kDraws);
  ParallelFor(kDraws, 0, [&](std::size_t i) {
    Rng rng = Rng(2024).Stream("draw", i);
    fits[i] = IdentifyModes(planted.Draw(rng)).decay;
  });
  std::size_t misses = 0;
  const auto count = static_cast<std::size_t>(bound.size());
  std::vector<std::vector<double>> error(count), z(count);
  std::size_t covered = 0, intervals = 0;
  for (const DecayFit& fit : fits) {
    if (!fit.Usable() || fit.modes.size() != planted.modes.size()) {
      ++misses;
      continue;
    }
    for (std::size_t k = 0; k < planted.modes.size(); ++k) {
      const Mode& m = fit.modes[k];
      error[2 * k].push_back(m.frequency - planted.modes[k].frequency);
      error[2 * k + 1].push_back(m.damping - planted.modes[k].damping);
      z[2 * k].push_back(error[2 * k].back() / m.frequency_sigma);
      z[2 * k + 1].push_back(error[2 * k + 1].back() / m.damping_sigma);
      for (std::size_t j : {2 * k, 2 * k + 1}) {
        covered += std::abs(z[j].back()) < NormalQuantile(0.975) ? 1 : 0;
        ++intervals;
      }
    }
  }
  fmt::print("{} modes: {} misses of {}; RMSE over bound", GetParam(), misses, kDraws);
  for (std::size_t j = 0; j < count; ++j) {
    const double ratio = Rms(error[j]) / bound(static_cast<Eigen::Index>(j));
    fmt::print(" {:.3f}", ratio);
    EXPECT_LT(ratio, kOverBound);
    // Four standard deviations of a variance from 1000 draws.
    EXPECT_NEAR(Variance(z[j]), 1.0, 4.0 * std::sqrt(2.0 / kDraws));
  }
  fmt::print("; 95% intervals cover {:.1f}%\n",
             100.0 * static_cast<double>(covered) / static_cast<double>(intervals));
  EXPECT_LE(misses, kMisses);
}
INSTANTIATE_TEST_SUITE_P(OneToThreeModes, ModalIdRepeats, testing::Values(1, 2, 3));

}  // namespace
}  // namespace unfurl::correlate::modal_id_slow_test
