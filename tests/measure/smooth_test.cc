#include "measure/smooth.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/random_vector.h"
#include "base/statistics.h"

namespace unfurl::measure::smooth_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Tracks of one mark at 200 Hz with a covariance that leans; `truth` 3 x n.
struct Recorded {
  data::Tracks tracks;
  Eigen::Matrix3Xd truth;
};

template <typename Path>
Recorded Record(std::size_t n, double dt, std::uint64_t seed, const Path& path) {
  Recorded out;
  Rng rng(seed);
  data::Tracks& tracks = out.tracks;
  tracks.frame = "rig";
  tracks.marks = {"mark1"};
  const auto size = static_cast<Eigen::Index>(n);
  tracks.p.resize(3, size);
  tracks.cov.resize(6, size);
  out.truth.resize(3, size);
  Eigen::Matrix3d C;
  C << 4e-9, 1e-9, -1e-9, 1e-9, 2e-9, 5e-10, -1e-9, 5e-10, 9e-9;  // 0.05 to 0.1 mm
  const Eigen::Matrix3d L = C.llt().matrixL();
  for (std::size_t i = 0; i < n; ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    tracks.t.push_back(dt * static_cast<double>(i));
    tracks.mark.push_back(0);
    tracks.status.push_back(data::SampleStatus::kGood);
    out.truth.col(col) = path(tracks.t.back());
    const Eigen::Vector3d z = NormalVector(&rng);
    tracks.p.col(col) = out.truth.col(col) + L * z;
    tracks.cov.col(col) << C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2);
  }
  return out;
}

double Nees(const data::Tracks& tracks, const Eigen::Matrix3Xd& truth, std::size_t i) {
  const Eigen::Vector3d e =
      tracks.p.col(static_cast<Eigen::Index>(i)) - truth.col(static_cast<Eigen::Index>(i));
  return e.dot(tracks.Covariance(i).ldlt().solve(e));
}

// White jerk drawn step by step: what the smoother takes the motion for.
struct WhiteJerk {
  Rng rng;
  double jerk, last = 0.0;
  Eigen::Vector3d p{0.1, 0.2, 0.3}, v{0.5, -0.3, 0.1}, a{1.0, 0.0, -1.0};
  Eigen::Vector3d operator()(double t) {
    const double dt = t - last;
    last = t;
    if (dt > 0.0) {
      Eigen::Matrix3d Q;
      Q << std::pow(dt, 5) / 20.0, std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 6.0,
          std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 3.0, dt * dt / 2.0, std::pow(dt, 3) / 6.0,
          dt * dt / 2.0, dt;
      const Eigen::Matrix3d L = (jerk * Q).llt().matrixL();
      p += dt * v + 0.5 * dt * dt * a;
      v += dt * a;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d z = NormalVector(&rng);
        const Eigen::Vector3d kick = L * z;
        p(k) += kick(0);
        v(k) += kick(1);
        a(k) += kick(2);
      }
    }
    return p;
  }
};

