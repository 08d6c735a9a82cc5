// Judge on reports written by hand: every number it stores has a closed form in them, and every
// limit is crossed from below by one change at a time.

#include "calib/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace unfurl::calib::verdict_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kPoints = 40;
constexpr double kSurvey = 1e-4;  // standard deviation of a surveyed coordinate [m]
constexpr double kOwn = 2e-4;     // of a found one, without the survey's part [m]

struct Case {
  Observations data;
  CalibrationReport report;
  data::Rig rig;
};

// A sound calibration: 40 held-out points, each wrong by what was predicted.
Case Sound() {
  Case c;
  c.data.p = Eigen::Matrix3Xd::Zero(3, kPoints);
  for (const char* name : {"a", "b", "c", "d"}) {
    CameraReport camera;
    camera.name = name;
    camera.readings = kPoints;
    camera.low_px = 200.0;
    camera.high_px = 1800.0;
    c.report.cameras.push_back(camera);
    data::RigCamera of_rig;
    of_rig.name = name;
    of_rig.pixels = 2000;
    c.rig.cameras.push_back(of_rig);
  }
  // A 2000th of it is a millimetre.
  c.rig.volume_high = Eigen::Vector3d(2.0, 1.0, 1.0);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  for (int i = 0; i < kPoints; ++i) {
    c.data.cov.push_back(kSurvey * kSurvey * I);
    HeldOutPoint point;
    point.point = i;
    point.readings = 4;
    point.predicted = (kOwn * kOwn + kSurvey * kSurvey) * I;
    point.error = std::sqrt(kOwn * kOwn + kSurvey * kSurvey) * Eigen::Vector3d(1.0, -1.0, 1.0);
    point.squared = 3.0;
    c.report.held_out.push_back(point);
  }
  c.report.readings.resize(4 * kPoints);
  c.report.survey_weight.assign(kPoints, 1.0);
  c.report.chi_square = 150.0;
  c.report.degrees_of_freedom = 120.0;
  c.report.converged = true;
  return c;
}

std::string VerdictOf(const std::function<void(Case*)>& change) {
  Case c = Sound();
  change(&c);
  Judge(c.report, c.data, &c.rig);
  return c.rig.verdict;
}

TEST(Judge, ASoundReportIsGood) {
  EXPECT_EQ(VerdictOf([](Case*) {}), kGood);
}

TEST(Judge, ChecksAreTheirClosedForms) {
  Case c = Sound();
  c.report.survey_factor = 1.2;
  for (HeldOutPoint& point : c.report.held_out) {
    point.predicted = (kOwn * kOwn + 1.44 * kSurvey * kSurvey) * Eigen::Matrix3d::Identity();
  }
  c.report.held_out[7].error = {3e-4, 0.0, -4e-4};
  c.report.cameras[1].gross = 2;
  c.report.survey_weight[3] = 0.5;
  Judge(c.report, c.data, &c.rig);
  auto& checks = c.rig.checks;
  const double n = kPoints;
  const double survey = 3.0 * 1.44 * kSurvey * kSurvey, own = 3.0 * kOwn * kOwn;  // per point
  const double squares = (39.0 * 3.0 * (kOwn * kOwn + kSurvey * kSurvey) + 25e-8) / n;
  // The sum of squares of errors N(0, s^2 I) has variance 2 * 3 s^4 per point.
  const double s2 = own / 3.0 + survey / 3.0;
  const double upper = 1.6448536269514722 * std::sqrt(n * 6.0 * s2 * s2) / n;
  constexpr double kRounding = 1e-12;
  EXPECT_EQ(checks["held_out_points [1]"], n);
  EXPECT_NEAR(checks["held_out_rms [m]"], std::sqrt(squares), kRounding);
  EXPECT_NEAR(checks["held_out_rms_predicted [m]"], std::sqrt(own + survey), kRounding);
  EXPECT_NEAR(checks["held_out_max [m]"], 5e-4, kRounding);
  EXPECT_NEAR(checks["held_out_nees_per_dof [1]"], 1.0, kRounding);
  EXPECT_NEAR(checks["own_error_rms [m]"], std::sqrt(squares - survey), kRounding);
  EXPECT_NEAR(checks["own_error_rms_at_most [m]"], std::sqrt(squares - survey + upper), kRounding);
  EXPECT_NEAR(checks["own_error_rms_predicted [m]"], std::sqrt(own), kRounding);
  EXPECT_NEAR(checks["own_error_median_predicted [m]"], std::sqrt(own), kRounding);
  EXPECT_NEAR(checks["chi_square_per_dof [1]"], 1.25, kRounding);
  EXPECT_EQ(checks["degrees_of_freedom [1]"], 120.0);
  EXPECT_EQ(checks["gross_readings [1]"], 2.0);
  EXPECT_EQ(checks["gross_points [1]"], 1.0);
  EXPECT_EQ(checks["survey_factor [1]"], 1.2);
  EXPECT_EQ(checks["weak_directions [1]"], 0.0);
}

