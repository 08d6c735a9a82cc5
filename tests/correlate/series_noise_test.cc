#include "correlate/fit/series_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "base/random.h"
#include "base/statistics.h"

namespace unfurl::correlate::series_noise_test {
namespace {

// Two marks with stamps of their own, one with a gap; positions do not matter here.
Observations Uneven(std::size_t n) {
  Observations o;
  for (int m = 0; m < 2; ++m) {
    MarkSeries mark;
    mark.name = m == 0 ? "a" : "b";
    for (std::size_t i = 0; i < n; ++i) {
      mark.t.push_back(0.01 * static_cast<double>(i) + 0.003 * m + (i > n / 2 ? 0.055 * m : 0.0));
    }
    const auto columns = static_cast<Eigen::Index>(n);
    mark.p = Eigen::Matrix3Xd::Zero(3, columns);
    mark.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, columns);
    o.marks.push_back(std::move(mark));
  }
  return o;
}

// The covariance written out.
Eigen::MatrixXd Dense(const Observations& o, const SeriesNoise& noise) {
  const auto rows = 3 * static_cast<Eigen::Index>(o.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::Index first = 0;
  for (std::size_t m = 0; m < o.marks.size(); ++m) {
    const auto n = static_cast<Eigen::Index>(o.marks[m].size());
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const MarkovNoise& own = noise.series[3 * m + static_cast<std::size_t>(axis)];
      for (Eigen::Index i = 0; i < n; ++i) {
        for (Eigen::Index j = 0; j < n; ++j) {
          const double lag = std::abs(o.marks[m].t[static_cast<std::size_t>(i)] -
                                      o.marks[m].t[static_cast<std::size_t>(j)]) /
                             0.01;
          const double correlated = own.share * std::pow(own.rho, lag);
          const double value = own.variance * (correlated + (i == j ? 1.0 - own.share : 0.0));
          G(first + 3 * i + axis, first + 3 * j + axis) = own.white() && i != j ? 0.0 : value;
        }
      }
    }
    first += 3 * n;
  }
  return G;
}

TEST(SeriesNoise, TheFilterInvertsTheCovariance) {
  const Observations o = Uneven(20);
  SeriesNoise noise;
  noise.series = {{2.0, 0.7, 0.9},  {1.0, 0.2, 0.5}, {1.5, 0.0, 0.0},
                  {1.0, 0.9, 0.98}, {3.0, 0.5, 0.3}, {1.0, 0.999, 0.99}};
  const Eigen::MatrixXd G = Dense(o, noise);
  Eigen::MatrixXd L = Eigen::MatrixXd::Identity(G.rows(), G.cols());
  RowWhitening(o, noise).Apply(L);
  // Shares up to 0.9999 are taken as they are; round-off of 20 steps is all that is left.
  EXPECT_LT((L * G * L.transpose() - Eigen::MatrixXd::Identity(G.rows(), G.cols())).norm(), 1e-9);
}

TEST(SeriesNoise, RestrictedLikelihoodFindsWhatWasPlanted) {
  // Six series of 300 with a slope and an offset taken out of each: plain maximum likelihood would
  // think rho and the variance smaller.
  const Observations o = Uneven(300);
  const auto rows = 3 * static_cast<Eigen::Index>(o.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows, 2);
  for (Eigen::Index i = 0; i < rows; ++i) A(i, 0) = 1.0, A(i, 1) = static_cast<double>(i % 900);
  SeriesNoise truth;
  truth.series.assign(6, {4.0, 0.75, 0.95});
  const Eigen::MatrixXd root = Dense(o, truth).llt().matrixL();
  std::vector<double> innovation, white;
  constexpr int kSeeds = 12;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(seed + 1);
    Eigen::VectorXd e(rows);
    for (Eigen::Index i = 0; i < rows; ++i) e(i) = rng.Normal();
    const Eigen::VectorXd residual = root * e + 30.0 * A.col(0) + 0.1 * A.col(1);
    const SeriesNoise found = FitSeriesNoise(o, residual, A);
    EXPECT_EQ(found.pooled, "all series") << "one noise for all was planted";
    EXPECT_FALSE(found.white());
    const MarkovNoise& n = found.series[0];
    innovation.push_back(n.variance * n.share * (1.0 - n.rho * n.rho));
    white.push_back(n.variance * (1.0 - n.share));
  }
  // 1800 values: either part scatters by some percent; the mean of 12 by a few at most.
  EXPECT_NEAR(Mean(innovation), 4.0 * 0.75 * (1.0 - 0.95 * 0.95),
              4.0 * std::sqrt(Variance(innovation) / kSeeds));
  EXPECT_NEAR(Mean(white), 1.0, 4.0 * std::sqrt(Variance(white) / kSeeds));
}

