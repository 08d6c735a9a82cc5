#include "correlate/align/align.h"

#include <gtest/gtest.h>

#include "base/statistics.h"
#include "correlate/align/body_angle.h"
#include "correlate/align/unit_doubt.h"
#include "correlate/compare/metrics.h"
#include "tests/correlate/two_link.h"
#include "tests/repeats.h"

namespace unfurl::correlate::align_test {
namespace {

SampledModel Reference(double duration = 4.0) {
  return SampledModel(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), 0.0, duration, 1e-3);
}

Observations NoisyTrial(const Trial& trial, std::uint64_t seed) {
  Rng rng(seed);
  return Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng);
}

// The same trial by a clock that runs fast, as read at the record's middle.
Observations WithDrift(Observations o, double drift) {
  const double pivot = 0.5 * (o.Start() + o.End());
  for (MarkSeries& m : o.marks) {
    for (double& t : m.t) t = pivot + (t - pivot) * (1.0 + drift);
  }
  return o;
}

// Swings: three sines between 0.3 and 4 Hz. Openings: a smooth step at a random time, then a ring.
// Walks: a filtered random walk. Each coordinate of each mark by itself, 4 s, 0.1 mm of noise.
enum class Kind { kSwing, kOpening, kWalk };
Observations RandomMotion(Kind kind, int marks, Rng rng) {
  constexpr Eigen::Index kN = 800;
  constexpr double kTau = 2.0 * std::numbers::pi, kSigma = 1e-4;
  Observations o;
  for (int m = 0; m < marks; ++m) {
    MarkSeries s;
    s.name = std::string(1, static_cast<char>('a' + m));
    s.p.setZero(3, kN);
    s.cov.resize(6, kN);
    s.shared.resize(3, 0);
    for (Eigen::Index i = 0; i < kN; ++i) s.t.push_back(0.005 * static_cast<double>(i));
    const Eigen::Map<const Eigen::ArrayXd> t(s.t.data(), kN);
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::ArrayXd x = Eigen::ArrayXd::Zero(kN);
      if (kind == Kind::kSwing) {
        for (int k = 0; k < 3; ++k) {
          const double f = rng.Uniform(0.3, 4.0), phase = rng.Uniform(0.0, kTau);
          x += rng.Uniform(0.1, 0.3) * (kTau * f * t + phase).cos();
        }
      } else if (kind == Kind::kOpening) {
        const double start = rng.Uniform(0.5, 3.0), length = rng.Uniform(0.2, 1.0);
        const double size = rng.Uniform(-1.5, 1.5), f = rng.Uniform(1.0, 6.0);
        const Eigen::ArrayXd u = (t - start) / length;
        x = size / (1.0 + (-4.0 * u).exp()) +
            (u > 0.0).select(0.05 * (-0.3 * u).exp() * (kTau * f * u).sin(), 0.0);
      } else {
        double v = 0.0, at = 0.0;
        for (Eigen::Index i = 0; i < kN; ++i) {
          v = 0.98 * v + 0.02 * rng.Normal();
          x(i) = at += 0.05 * v;
        }
      }
      s.p.row(axis) = x.matrix().transpose();
    }
    for (Eigen::Index i = 0; i < kN; ++i) {
      s.cov.col(i) << kSigma * kSigma, 0, 0, kSigma * kSigma, 0, kSigma * kSigma;
      for (int axis = 0; axis < 3; ++axis) s.p(axis, i) += kSigma * rng.Normal();
    }
    o.marks.push_back(std::move(s));
  }
  return o;
}

double AngleBetween(const Pose& a, const Pose& b) {
  return VectorFromRotation(a.linear() * b.linear().transpose()).norm();
}

TEST(Align, FindsOffsetAndFrameOfAnExactRecord) {
  Trial trial = TiltedTrial();
  trial.sigma = 1e-9;
  const Alignment a = Align(NoisyTrial(trial, 1), Reference());
  ASSERT_TRUE(a.Usable()) << a.message;
  // What is left is the cubic interpolation of a 1 kHz record.
  EXPECT_NEAR(a.at.offset, trial.offset, 1e-8);
  EXPECT_LT((a.at.X_WM.translation() - trial.X_WM.translation()).norm(), 1e-7);
  EXPECT_LT(AngleBetween(a.at.X_WM, trial.X_WM), 1e-7);
}