TEST(Smooth, ErrorsAreWhatItsCovarianceSays) {
  // Generator = model, process noise from the data: 60 records of 300 samples. Smoothed errors are
  // correlated over some ten samples, so every 15th counts as independent: mean of the normalised
  // squares 3 within four standard errors, and 95% regions that cover 95%.
  constexpr int kRecords = 60;
  std::vector<double> nees, raw_error, error;
  for (int r = 0; r < kRecords; ++r) {
    WhiteJerk path{Rng(1000 + static_cast<std::uint64_t>(r)), 1e3};
    const Recorded recorded =
        Record(300, 5e-3, static_cast<std::uint64_t>(r), [&](double t) { return path(t); });
    SmoothReport report;
    const data::Tracks smooth = Smooth(recorded.tracks, {}, &report);
    ASSERT_TRUE(smooth.smoothed);
    ASSERT_EQ(report.sections.size(), 1U);
    EXPECT_NEAR(std::log10(report.sections[0].jerk), 3.0, 1.0);
    for (std::size_t i = 7; i < 300; i += 15) {
      nees.push_back(Nees(smooth, recorded.truth, i));
      const auto col = static_cast<Eigen::Index>(i);
      error.push_back((smooth.p.col(col) - recorded.truth.col(col)).norm());
      raw_error.push_back((recorded.tracks.p.col(col) - recorded.truth.col(col)).norm());
    }
  }
  const double count = static_cast<double>(nees.size());
  EXPECT_NEAR(Mean(nees), 3.0, 4.0 * std::sqrt(6.0 / count));
  const double limit = ChiSquareQuantile(0.95, 3.0);
  std::size_t covered = 0;
  for (double x : nees) covered += x <= limit;
  const auto [low, high] = BinomialInterval(covered, nees.size(), 0.9999);
  EXPECT_LT(low, 0.95);
  EXPECT_GT(high, 0.95);
  EXPECT_LT(Rms(error), 0.6 * Rms(raw_error));  // and it is worth it
}

// A swing that loses 1.5 m/s in an instant, as a latch takes it.
Eigen::Vector3d Kicked(double t) {
  constexpr double kAt = 0.7523;
  const double x = t < kAt ? 0.9 * (t - kAt) : -0.6 * (t - kAt);
  return {x, 0.3 * std::sin(2.0 * t), 0.02 * std::cos(3.0 * t)};
}

TEST(Smooth, AKickAtAKnownTimeIsNotRoundedOff) {
  // Around the kick, over many draws: with its time the errors are what the covariance says;
  // without it the smoother's own process noise takes the kick up, and the gain elsewhere is lost.
  constexpr int kDraws = 40;
  std::vector<double> near, near_rough, calm, calm_rough;
  for (int r = 0; r < kDraws; ++r) {
    const Recorded recorded = Record(300, 5e-3, 50 + static_cast<std::uint64_t>(r), Kicked);
    SmoothOptions options;
    options.events = {0.7523};
    SmoothReport report;
    const data::Tracks known = Smooth(recorded.tracks, options, &report);
    EXPECT_EQ(report.events.size(), 1U);
    EXPECT_EQ(report.sections.size(), 2U);
    const data::Tracks unknown = Smooth(recorded.tracks);
    for (std::size_t i = 146; i < 156; ++i) {
      near.push_back(Nees(known, recorded.truth, i));
      near_rough.push_back(Nees(unknown, recorded.truth, i));
    }
    for (std::size_t i = 60; i < 100; ++i) {
      const auto col = static_cast<Eigen::Index>(i);
      calm.push_back((known.p.col(col) - recorded.truth.col(col)).norm());
      calm_rough.push_back((unknown.p.col(col) - recorded.truth.col(col)).norm());
    }
  }
  // 40 draws of 10 neighbours, taken as 40 x 3 independent ones.
  EXPECT_NEAR(Mean(near), 3.0, 4.0 * std::sqrt(6.0 / (3.0 * kDraws)));
  EXPECT_LT(Rms(calm), 0.6 * Rms(calm_rough));
}

TEST(Smooth, AnUncertainEventTimeCostsALittleAndNoTruth) {
  constexpr int kDraws = 40;
  std::vector<double> nees;
  for (int r = 0; r < kDraws; ++r) {
    const Recorded recorded = Record(300, 5e-3, 90 + static_cast<std::uint64_t>(r), Kicked);
    SmoothOptions options;
    options.events = {0.7523 + (r % 2 == 0 ? 0.006 : -0.006)};
    options.event_sigma = 0.008;
    const data::Tracks smooth = Smooth(recorded.tracks, options);
    for (std::size_t i = 146; i < 156; ++i) nees.push_back(Nees(smooth, recorded.truth, i));
  }
  EXPECT_NEAR(Mean(nees), 3.0, 4.0 * std::sqrt(6.0 / (3.0 * kDraws)));
}

