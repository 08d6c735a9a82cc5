// Models that are wrong, with rays through glass: readings that drift, patterns that no lens term
// makes, surveys confined to a corner, stations that sink or that were moved, noise that is larger
// than stated. A verdict "good" is only given where error bars hold.
#include "calib/trends.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/verdict.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::trends_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::TracedLab;

// UNFURL_LABS of them, from number UNFURL_LABS_FROM on: a study goes on where another ended.
std::size_t FromEnvironment(const char* name, std::size_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : static_cast<std::size_t>(std::atoi(text));
}
const std::size_t kLabs = FromEnvironment("UNFURL_LABS", testing::Labs(6, 300));
const std::size_t kFrom = FromEnvironment("UNFURL_LABS_FROM", 0);
// Of the kinds below this one alone; 0: in turn.
const std::size_t kOnly = FromEnvironment("UNFURL_LABS_FAULT", 0);
constexpr int kPoints = 200;

enum class Fault { kNone, kDrift, kPattern, kCorner, kSinking, kSetUps, kNoise };
constexpr std::size_t kFaults = 6;
const char* Name(Fault fault) {
  constexpr const char* kNames[] = {"none",    "drift",   "pattern", "corner",
                                    "sinking", "set-ups", "noise"};
  return kNames[static_cast<int>(fault)];
}

// One laboratory of any kind with a fault of any size, and what became of it.
struct Outcome {
  std::string verdict;
  double nees = 0.0;  // of truth that was held out, over 3
  bool trend = false;
};

class FaultyLab {
 public:
  FaultyLab(std::uint64_t seed, Fault fault) : fault_(fault), lab_(Make(seed, &half_)) {
    Rng rng = lab_.rng.Stream("wrong model");
    lab_.reading_sigma = std::pow(10.0, rng.Uniform(-2.0, -1.2));
    // From a third of the readings' sigma to a hundred of them.
    amplitude_ = lab_.reading_sigma * std::pow(10.0, rng.Uniform(-0.5, 2.0));
    shape_ = static_cast<int>(rng.Integer(3));
    period_ = rng.Uniform(0.03, 1.0);
    phase_ = rng.Uniform(0.0, 2.0 * M_PI);
    step_ = rng.Uniform(0.2, 0.8);
    bad_ = rng.Integer(lab_.truth.cameras.size());
    all_ = rng.Uniform() < 0.3;
    share_ = rng.Uniform(0.1, 0.45);
    for (double& x : corner_) x = rng.Uniform() < 0.5 ? -1.0 : 1.0;
  }

  // What is added to a reading at a time of the survey from 0 to 1.
  double Error(std::size_t camera, double u_px, double t) const {
    if (!all_ && camera != bad_) return 0.0;
    if (fault_ == Fault::kDrift) {
      const double course[] = {t, t > step_ ? 1.0 : 0.0, 1.0 - std::exp(-5.0 * t)};
      return amplitude_ * course[shape_] * (camera % 2 == 0 ? 1.0 : -0.6);
    }
    if (fault_ != Fault::kPattern) return 0.0;
    const double row = lab_.truth.cameras[camera].sensor.pixels;
    return amplitude_ *
           std::sin(2.0 * M_PI * u_px / (period_ * row) + phase_ + static_cast<double>(camera));
  }

  Observations Survey() const {
    Eigen::Matrix3Xd places = lab_.Places(kPoints);
    if (fault_ == Fault::kCorner) {
      places = (share_ * places).colwise() + (1.0 - share_) * half_ * corner_;
    }
    Observations data = lab_.Survey(places);
    for (Reading& r : data.readings) {
      r.u_px += Error(static_cast<std::size_t>(r.camera), r.u_px, (r.point + 0.5) / kPoints);
    }
    MoveStation(&data);
    if (fault_ == Fault::kNoise) StateLess(&data);
    return data;
  }
  std::string Words() const {
    char text[160];
    std::snprintf(text, sizeof text,
                  "%zu cameras, reading %.3f px, amplitude %.3f px, shape %d, period %.2f, %s, "
                  "corner %.2f",
                  lab_.truth.cameras.size(), lab_.reading_sigma, amplitude_, shape_, period_,
                  all_ ? "all" : "one", share_);
    return text;
  }