TEST(Align, ScatterOverSeedsIsWhatItPredicts) {
  const int seeds = Repeats(30, 80);
  const SampledModel reference = Reference();
  std::vector<double> z_offset, z_rotation, chi2;
  for (int seed = 0; seed < seeds; ++seed) {
    const Trial trial = TiltedTrial();
    const Alignment a = Align(NoisyTrial(trial, 100 + static_cast<std::uint64_t>(seed)), reference);
    ASSERT_TRUE(a.Usable()) << a.message;
    z_offset.push_back((a.at.offset - trial.offset) / a.Sigma("time offset"));
    const Eigen::Vector3d w =
        VectorFromRotation(trial.X_WM.linear() * a.at.X_WM.linear().transpose());
    z_rotation.push_back(w.z() / a.Sigma("frame rotation about z"));
    chi2.push_back(a.chi2_per_dof);
  }
  // Variance of n normalised errors: 1 within four of its own standard deviations, sqrt(2/n).
  const double band = 4.0 * std::sqrt(2.0 / seeds);
  EXPECT_NEAR(Variance(z_offset), 1.0, band);
  EXPECT_NEAR(Variance(z_rotation), 1.0, band);
  EXPECT_NEAR(Mean(z_offset), 0.0, 4.0 / std::sqrt(seeds));
  EXPECT_NEAR(Mean(chi2), 1.0, 0.01);
}

TEST(Align, CorrelatedNoiseWidensTheStandardErrorsAsItShould) {
  const int seeds = Repeats(30, 80);
  const SampledModel reference = Reference();
  Trial trial = TiltedTrial();
  trial.rho = 0.9;
  std::vector<double> z, white;
  for (int seed = 0; seed < seeds; ++seed) {
    const Alignment a = Align(NoisyTrial(trial, 500 + static_cast<std::uint64_t>(seed)), reference);
    ASSERT_TRUE(a.Usable());
    EXPECT_FALSE(a.noise.white());
    z.push_back((a.at.offset - trial.offset) / a.Sigma("time offset"));
    white.push_back((a.at.offset - trial.offset) / a.white_sigma(6));
  }
  EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / seeds));
  EXPECT_GT(Variance(white), 2.0);  // what ignoring the correlation would claim
}

TEST(Align, ReportsMotionAcrossThePlaneInsteadOfDroppingIt) {
  Trial trial = TiltedTrial();
  trial.across = 0.004;
  const Observations o = NoisyTrial(trial, 7);
  const Alignment a = Align(o, Reference());
  ASSERT_TRUE(a.Usable());
  const std::vector<MarkError> errors = Errors(o, a.reference, a.at.offset, a.fit);
  EXPECT_NEAR(errors.back().rmse_across, trial.across / std::sqrt(2.0), 0.05 * trial.across);
  EXPECT_LT(errors.back().rmse_in_plane, 2.0 * trial.sigma);
  EXPECT_GT(errors.back().sigmas, 5.0);
}