TEST(SeriesNoise, WhiteNoiseIsLeftAlone) {
  const Observations o = Uneven(200);
  const auto rows = 3 * static_cast<Eigen::Index>(o.size());
  const Eigen::MatrixXd A = Eigen::MatrixXd::Ones(rows, 1);
  int coloured = 0;
  constexpr int kSeeds = 60, kMost = 3;  // 5%; the criterion's own rate is far below
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(seed + 100);
    Eigen::VectorXd residual(rows);
    for (Eigen::Index i = 0; i < rows; ++i) residual(i) = rng.Normal();
    coloured += FitSeriesNoise(o, residual, A).white() ? 0 : 1;
  }
  EXPECT_LE(coloured, kMost);
}

// Many directions of a calibration that differ at a mark that hardly moves by no more than the
// samples' scatter, at which they were evaluated: they are not felt, and white noise stays white.
TEST(SeriesNoise, DirectionsThatFollowTheScatterTakeNothingOut) {
  Observations o = Uneven(200);
  const auto rows = 3 * static_cast<Eigen::Index>(o.size());
  constexpr int kDirections = 30;
  constexpr double kSlope = 1e-3;  // of a direction's effect, per sigma of a sample
  o.shared_rank = kDirections;
  Rng rng(4);
  Eigen::VectorXd residual(rows);
  for (Eigen::Index i = 0; i < rows; ++i) residual(i) = rng.Normal();
  Eigen::MatrixXd A(rows, 1 + kDirections);
  A.col(0).setOnes();
  for (Eigen::Index k = 0; k < kDirections; ++k) {
    const double place = rng.Normal();
    for (Eigen::Index i = 0; i < rows; ++i) {
      A(i, 1 + k) =
          20.0 * std::sin(place + kSlope * (1.0 + 0.1 * static_cast<double>(k)) * residual(i));
    }
  }
  EXPECT_TRUE(FitSeriesNoise(o, residual, A).white());
}

// Noise that drifts for far longer than its record, read ten times as often, has the same longest
// correlation time in seconds: no limit is counted in samples.
TEST(SeriesNoise, TheLongestCorrelationTimeIsThatOfTheClock) {
  constexpr int kRatio = 10, kSamples = 20000;
  constexpr double kTime = 1e4, kStep = 1e-3, kWhite = 0.01;  // [s], [s], standard deviation
  Rng rng(3);
  const double decay = std::exp(-kStep / kTime);
  Eigen::Matrix3Xd noise(3, kSamples);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    double state = rng.Normal();
    for (Eigen::Index i = 0; i < kSamples; ++i) {
      if (i > 0) state = decay * state + std::sqrt(1.0 - decay * decay) * rng.Normal();
      noise(axis, i) = state + kWhite * rng.Normal();
    }
  }
  std::vector<double> times;
  for (const int every : {1, kRatio}) {
    const int n = kSamples / every;
    Observations o;
    MarkSeries mark;
    mark.name = "a";
    Eigen::VectorXd residual(3 * n);
    for (int i = 0; i < n; ++i) {
      mark.t.push_back(kStep * every * i);
      residual.segment<3>(3 * i) = noise.col(every * i);
    }
    mark.p = Eigen::Matrix3Xd::Zero(3, n);
    mark.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, n);
    o.marks.push_back(std::move(mark));
    // Nothing is taken out: that the drift begins far from zero tells that it is slow.
    const SeriesNoise found = FitSeriesNoise(o, residual, Eigen::MatrixXd::Zero(3 * n, 1));
    times.push_back(-kStep * every / std::log(found.series[0].rho));
  }
  EXPECT_GT(times[0], kStep * kSamples);        // longer than the record
  EXPECT_NEAR(times[1] / times[0], 1.0, 1e-3);  // which is a sample longer or shorter
}

}  // namespace
}  // namespace unfurl::correlate::series_noise_test
