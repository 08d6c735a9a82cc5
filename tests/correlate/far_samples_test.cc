// Samples off by more than a mark moves, on a path of parabolas and impacts in closed form.
#include "correlate/align/far_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "base/random_vector.h"

namespace unfurl::correlate::far_samples_test {
namespace {

constexpr double kSigma = 2e-4;  // [m]

// A ball that is thrown along x, bounces elastically on y = 0, and swings in z; sampled unevenly.
Observations Ball(double step, Rng* rng) {
  Observations o;
  MarkSeries mark;
  mark.name = "ball";
  constexpr int kSamples = 400;
  mark.p.resize(3, kSamples);
  mark.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, kSamples);
  mark.shared.resize(3, 0);
  constexpr double kG = 9.81, kSpeed = 2.4;  // [m/s^2, m/s]
  constexpr double kFlight = 2.0 * kSpeed / kG;
  for (int i = 0; i < kSamples; ++i) {
    const double t = step * (i + rng->Uniform(-0.2, 0.2));
    const double s = std::fmod(t + kFlight, kFlight);
    mark.t.push_back(t);
    mark.p.col(i) << 0.3 * t, kSpeed * s - 0.5 * kG * s * s, 0.1 * std::sin(5.0 * t);
    for (int axis = 0; axis < 3; ++axis) mark.p(axis, i) += kSigma * rng->Normal();
    for (int row : {0, 3, 5}) mark.cov(row, i) = kSigma * kSigma;
  }
  o.marks.push_back(mark);
  return o;
}

TEST(FarSamples, OfACleanRecordThereAreNone) {
  int records = 0;
  for (double step : {1e-3, 5e-3, 2e-2, 5e-2}) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      Rng rng(seed);
      records += FindFarSamples(Ball(step, &rng)).empty() ? 0 : 1;
    }
  }
  EXPECT_LE(records, 8);  // one in a hundred of 200: P(> 8) < 1e-3
}

TEST(FarSamples, AreFoundAndNothingElse) {
  std::size_t planted = 0, missed = 0, wrongly = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    Observations o = Ball(5e-3, &rng);
    std::set<std::size_t> at;
    for (std::size_t i = 0; i < o.marks[0].size(); ++i) {
      if (rng.Uniform() > 0.05) continue;
      at.insert(i);
      Eigen::Vector3d off = NormalVector(&rng);
      o.marks[0].p.col(static_cast<Eigen::Index>(i)) += 0.2 * off.normalized();
    }
    std::set<std::size_t> found;
    for (const FarSample& f : FindFarSamples(o)) found.insert(f.index);
    planted += at.size();
    for (std::size_t i : at) missed += found.count(i) == 0 ? 1 : 0;
    for (std::size_t i : found) wrongly += at.count(i) == 0 ? 1 : 0;
    // Taken out, the record is a clean one of as many samples fewer.
    const std::vector<FarSample> far = FindFarSamples(o);
    EXPECT_EQ(Without(o, far).size(), o.size() - far.size());
  }
  // Three gross ones within four samples hide one another: some in a thousand.
  EXPECT_LT(missed, planted / 50) << planted;
  EXPECT_LT(wrongly, planted / 50) << planted;
}

TEST(FarSamples, AreAsWideAsTheyAreOff) {
  Rng rng(1);
  Observations o = Ball(5e-3, &rng);
  o.marks[0].p(0, 100) += 0.2;
  const std::vector<FarSample> far = FindFarSamples(o);
  ASSERT_EQ(far.size(), 1u);
  EXPECT_EQ(far[0].index, 100u);
  EXPECT_NEAR(far[0].distance, 0.2, 0.01);
  EXPECT_NEAR(std::sqrt(Widened(o, far).marks[0].cov(0, 100)), 0.2, 0.01);
  EXPECT_NE(Words(o, far).find("'ball' at 0.5"), std::string::npos) << Words(o, far);
}

}  // namespace
}  // namespace unfurl::correlate::far_samples_test