TEST(Align, TakesTracksAsReferenceWithTheirOwnNoise) {
  // The same motion measured twice by two rigs, the second with gaps, at another rate.
  const Trial first = TiltedTrial();
  Trial second;
  second.step = 0.004;
  second.offset = -2.25;
  second.X_WM.linear() = RotationFromVector({0.1, 0.2, -2.0});
  std::vector<double> z;
  constexpr int kSeeds = 15;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Observations b = NoisyTrial(second, 900 + seed);
    for (MarkSeries& m : b.marks) {  // the gap: 0.3 s lost
      Observations one;
      one.marks = {m};
      const Observations head = Cut(one, {-10.0, -2.25 + 1.5}),
                         tail = Cut(one, {-2.25 + 1.8, 10.0});
      MarkSeries joined = head.marks[0];
      const MarkSeries& t = tail.marks[0];
      const auto n = static_cast<Eigen::Index>(joined.size());
      joined.t.insert(joined.t.end(), t.t.begin(), t.t.end());
      joined.p.conservativeResize(3, n + t.p.cols());
      joined.p.rightCols(t.p.cols()) = t.p;
      joined.cov.conservativeResize(6, n + t.p.cols());
      joined.cov.rightCols(t.p.cols()) = t.cov;
      m = joined;
    }
    const Observations o = NoisyTrial(first, 1900 + seed);
    const Alignment a = Align(o, SampledModel(b));
    ASSERT_TRUE(a.Usable()) << a.message;
    EXPECT_LT(a.fit.known, o.size() - 4 * 50u);  // samples in the gap have no counterpart
    z.push_back((a.at.offset - (first.offset - second.offset)) / a.Sigma("time offset"));
    EXPECT_LT(AngleBetween(a.at.X_WM, first.X_WM * second.X_WM.inverse()), 1e-3);
  }
  EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / kSeeds));
}

TEST(Align, OneMarkIsAlignedByItsSpeed) {
  const Trial trial = TiltedTrial();
  Rng rng(3);
  const Observations o = Record(TwoLink(), TwoLink::Truth(), {"tip"}, trial, rng);
  const Alignment a = Align(o, Reference());
  ASSERT_TRUE(a.Usable()) << a.message;
  EXPECT_EQ(a.signal, "speeds of 1 mark");
  EXPECT_NEAR(a.at.offset, trial.offset, 5.0 * a.Sigma("time offset"));
}

// Where a mark was not seen it has no speed, and its neighbours none that reaches across.
TEST(Align, AGapHasNoSpeed) {
  const Trial trial = TiltedTrial();
  Rng rng(3);
  Observations o = Record(TwoLink(), TwoLink::Truth(), {"tip"}, trial, rng);
  MarkSeries& s = o.marks[0];
  MarkSeries kept = s;
  std::vector<Eigen::Index> keep;
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (i % 200 < 60 || i % 200 >= 100) keep.push_back(static_cast<Eigen::Index>(i));
  }
  kept.t.clear();
  for (const Eigen::Index i : keep) kept.t.push_back(s.t[static_cast<std::size_t>(i)]);
  kept.p = s.p(Eigen::all, keep).eval();
  kept.cov = s.cov(Eigen::all, keep).eval();
  const Eigen::Index k = o.shared_rank;
  kept.shared.resize(3, k * static_cast<Eigen::Index>(keep.size()));
  for (std::size_t i = 0; i < keep.size(); ++i) {
    kept.shared.middleCols(k * static_cast<Eigen::Index>(i), k) =
        s.shared.middleCols(k * keep[i], k);
  }
  s = kept;
  const Alignment a = Align(o, Reference());
  ASSERT_TRUE(a.Usable()) << a.message;
  EXPECT_NEAR(a.at.offset, trial.offset, 5.0 * a.Sigma("time offset"));
}

TEST(Align, AReferenceThatDoesNotFitIsAlignedWithoutBendingTheCalibration) {
  Trial trial = TiltedTrial();
  trial.sigma = 1e-5;
  trial.shared_rank = 3;
  trial.shared_size = 5e-5;
  std::vector<double> other = TwoLink::Truth();
  for (double& value : other) value *= 1.01;  // millimetres to centimetres, against 10 um of sigma
  Rng rng(5);
  const Observations record = Record(TwoLink(), other, TwoLink::Marks(), trial, rng);
  const Alignment a = Align(record, Reference());
  ASSERT_TRUE(a.Usable()) << a.message;
  constexpr double kClear = 10.0;  // misfit in sigmas: far beyond what covariances are wrong by
  EXPECT_GT(a.misfit, kClear * trial.sigma);
  EXPECT_GT(a.chi2_per_dof, kClear * kClear);
  // Three draws of a standard normal: one beyond five is one in two million.
  EXPECT_LT(a.at.z.cwiseAbs().maxCoeff(), 5.0);
  // No longer that of 10 um: errors of the misfit's size, were they independent and the frame
  // known, would leave this much [Kay 1993], and other unknowns and their correlation only add.
  double squares = 0.0;
  for (const MarkMotion& m : a.reference.marks) squares += m.v.squaredNorm();
  EXPECT_GT(a.Sigma("time offset"), a.misfit / std::sqrt(squares));
}

