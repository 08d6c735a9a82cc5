#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.h"
#include "calib/calibrate.h"
#include "calib/check.h"
#include "calib/plan.h"
#include "calib/verdict.h"
#include "tests/calib/fixtures.h"
#include "tests/repeats.h"

// Nothing has a preferred size: the same survey in other lengths, or with other pixels, is judged
// alike, and its numbers come back when they are scaled back.
namespace unfurl::calib::scaling_test {
namespace {

// Lengths times `length`; pixels `pixels` times as many over the same row, so that the centre of
// pixel k, at k, comes to pixels (k + 1/2) - 1/2.
struct Scale {
  double length = 1.0, pixels = 1.0;
  double Reading(double u_px) const { return pixels * (u_px + 0.5) - 0.5; }
};

Observations Scaled(Observations data, const Scale& scale) {
  data.p *= scale.length;
  for (Eigen::Matrix3d& cov : data.cov) cov *= scale.length * scale.length;
  for (int& pixels : data.pixels) pixels = static_cast<int>(scale.pixels * pixels);
  for (Reading& r : data.readings) {
    r.u_px = scale.Reading(r.u_px);
    r.s_px *= scale.pixels;
  }
  return data;
}

// With two displaced points and three wild readings.
Observations Survey() {
  testing::Study study = testing::MakeStudy(5, 90);
  study.data.p(0, 7) += 0.02;
  study.data.p(2, 40) -= 0.05;
  for (const std::size_t k : {30UL, 100UL, 200UL}) study.data.readings[k].u_px += 3.0;
  return study.data;
}

// Nothing is left to chance but the order of roundings: scales that are powers of two leave every
// step of the solvers as it was. Others round differently, and what a robust search and an iterated
// solver stop at differs by their own tolerance: the bundle ends at a relative change of the cost
// of 1e-10, that is within 1e-5 of a standard deviation. So the numbers are compared by their own
// standard deviations.
constexpr double kSigmas = 1e-4;
constexpr double kExact = 1e-9;

void Compare(const Calibration& one, const Calibration& other, const Scale& scale) {
  EXPECT_EQ(one.rig.verdict, other.rig.verdict);
  EXPECT_EQ(one.report.lens_model, other.report.lens_model);
  ASSERT_EQ(one.report.gross.size(), other.report.gross.size());
  for (std::size_t k = 0; k < one.report.gross.size(); ++k) {
    EXPECT_EQ(one.report.gross[k].kind, other.report.gross[k].kind);
    EXPECT_EQ(one.report.gross[k].points, other.report.gross[k].points);
  }
  EXPECT_EQ(one.report.held_out.size(), other.report.held_out.size());
  EXPECT_EQ(one.report.weak.size(), other.report.weak.size());
  EXPECT_EQ(one.report.advice.size(), other.report.advice.size());
  const auto log2 = [](double x) { return std::log2(x) == std::round(std::log2(x)); };
  const bool exact = log2(scale.length) && scale.pixels == 1.0;
  for (std::size_t j = 0; j < one.rig.cameras.size(); ++j) {
    const data::RigCamera &a = one.rig.cameras[j], &b = other.rig.cameras[j];
    const auto sigma = [&](int parameter) {
      const auto at = static_cast<Eigen::Index>(j) * data::kCameraParameters + parameter;
      return std::sqrt(one.rig.covariance(at, at));
    };
    const auto near = [&](double value, double expected, int parameter, double unit) {
      if (sigma(parameter) == 0.0) {  // a term that is held at zero
        EXPECT_LT(std::abs(value), 1e-100);
        return;
      }
      const double tolerance =
          exact ? kExact * std::abs(expected) + 1e-12 * unit : kSigmas * sigma(parameter) * unit;
      EXPECT_NEAR(value, expected, tolerance) << "camera " << j << ", parameter " << parameter;
    };
    for (int k = 0; k < 3; ++k) near(b.p_WC(k), scale.length * a.p_WC(k), 3 + k, scale.length);
    near(b.f_px, scale.pixels * a.f_px, 6, scale.pixels);
    near(b.u0_px, scale.Reading(a.u0_px), 7, scale.pixels);
    near(b.e, scale.length * a.e, 8, scale.length);
    for (int k = 0; k < static_cast<int>(data::kLensTerms); ++k) {
      const auto term = static_cast<std::size_t>(k);
      near(b.terms_px[term], scale.pixels * a.terms_px[term], data::kFirstTerm + k, scale.pixels);
    }
    EXPECT_LT((a.R_CW - b.R_CW).cwiseAbs().maxCoeff(),
              exact ? 1e-12 : kSigmas * std::max({sigma(0), sigma(1), sigma(2)}));
  }
}

class Scaling : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { one_ = new Calibration(Calibrate(Survey(), {}, "test")); }
  static void TearDownTestSuite() { delete one_; }
  static Calibration* one_;
};
Calibration* Scaling::one_ = nullptr;

TEST_F(Scaling, OfLengthsChangesNoCalibration) {
  const std::vector<double> lengths{0.1, 16.0, 10.0, 30.0, 0.125};
  for (int k = 0; k < Repeats(2, 5); ++k) {
    const double length = lengths[static_cast<std::size_t>(k)];
    SCOPED_TRACE(length);
    const Scale scale{.length = length};
    Compare(*one_, Calibrate(Scaled(Survey(), scale), {}, "test"), scale);
  }
}

TEST_F(Scaling, OfPixelsChangesNoCalibration) {
  for (const double pixels : {0.5, 4.0}) {
    SCOPED_TRACE(pixels);
    const Scale scale{.pixels = pixels};
    Compare(*one_, Calibrate(Scaled(Survey(), scale), {}, "test"), scale);
  }
}

data::Rig ScaledRig(data::Rig rig, const Scale& scale) {
  Eigen::VectorXd unit(rig.covariance.rows());
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    data::RigCamera& camera = rig.cameras[j];
    camera.pixels = static_cast<int>(scale.pixels * camera.pixels);
    camera.p_WC *= scale.length;
    camera.e *= scale.length;
    camera.f_px *= scale.pixels;
    camera.u0_px = scale.Reading(camera.u0_px);
    camera.floor_px *= scale.pixels;
    for (double& term : camera.terms_px) term *= scale.pixels;
    const auto first = static_cast<Eigen::Index>(j) * data::kCameraParameters;
    unit.segment<data::kCameraParameters>(first).setConstant(scale.pixels);
    unit.segment<3>(first).setOnes();
    unit.segment<3>(first + 3).setConstant(scale.length);
    unit(first + 8) = scale.length;
  }
  rig.covariance = (unit.asDiagonal() * rig.covariance * unit.asDiagonal()).eval();
  rig.model_floor_px *= scale.pixels;
  rig.volume_low *= scale.length;
  rig.volume_high *= scale.length;
  return rig;
}