TEST(Smooth, GapsStayGaps) {
  Recorded recorded = Record(300, 5e-3, 5, Kicked);
  for (std::size_t i = 40; i < 90; ++i) {
    recorded.tracks.status[i] = data::SampleStatus::kUnsolvable;
    recorded.tracks.p.col(static_cast<Eigen::Index>(i)).setConstant(kNan);
    recorded.tracks.cov.col(static_cast<Eigen::Index>(i)).setConstant(kNan);
  }
  SmoothReport report;
  const data::Tracks smooth = Smooth(recorded.tracks, {}, &report);
  ASSERT_EQ(smooth.size(), 300U);
  EXPECT_EQ(report.sections.size(), 2U);
  for (std::size_t i = 0; i < 300; ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_EQ(smooth.t[i], recorded.tracks.t[i]);
    EXPECT_EQ(smooth.status[i], recorded.tracks.status[i]);
    EXPECT_EQ(smooth.p.col(col).allFinite(), i < 40 || i >= 90);
  }
  // Nothing crosses the gap: what stands before it is the same without what comes after.
  data::Tracks before = recorded.tracks;
  for (std::size_t i = 90; i < 300; ++i) before.status[i] = data::SampleStatus::kUnsolvable;
  const data::Tracks alone = Smooth(before);
  for (Eigen::Index i = 0; i < 40; ++i) EXPECT_EQ((alone.p.col(i) - smooth.p.col(i)).norm(), 0.0);
}

TEST(Smooth, TheSharedPartGoesThroughTheSameGains) {
  // The calibration's error shifts the samples by F z; smoothing shifted samples must give the
  // smoothed track shifted by the smoothed F z, at the same process noise.
  Recorded recorded = Record(200, 5e-3, 6, Kicked);
  data::Tracks& tracks = recorded.tracks;
  tracks.shared_rank = 2;
  tracks.shared.resize(3, 400);
  for (Eigen::Index i = 0; i < 200; ++i) {
    const double s = 1e-3 * static_cast<double>(i);
    tracks.shared.col(2 * i) = Eigen::Vector3d(1e-4, 2e-4 * s, 0.0);
    tracks.shared.col(2 * i + 1) = Eigen::Vector3d(0.0, 1e-4 * std::sin(10.0 * s), 3e-4);
  }
  data::Tracks shifted = tracks;
  const Eigen::Vector2d z(1.5, -0.7);
  for (Eigen::Index i = 0; i < 200; ++i) {
    shifted.p.col(i) += tracks.shared.middleCols(2 * i, 2) * z;
  }
  SmoothOptions options;
  options.jerk = 1e4;
  const data::Tracks a = Smooth(tracks, options), b = Smooth(shifted, options);
  for (Eigen::Index i = 0; i < 200; ++i) {
    const Eigen::Vector3d expected = a.p.col(i) + a.shared.middleCols(2 * i, 2) * z;
    EXPECT_LT((b.p.col(i) - expected).norm(), 1e-10);  // 1e-4 of a sigma
  }
}

TEST(Smooth, LongTracksInPiecesAreTheSame) {
  WhiteJerk path{Rng(4), 1e3};
  const Recorded recorded = Record(5000, 5e-3, 7, [&](double t) { return path(t); });
  SmoothOptions options;
  options.jerk = 1e3;
  const data::Tracks whole = Smooth(recorded.tracks, options);
  // The stretch from 1500 to 3500 alone holds the seam at 2000 in its middle.
  data::Tracks part = recorded.tracks;
  for (std::size_t i = 0; i < 5000; ++i) {
    if (i < 1500 || i >= 3400) part.status[i] = data::SampleStatus::kUnsolvable;
  }
  const data::Tracks piece = Smooth(part, options);
  for (Eigen::Index i = 1800; i < 3100; ++i) {
    EXPECT_LT((piece.p.col(i) - whole.p.col(i)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace unfurl::measure::smooth_test