TEST(Align, ClockDriftIsFoundWithItsStandardError) {
  constexpr int kSeeds = 15;  // align_slow_test.cc: 1000, against the Cramer-Rao bound
  const SampledModel reference = Reference(4.2);
  AlignOptions options;
  options.registration.fit_drift = true;
  constexpr double kDrift = 3e-4;  // a poor quartz by ten; 1.2 ms over the record
  std::vector<double> z_offset, z_drift;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Trial trial = TiltedTrial();
    const Observations o = WithDrift(NoisyTrial(trial, 700 + seed), kDrift);
    const Alignment a = Align(o, reference, options);
    ASSERT_TRUE(a.Usable()) << a.message;
    z_drift.push_back((a.drift - kDrift) / a.Sigma("clock drift"));
    z_offset.push_back((a.at.offset - trial.offset) / a.Sigma("time offset"));
    EXPECT_NEAR(a.chi2_per_dof, 1.0, 5.0 * std::sqrt(2.0 / (3.0 * o.size())));
  }
  EXPECT_NEAR(Mean(z_drift), 0.0, 4.0 / std::sqrt(kSeeds));
  EXPECT_NEAR(Variance(z_drift), 1.0, 4.0 * std::sqrt(2.0 / kSeeds));
  EXPECT_NEAR(Mean(z_offset), 0.0, 4.0 / std::sqrt(kSeeds));
  EXPECT_NEAR(Variance(z_offset), 1.0, 4.0 * std::sqrt(2.0 / kSeeds));
}

class AlignUnrelated : public testing::TestWithParam<std::pair<Kind, int>> {};

TEST_P(AlignUnrelated, IsRefused) {
  // Nothing is shared but the kind of motion. Accepted: at most what a rate of 1 in 50 makes likely
  // over 20 pairs (95%: 2).
  const auto [kind, marks] = GetParam();
  int accepted = 0;
  constexpr int kPairs = 20;
  for (std::uint64_t seed = 0; seed < kPairs; ++seed) {
    const Observations a = RandomMotion(kind, marks, Rng(1000 + seed).Stream("a"));
    const Observations b = RandomMotion(kind, marks, Rng(1000 + seed).Stream("b"));
    accepted += Align(a, SampledModel(b)).Usable() ? 1 : 0;
  }
  EXPECT_LE(accepted, 2);
}
INSTANTIATE_TEST_SUITE_P(Kinds, AlignUnrelated,
                         testing::Values(std::pair{Kind::kSwing, 1}, std::pair{Kind::kSwing, 3},
                                         std::pair{Kind::kOpening, 1}, std::pair{Kind::kOpening, 2},
                                         std::pair{Kind::kOpening, 3}, std::pair{Kind::kWalk, 1},
                                         std::pair{Kind::kWalk, 2}, std::pair{Kind::kWalk, 3}));

TEST(Align, RefusesRecordsThatShareNothing) {
  // Noise about fixed points, against a deployment-like motion.
  const Trial trial = TiltedTrial();
  Observations o = NoisyTrial(trial, 11);
  Rng rng(12);
  for (MarkSeries& m : o.marks) {
    for (Eigen::Index i = 0; i < m.p.cols(); ++i) {
      for (int axis = 0; axis < 3; ++axis) m.p(axis, i) = 0.2 * rng.Normal();
    }
  }
  const Alignment a = Align(o, Reference());
  EXPECT_FALSE(a.Usable());
  EXPECT_EQ(a.status, AlignStatus::kNothingShared);
  EXPECT_NE(a.message.find("share nothing"), std::string::npos);
}