  // Points that all cameras see, read as after the survey; the whole covariance. What a station
  // does to all points as one rigid motion is where the frame is: of its faults the rest counts.
  double NeesOf(const data::Rig& rig) const {
    const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
    Eigen::Matrix3Xd F(3, triangulator.shared_rank());
    Rng noise = lab_.rng.Stream("held-out noise");
    const Eigen::Matrix3Xd points = testing::PointsInCube(200, half_, lab_.rng.Stream("held out"));
    std::vector<double> u(rig.cameras.size()), s(rig.cameras.size(), lab_.reading_sigma);
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    double sum = 0.0, n = 0.0;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      bool all = true;
      for (std::size_t c = 0; c < u.size(); ++c) {
        all = lab_.Read(c, points.col(i), &u[c]) && all;
        u[c] += Error(c, u[c], 1.0) + lab_.reading_sigma * noise.Normal();
      }
      if (!all) continue;
      const auto found = triangulator.Solve(u, s, points.col(i));
      if (found.outcome != measure::PointOutcome::kSolved) continue;
      triangulator.SharedFactor(found, s, F);
      const Eigen::Matrix3d cov = found.cov + F * F.transpose();
      const Eigen::Vector3d e = found.p - points.col(i);
      sum += e.dot(cov.llt().solve(e)) / 3.0;
      n += 1.0;
      Eigen::Matrix<double, 3, 6> A = Eigen::Matrix<double, 3, 6>::Identity();
      for (int k = 0; k < 3; ++k) {
        A.col(3 + k) = Eigen::Vector3d::Unit(k).cross(Eigen::Vector3d(points.col(i)));
      }
      const Eigen::Matrix<double, 3, 6> WA = cov.llt().solve(A);
      H += A.transpose() * WA;
      g += WA.transpose() * e;
    }
    if (fault_ == Fault::kSinking || fault_ == Fault::kSetUps) sum -= g.dot(H.llt().solve(g)) / 3.0;
    return n > 0.0 ? sum / n : 0.0;
  }

 private:
  static TracedLab Make(std::uint64_t seed, double* half) {
    const data::Lab kind = testing::RandomLab(seed, half);
    return {kind, *half, seed};
  }

  // A tripod that sinks while it measures, or a second set-up that is off by a constant; by as many
  // sigmas of the survey as readings are off otherwise.
  void MoveStation(Observations* data) const {
    const double size = lab_.survey_sigma * amplitude_ / lab_.reading_sigma;
    for (Eigen::Index i = 0; i < data->p.cols(); ++i) {
      if (fault_ == Fault::kSinking) {
        data->p(2, i) += size * ((static_cast<double>(i) + 0.5) / kPoints - 1.0);
      } else if (fault_ == Fault::kSetUps && data->p.col(i).dot(corner_) > 0.0) {
        data->p.col(i) += size / std::sqrt(3.0) * Eigen::Vector3d(corner_.y(), 1.0, corner_.x());
      }
    }
  }
  // Readings, or places, scatter more than they state: by up to three times.
  void StateLess(Observations* data) const {
    const double factor = 1.0 + 2.0 * step_;
    if (shape_ != 1) {
      for (Reading& r : data->readings) {
        if (all_ || r.camera == static_cast<int>(bad_)) r.s_px /= factor;
      }
    }
    if (shape_ == 0) return;
    for (Eigen::Matrix3d& cov : data->cov) cov /= factor * factor;
  }

  Fault fault_;
  double half_ = 0.0;
  TracedLab lab_;
  double amplitude_ = 0.0, period_ = 1.0, phase_ = 0.0, step_ = 0.5, share_ = 1.0;
  int shape_ = 0;
  std::size_t bad_ = 0;
  bool all_ = false;
  Eigen::Vector3d corner_ = Eigen::Vector3d::Ones();
};

std::vector<Outcome> RunLabs(std::uint64_t first, bool faulty) {
  std::vector<Outcome> out(kLabs);
  ParallelFor(kLabs, 0, [&](std::size_t k) {
    const std::size_t number = kFrom + k;
    const auto fault = static_cast<Fault>(!faulty ? 0 : kOnly > 0 ? kOnly : 1 + number % kFaults);
    const FaultyLab lab(first + number, fault);
    const Calibration result = Calibrate(lab.Survey(), {.workers = 1}, "test");
    out[k] = {result.rig.verdict, lab.NeesOf(result.rig)};
    for (const Trend& trend : result.report.trends) out[k].trend |= trend.found;
    std::fflush(stdout);  // a study that is stopped has told what it knows
    std::printf("%4zu %-7s %-17s NEES/3 %7.2f  %s: %s\n", number, Name(fault),
                result.rig.verdict.c_str(), out[k].nees, lab.Words().c_str(),
                result.rig.reasons.front().c_str());
  });
  return out;
}

// Of laboratories called good, the mean of all; one has some 24 to 100 independent errors.
TEST(TrendsTraced, GoodMeansThatErrorBarsHold) {
  double sum = 0.0, worst = 0.0, good = 0.0, above = 0.0;
  for (const Outcome& one : RunLabs(500, true)) {
    if (one.verdict != kGood) continue;
    sum += one.nees;
    good += 1.0;
    above += one.nees > 1.3 ? 1.0 : 0.0;
    worst = std::max(worst, one.nees);
  }
  std::printf(
      "%zu faulty laboratories: %.0f called good, NEES/3 %.2f, above 1.3 %.0f, largest "
      "%.2f\n",
      kLabs, good, sum / std::max(1.0, good), above, worst);
  EXPECT_LE(sum, 1.3 * std::max(1.0, good));
}