// Error bars: a mean squared error over its prediction of more than 4 is refused (verdict.cc), one
// that chance does not explain at 1e-3 is told. 120 degrees of freedom: the 99.9% quantile of
// chi-square is 173.62.
TEST(Judge, ErrorBarsThatAreTooNarrow) {
  const auto with = [](double squared) {
    return VerdictOf([&](Case* c) {
      for (HeldOutPoint& point : c->report.held_out) point.squared = squared;
    });
  };
  EXPECT_EQ(with(173.6 / kPoints), kGood);
  EXPECT_EQ(with(173.7 / kPoints), kWithCare);
  EXPECT_EQ(with(3.0 * 3.99), kWithCare);
  EXPECT_EQ(with(3.0 * 4.01), kDoNotUse);
}

// A tenth of the places may be worse than a millimetre; half of them worse than ten is useless.
TEST(Judge, PredictedErrorsThatAreTooLarge) {
  const auto with = [](int count, double own, int unsolved) {
    return VerdictOf([&](Case* c) {
      for (int k = 0; k < count; ++k) {
        HeldOutPoint& point = c->report.held_out[static_cast<std::size_t>(k)];
        point.predicted = (own * own / 3.0 + kSurvey * kSurvey) * Eigen::Matrix3d::Identity();
      }
      c->report.held_out_unsolved = unsolved;
    });
  };
  EXPECT_EQ(with(kPoints, 0.99e-3, 0), kGood);
  EXPECT_EQ(with(4, 1.01e-3, 0), kGood);  // 4 of 40
  EXPECT_EQ(with(5, 1.01e-3, 0), kWithCare);
  EXPECT_EQ(with(0, 0.0, 4), kGood);  // 4 of 44
  EXPECT_EQ(with(0, 0.0, 5), kWithCare);
  EXPECT_EQ(with(kPoints, 9.9e-3, 0), kWithCare);
  EXPECT_EQ(with(kPoints, 10.1e-3, 0), kDoNotUse);
  EXPECT_EQ(with(kPoints / 2 - 1, 10.1e-3, 0), kWithCare);
  EXPECT_EQ(VerdictOf([](Case* c) { c->report.held_out.clear(); }), kDoNotUse);
}

// One change at a time, just inside a limit and just beyond it.
TEST(Judge, EachLimitIsWhereItsReasonPutsIt) {
  const auto readings = [](int gross) {
    return [gross](Case* c) { c->report.cameras[0].gross = gross; };
  };
  EXPECT_EQ(VerdictOf(readings(8)), kGood);  // 8 of 160: a twentieth
  EXPECT_EQ(VerdictOf(readings(9)), kWithCare);
  EXPECT_EQ(VerdictOf(readings(48)), kWithCare);
  EXPECT_EQ(VerdictOf(readings(49)), kDoNotUse);
  const auto points = [](int gross) {
    return [gross](Case* c) {
      for (int k = 0; k < gross; ++k) c->report.survey_weight[static_cast<std::size_t>(k)] = 0.2;
    };
  };
  EXPECT_EQ(VerdictOf(points(2)), kGood);  // 2 of 40
  EXPECT_EQ(VerdictOf(points(3)), kWithCare);
  EXPECT_EQ(VerdictOf(points(12)), kWithCare);
  EXPECT_EQ(VerdictOf(points(13)), kDoNotUse);
  const auto freedom = [](double dof) {
    return [dof](Case* c) { c->report.degrees_of_freedom = dof; };
  };
  EXPECT_EQ(VerdictOf(freedom(30.0)), kGood);
  EXPECT_EQ(VerdictOf(freedom(29.0)), kWithCare);
  const auto floor = [](double px) {
    return [px](Case* c) { c->report.cameras[2].floor_px = px; };
  };
  EXPECT_EQ(VerdictOf(floor(0.29)), kGood);
  EXPECT_EQ(VerdictOf(floor(0.31)), kWithCare);
  const auto factor = [](double f) { return [f](Case* c) { c->report.survey_factor = f; }; };
  EXPECT_EQ(VerdictOf(factor(1.0)), kGood);
  EXPECT_EQ(VerdictOf(factor(1.01)), kWithCare);
  const auto covered = [](double share) {
    return [share](Case* c) {
      for (CameraReport& camera : c->report.cameras) {
        camera.high_px = camera.low_px + share * 2000.0;
      }
    };
  };
  EXPECT_EQ(VerdictOf(covered(0.51)), kGood);
  EXPECT_EQ(VerdictOf(covered(0.49)), kWithCare);
  const auto trend = [](bool found) {
    return [found](Case* c) {
      c->report.trends.resize(3);
      c->report.trends[1].found = found;
      c->report.trends[1].text = "a trend";
    };
  };
  EXPECT_EQ(VerdictOf(trend(false)), kGood);
  EXPECT_EQ(VerdictOf(trend(true)), kWithCare);
  EXPECT_EQ(VerdictOf([](Case* c) { c->report.converged = false; }), kDoNotUse);
  EXPECT_EQ(VerdictOf([](Case* c) { c->report.cameras.pop_back(); }), kWithCare);
}