TEST(Align, RefusesAMotionAtAnotherFrequency) {
  const Trial trial = TiltedTrial();
  Rng rng(13);
  const std::vector<double> other = {3.1, 0.05};
  const Observations o = Record(TwoLink(), other, {"elbow", "tip"}, trial, rng);
  const Alignment a = Align(o, Reference());
  EXPECT_FALSE(a.Usable()) << a.r2 << " " << a.correlation;
}

TEST(Align, TooFewSamplesAreSaidToBeTooFew) {
  const Trial trial = TiltedTrial();
  const Observations o = Cut(NoisyTrial(trial, 5), {1.0, 1.02});
  const Alignment a = Align(o, Reference());
  EXPECT_EQ(a.status, AlignStatus::kTooLittle);
}

TEST(Align, AnUndeterminedDirectionIsNamed) {
  // Marks that move along one line leave the rotation about it open.
  class OnALine : public Model {
   public:
    Prediction Evaluate(std::span<const double>, const Stamps& stamps) const override {
      Prediction out;
      for (const auto& list : stamps.t) {
        MarkMotion motion;
        motion.p.setZero(3, static_cast<Eigen::Index>(list.size()));
        motion.v.setZero(3, static_cast<Eigen::Index>(list.size()));
        for (std::size_t i = 0; i < list.size(); ++i) {
          const auto c = static_cast<Eigen::Index>(i);
          motion.p(0, c) = std::sin(2.0 * list[i]) + (out.marks.empty() ? 0.0 : 2.0 + list[i]);
          motion.v(0, c) = 2.0 * std::cos(2.0 * list[i]) + (out.marks.empty() ? 0.0 : 1.0);
        }
        out.marks.push_back(motion);
      }
      return out;
    }
  };
  Rng rng(4);
  Trial trial;
  const Observations o = Record(OnALine(), {}, {"a", "b"}, trial, rng);
  const Alignment a = Align(o, SampledModel(OnALine(), {}, {"a", "b"}, -1.0, 5.0, 1e-3));
  ASSERT_FALSE(a.fit.weak.empty());
  EXPECT_EQ(a.fit.weak.front(), "frame rotation about x");
}

TEST(BodyAngle, FollowsTheLineBetweenTwoStrobedMarks) {
  const Trial trial = TiltedTrial();
  const Observations o = NoisyTrial(trial, 21);
  const SampledModel reference = Reference();
  const Alignment a = Align(o, reference);
  ASSERT_TRUE(a.Usable());
  const auto pairs = RigidPairs(
      reference.Evaluate(
          {}, Stamps{TwoLink::Marks(), std::vector<std::vector<double>>(4, {0.0, 0.5, 1.0, 2.0})}),
      TwoLink::Marks());
  ASSERT_EQ(pairs.size(), 2u);  // the outer link is rigid too
  EXPECT_EQ(pairs[0].first, "base");
  EXPECT_EQ(pairs[0].second, "base2");
  const BodyAngle angle = MeasureBodyAngle(o, reference, {}, a.at, "base", "base2");
  ASSERT_GT(angle.t.size(), 700u);
  std::vector<double> z;
  for (std::size_t i = 0; i < angle.t.size(); ++i) {
    const double t = std::max(0.0, angle.t[i] - trial.offset);
    const double truth = 0.05 * std::sin(2.0 * std::numbers::pi * 0.4 * t);
    EXPECT_NEAR(angle.simulated[i], truth, 1e-5);
    z.push_back((angle.measured[i] - truth) / angle.sigma[i]);
  }
  // Interpolated neighbours share samples, so the scatter of the variance is wider than white.
  EXPECT_NEAR(Variance(z), 1.0, 0.2);
}

// What hardly moves is slow in any unit, and a record that lasts as long is in the same one.
TEST(UnitDoubt, DurationsThatAreAlikeSpeakForTheUnit) {
  const UnitRatios still{.length = 1.0, .time = 1e-3, .duration = 0.9};
  EXPECT_EQ(UnitDoubt(still), "");
  const UnitRatios slip{.length = 1.0, .time = 1e3, .duration = 700.0};
  EXPECT_THAT(UnitDoubt(slip), ::testing::HasSubstr("milliseconds"));
}

}  // namespace
}  // namespace unfurl::correlate::align_test