TEST_F(Scaling, ChangesNoPlanAndNoCheck) {
  const PlanResult plan = Plan(one_->rig, PlanOptions{});
  testing::Study ten = testing::MakeStudy(5, 90);
  std::vector<int> keep;
  for (int i = 50; i < 60; ++i) keep.push_back(i);
  Observations moved = SelectPoints(ten.data, keep);
  for (Reading& r : moved.readings) r.u_px += r.camera == 1 ? 1.0 : 0.0;
  const CheckResult check = CheckPoints(one_->rig, moved, "test");
  ASSERT_TRUE(check.invalid);
  for (const Scale scale : {Scale{.length = 0.1}, Scale{.length = 10.0}, Scale{.length = 30.0},
                            Scale{.pixels = 0.5}, Scale{.pixels = 4.0}}) {
    SCOPED_TRACE(::testing::Message() << scale.length << " " << scale.pixels);
    const data::Rig rig = ScaledRig(one_->rig, scale);
    PlanOptions options;
    options.map.reading_sigma_px *= scale.pixels;
    const PlanResult other = Plan(rig, options);
    EXPECT_EQ(other.verdict, plan.verdict);
    EXPECT_EQ(other.headline.substr(0, 20), plan.headline.substr(0, 20));
    EXPECT_EQ(other.cases[0].map.Found(), plan.cases[0].map.Found());
    for (std::size_t cell = 0; cell < plan.cases[0].map.sigma.size(); ++cell) {
      const double expected = scale.length * plan.cases[0].map.sigma[cell];
      if (std::isnan(expected)) {
        EXPECT_TRUE(std::isnan(other.cases[0].map.sigma[cell]));
      } else {
        EXPECT_NEAR(other.cases[0].map.sigma[cell], expected, 1e-9 * expected);
      }
    }
    const CheckResult same = CheckPoints(rig, Scaled(moved, scale), "test");
    EXPECT_EQ(same.verdict, check.verdict);
    ASSERT_EQ(same.reasons.size(), check.reasons.size());
    EXPECT_NEAR(same.rms, scale.length * check.rms, 1e-9 * scale.length * check.rms);
    for (std::size_t c = 0; c < check.cameras.size(); ++c) {
      EXPECT_NEAR(same.cameras[c].rms_px, scale.pixels * check.cameras[c].rms_px,
                  1e-9 * scale.pixels * check.cameras[c].rms_px);
    }
  }
}

// A 30 m wing and a 3 cm hinge are judged by what is asked of them.
TEST_F(Scaling, TheNeedDecides) {
  VerdictOptions strict;
  strict.need = 1e-6;
  data::Rig rig = one_->rig;
  const Observations data = Survey();
  Judge(one_->report, data, &rig, strict);
  EXPECT_EQ(rig.verdict, kDoNotUse);
  EXPECT_NEAR(NeedOf({}, one_->rig),
              (one_->rig.volume_high - one_->rig.volume_low).maxCoeff() / 2e3, 1e-15);
  strict.need = -1.0;
  EXPECT_THROW(strict.Check(), Error);
}

}  // namespace
}  // namespace unfurl::calib::scaling_test