// An estimate with the prior 1 mm that is left with 0.6 mm scatters by sqrt(1 - 0.36) = 0.8 mm.
TEST(Judge, ACommonErrorIsWeighedByWhatItsEstimateScattersBy) {
  const auto with = [](double value) {
    return [value](Case* c) {
      CommonEstimate error;
      error.name = "distance offset";
      error.unit = "m";
      error.value = value;
      error.sigma = 0.6e-3;
      error.stated_sigma = 1e-3;
      c->report.common.push_back(error);
    };
  };
  EXPECT_EQ(VerdictOf(with(3.19e-3)), kGood);
  EXPECT_EQ(VerdictOf(with(-3.19e-3)), kGood);
  EXPECT_EQ(VerdictOf(with(3.21e-3)), kWithCare);
  EXPECT_EQ(VerdictOf(with(-3.21e-3)), kWithCare);
}

TEST(Judge, GrossErrorsAreNamedUpToADozen) {
  for (const int gross : {12, 15}) {
    Case c = Sound();
    c.report.cameras[0].gross = 1;
    for (int k = 0; k < gross; ++k) {
      GrossFinding finding;
      finding.text = "finding " + std::to_string(k) + ".";
      c.report.gross.push_back(finding);
    }
    Judge(c.report, c.data, &c.rig);
    EXPECT_THAT(c.rig.reasons, Contains("finding 11."));
    EXPECT_THAT(c.rig.reasons, Not(Contains("finding 12.")));
    if (gross == 12) {
      EXPECT_THAT(c.rig.reasons, Not(Contains(HasSubstr("more gross errors"))));
    } else {
      EXPECT_THAT(c.rig.reasons, Contains(HasSubstr("3 more gross errors")));
    }
  }
}

// What forbids comes first, then what asks for care, then the rest.
TEST(Judge, TheWorstReasonComesFirst) {
  Case c = Sound();
  c.report.degrees_of_freedom = 10.0;
  c.report.converged = false;
  WeakDirection weak;
  weak.camera = 3;
  weak.name = "place along z";
  weak.advice = "survey higher";
  c.report.weak.push_back(weak);
  c.report.advice.push_back("last");
  Judge(c.report, c.data, &c.rig);
  EXPECT_EQ(c.rig.verdict, kDoNotUse);
  ASSERT_GE(c.rig.reasons.size(), 4U);
  EXPECT_THAT(c.rig.reasons[0], HasSubstr("did not converge"));
  EXPECT_THAT(c.rig.reasons[1], HasSubstr("only 10 degrees of freedom"));
  EXPECT_THAT(c.rig.reasons, Contains(AllOf(HasSubstr("\"d\""), HasSubstr("survey higher"))));
  EXPECT_EQ(c.rig.reasons.back(), "last");
  weak.harmless = true;
  c.report.weak = {weak};
  Judge(c.report, c.data, &c.rig);
  EXPECT_THAT(c.rig.reasons, Not(Contains(HasSubstr("survey higher"))));
  EXPECT_EQ(c.rig.checks["weak_directions [1]"], 1.0);
}

}  // namespace
}  // namespace unfurl::calib::verdict_test