// With three cameras none is good, fault or not; what is asked is that no trend is seen.
TEST(TrendsTraced, FaultlessLaboratoriesAreLeftAlone) {
  int labs = 0, good = 0;
  double sum = 0.0, above = 0.0;
  for (const Outcome& one : RunLabs(9000, false)) {
    labs += one.trend ? 1 : 0;
    good += one.verdict == kGood ? 1 : 0;
    sum += one.nees;
    above += one.nees > 1.3 ? 1.0 : 0.0;
  }
  std::printf("%zu faultless laboratories: a trend in %d, good %d, NEES/3 %.2f, above 1.3 %.0f\n",
              kLabs, labs, good, sum / static_cast<double>(kLabs), above);
  EXPECT_LE(labs, std::max(1.0, 0.03 * static_cast<double>(kLabs)));
}

#ifndef UNFURL_SLOW_TESTS

// One pixel over the survey: named, taken out, and the error is as without it.
TEST(Trends, ADriftIsNamedAndTakenOut) {
  TracedLab lab(21);
  Observations data = lab.Survey(kPoints);
  const data::Rig clean = FitRig(data, {}, "test").rig;
  for (Reading& r : data.readings) {
    if (r.camera == 2) r.u_px += (r.point + 0.5) / kPoints - 1.0;
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kWithCare);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("drift over the survey")));
  for (const Trend& trend : result.report.trends) {
    EXPECT_EQ(trend.found, trend.kind == TrendKind::kReadingDrift && trend.camera == 2)
        << Name(trend.kind) << trend.camera << " " << trend.chance;
    if (trend.found) {
      EXPECT_NEAR(trend.change, 1.0, 0.1);
    }
  }
  const testing::TracedErrors with = FindCheckPoints(lab, result.rig, 150);
  EXPECT_LT(with.Squares(), 2.0 * FindCheckPoints(lab, clean, 150).Squares());
  EXPECT_LT(with.Squares(), 2.0 * with.Bounds());
}

// Ripples of a tenth of the row that no lens makes, beside a survey that is as precise: the point
// errors that they make are beyond the stated ones.
TEST(Trends, APatternThatHarmsIsNotGood) {
  TracedLab lab(22);
  lab.survey_sigma = 3e-5;
  Observations data = lab.Survey(kPoints);
  for (Reading& r : data.readings) r.u_px += 0.2 * std::sin(2.0 * M_PI * r.u_px / 300.0);
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("follow a pattern")));
}

// Ripples that precise readings show and that no found point does, as the survey's error is far
// larger: said, and no reason to mistrust the rig.
TEST(Trends, APatternThatHarmsNoPointIsSaid) {
  TracedLab lab(22);
  lab.reading_sigma = 0.005;
  Observations data = lab.Survey(kPoints);
  for (Reading& r : data.readings) {
    if (r.camera == 1) r.u_px += 0.015 * std::sin(2.0 * M_PI * r.u_px / 216.0);
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("it raises squared errors")));
  // The same pattern is named where it is asked for.
  CalibrateOptions strict;
  strict.trends.harmless = 0.0;
  EXPECT_EQ(Calibrate(data, strict, "test").rig.verdict, kWithCare);
}

// The station's tripod sinks by 3 mm while the survey goes on.
TEST(Trends, AStationThatSinksIsSeen) {
  TracedLab lab(23);
  Observations data = lab.Survey(kPoints);
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    data.p(2, i) += 3e-3 * static_cast<double>(i) / kPoints;
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("surveyed places drift")));
}

// A second set-up that is off by 4 sigmas of a point: most of it is one affine map, which no
// residual shows; what is not makes the survey scatter more than it states.
TEST(Trends, ASetUpThatIsOffIsNotGood) {
  TracedLab lab(25);
  Observations data = lab.Survey(kPoints);
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    if (data.p.col(i).sum() > 0.0) data.p.col(i).array() += 4.0 / std::sqrt(3.0) * lab.survey_sigma;
  }
  EXPECT_NE(Calibrate(data, {}, "test").rig.verdict, kGood);
}

TEST(Trends, ASurveyInACornerIsNotGood) {
  TracedLab lab(24);
  Eigen::Matrix3Xd places = 0.3 * lab.Places(kPoints);
  places.colwise() += 0.7 * Eigen::Vector3d(1.0, -1.0, 1.0);
  const Calibration result = Calibrate(lab.Survey(places), {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("of the rows")));
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib::trends_test
