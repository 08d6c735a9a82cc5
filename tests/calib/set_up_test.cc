// Set-ups of the station: their six errors, which holds the frame, what is said and refused.
#include "calib/set_up.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/error.h"
#include "calib/calibrate.h"
#include "calib/check.h"
#include "calib/verdict.h"
#include "tests/calib/set_up_fixtures.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::set_up_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::kTracedSurvey;
using testing::MotionOf;
using testing::Named;
using testing::Towards;
using testing::TracedLab;
using testing::TwoSetUps;
using testing::Vector6;

// Six fields, of the set-up's points alone, against a motion by its rotation matrix.
TEST(SetUp, IsARigidMotionOfItsPoints) {
  const TracedLab lab(7);
  Observations data = lab.Survey(40);
  const TwoSetUps two(data.p, Eigen::Vector3d::UnitX());
  AddSetUps(Named(data, two.names), "test", &data);
  ASSERT_EQ(data.set_ups.size(), 2U);
  EXPECT_EQ(data.set_ups[0].name, "A");
  EXPECT_EQ(data.set_ups[1].points, 16);
  ASSERT_EQ(data.common.size(), 6U);
  Eigen::VectorXd q(6);
  q << 0.1, -0.2, 0.3, 0.2, 0.1, -0.3;
  Vector6 motion;
  for (std::size_t k = 0; k < 6; ++k) {
    motion(static_cast<Eigen::Index>(k)) = q(static_cast<Eigen::Index>(k)) * data.common[k].sigma;
    EXPECT_EQ(data.common[k].set_up, 1);
  }
  // 30 sigmas, at the RMS distance.
  EXPECT_DOUBLE_EQ(data.common[0].sigma, 30.0 * lab.survey_sigma);
  EXPECT_NEAR(data.common[5].sigma, 30.0 * lab.survey_sigma / two.arm, 1e-12);
  Eigen::Matrix3Xd moved = data.p;
  two.Move(motion, &moved);
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    // Second order: 4 mrad squared, times 1 m, halved.
    EXPECT_LT((CommonShift(data, q, i) - (moved.col(i) - data.p.col(i))).norm(), 1e-5);
  }
  EXPECT_GT((moved - data.p).colwise().norm().maxCoeff(), 3e-3);
}

// The most points hold the frame; of as many those that are named first.
TEST(SetUp, TheMostPointsHoldTheFrame) {
  const TracedLab lab(7);
  const auto first = [&](const std::vector<std::string>& names) {
    Observations data = lab.Survey(12);
    AddSetUps(Named(data, names), "test", &data);
    std::string all;
    for (const calib::SetUp& set_up : data.set_ups) all += set_up.name;
    return all;
  };
  EXPECT_EQ(first({"a", "a", "a", "b", "b", "b", "b", "b", "c", "c", "c", "c"}), "bac");
  EXPECT_EQ(first({"a", "a", "a", "a", "a", "a", "b", "b", "b", "b", "b", "b"}), "ab");
  EXPECT_EQ(first({"b", "a", "b", "a", "b", "a", "b", "a", "b", "a", "b", "a"}), "ba");
  EXPECT_EQ(first({"a", "a", "a", "a", "a", "a", "a", "a", "a", "a", "a", "a"}), "");
  EXPECT_EQ(first({}), "");
}

// The same bits as without a column, and where every line has the same label.
TEST(SetUp, OneLabelIsAsNone) {
  const TracedLab lab(8);
  const Observations data = lab.Survey(60);
  Observations named = data;
  AddSetUps(Named(data, std::vector<std::string>(60, "A")), "test", &named);
  const RigFit without = FitRig(data, {.workers = 1}, "test");
  const RigFit with = FitRig(named, {.workers = 1}, "test");
  EXPECT_EQ(with.bundle.state.common.size(), 0);
  EXPECT_EQ(with.rig.covariance, without.rig.covariance);
  EXPECT_EQ(with.bundle.state.points, without.bundle.state.points);
  EXPECT_EQ(with.bundle.summary.chi_square, without.bundle.summary.chi_square);
  EXPECT_EQ(with.bundle.summary.degrees_of_freedom, without.bundle.summary.degrees_of_freedom);
}

// By the data, with every redundancy by its own definition.
TEST(SetUp, DegreesOfFreedomAreTheRedundanciesSum) {
  const TracedLab lab(9);
  Observations data = lab.Survey(60);
  const TwoSetUps two(data.p, Eigen::Vector3d::UnitY());
  const RigFit without = FitRig(data, {.workers = 1}, "test");
  AddSetUps(Named(data, two.names), "test", &data);
  const RigFit fit = FitRig(data, {.workers = 1}, "test");
  double sum = 0.0;
  for (const double r : fit.bundle.redundancy.reading) sum += r;
  for (const double r : fit.bundle.redundancy.survey) sum += r;
  EXPECT_NEAR(sum, fit.bundle.summary.degrees_of_freedom, 0.5);
  // Six less, but for what priors hold, of the cameras too, at another solution.
  const double less =
      without.bundle.summary.degrees_of_freedom - fit.bundle.summary.degrees_of_freedom;
  EXPECT_NEAR(less, 6.0, 0.5);
}

Calibration CalibrateTwo(const TracedLab& lab, double sigmas, int points = 120) {
  const Eigen::Matrix3Xd places = lab.Places(points);
  Observations data = lab.Survey(places);
  const TwoSetUps two(places, Towards(lab.rng.Stream("towards")));
  two.Move(MotionOf(sigmas, lab.survey_sigma, two.arm, lab.rng.Stream("motion")), &data.p);
  AddSetUps(Named(data, two.names), "test", &data);
  return Calibrate(data, {.order = kFullOrder}, "test");
}

TEST(SetUp, OneThatIsOffIsNamedAndTheRigIsGood) {
  const Calibration result = CalibrateTwo(TracedLab(25), 4.0);
  EXPECT_EQ(result.rig.verdict, kGood);
  ASSERT_EQ(result.report.set_ups.size(), 1U);
  const SetUpEstimate& b = result.report.set_ups[0];
  EXPECT_TRUE(b.off);
  EXPECT_EQ(b.points, 48);
  EXPECT_NEAR(b.shift.norm(), 4.0 * kTracedSurvey, 4.0 * b.ShiftSigma());
  EXPECT_THAT(result.rig.reasons,
              Contains(AllOf(HasSubstr("set-up \"B\" (48 points) is off from \"A\""),
                             HasSubstr(" mm ("), HasSubstr(" mrad ("))));
  EXPECT_EQ(result.rig.checks.at("set_ups_off [1]"), 1.0);
  EXPECT_EQ(result.report.common.size(), 6U);
  EXPECT_EQ(result.report.common[3].set_up, "B");
  // Held-out points lie in their own set-up's frame: some 114 of three numbers; four sigmas.
  EXPECT_NEAR(result.rig.checks.at("held_out_nees_per_dof [1]"), 1.0,
              4.0 * std::sqrt(2.0 / (3.0 * 114.0)));
}

TEST(SetUp, OneThatIsNotOffAgrees) {
  const Calibration result = CalibrateTwo(TracedLab(26), 0.0);
  EXPECT_EQ(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("set-up \"B\" (48 points) agrees with")));
  EXPECT_EQ(result.rig.checks.at("set_ups_off [1]"), 0.0);
}

// One set-up after the other, as stations are carried: what a steady drift moves each of them by is
// the frame or its own place, and nothing that might not show.
TEST(SetUp, OneAfterTheOtherIsGood) {
  const TracedLab lab(25);
  Observations data = lab.Survey(120);
  std::vector<std::string> names(120, "A");
  for (std::size_t i = 70; i < names.size(); ++i) names[i] = "B";
  for (Eigen::Index i = 70; i < 120; ++i) data.p.col(i).x() += 4.0 * kTracedSurvey;
  AddSetUps(Named(data, names), "test", &data);
  const Calibration result = Calibrate(data, {.order = kFullOrder}, "test");
  EXPECT_EQ(result.rig.verdict, kGood) << result.rig.reasons.front();
}

// Off by a hundred sigmas: more than first order bears, and said.
TEST(SetUp, OneThatIsFarOffIsNotGood) {
  const Calibration result = CalibrateTwo(TracedLab(27), 100.0);
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("into the other's frame first")));
}

// Two points of a third set-up, 1 m off: named; the rig is as if they had not been surveyed.
// By metres: no camera fits all points.
TEST(SetUp, OneThatIsOffByMetresIsNamed) {
  const TracedLab lab(8);
  Observations data = lab.Survey(100);
  const TwoSetUps two(data.p, Eigen::Vector3d::UnitX());
  Vector6 motion = Vector6::Zero();
  motion(1) = 3.0;
  two.Move(motion, &data.p);
  AddSetUps(Named(data, two.names), "test", &data);
  try {
    FitRig(data, {}, "test");
    ADD_FAILURE() << "not refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("40 points of set-up \"B\""), HasSubstr(", +3, ")));
  }
}

TEST(SetUp, AFewPointsAreNamedAndDoNoHarm) {
  const TracedLab lab(28);
  const Eigen::Matrix3Xd places = lab.Places(80);
  Observations data = lab.Survey(places);
  std::vector<int> all_but(78);
  for (int i = 0; i < 78; ++i) all_but[static_cast<std::size_t>(i)] = i;
  Observations alone = SelectPoints(data, all_but);
  alone.set_ups_told = true;
  const Calibration without = Calibrate(alone, {.order = kFullOrder}, "test");
  std::vector<std::string> names(80, "A");
  for (const int i : {78, 79}) {
    names[static_cast<std::size_t>(i)] = "B";
    data.p.col(i) += Eigen::Vector3d(2e-3, -1e-3, 1e-3);
  }
  AddSetUps(Named(data, names), "test", &data);
  const Calibration with = Calibrate(data, {.order = kFullOrder}, "test");
  EXPECT_EQ(with.rig.verdict, without.rig.verdict);
  EXPECT_THAT(with.rig.reasons,
              Contains(AllOf(HasSubstr("set-up \"B\" (2 points)"),
                             HasSubstr("three points that are not on one line"))));
  const double before = FindCheckPoints(lab, without.rig, 100).Bounds();
  const double after = FindCheckPoints(lab, with.rig, 100).Bounds();
  EXPECT_NEAR(after, before, 0.05 * before);  // readings of two points more
}

std::string RefusalOf(const data::Survey& survey) {
  Observations data;
  data.p = survey.p;
  data.cov.assign(survey.id.size(), 1e-8 * Eigen::Matrix3d::Identity());
  try {
    AddSetUps(survey, "survey.csv", &data);
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(SetUp, Refusals) {
  const TracedLab lab(29);
  Observations data = lab.Survey(6);
  data::Survey survey = Named(data, {"a", "a", "b", "b", "c", "c"});
  EXPECT_THAT(RefusalOf(survey),
              AllOf(HasSubstr("survey.csv"), HasSubstr("of 3 set-ups none has three points")));
  survey.set_up = {"a", "a", "a", "a", "b", "b"};
  EXPECT_EQ(RefusalOf(survey), "none");
  // All of a set-up on one line, to a tenth of a millimetre over a metre.
  for (int i = 0; i < 4; ++i) survey.p.col(i) = Eigen::Vector3d(0.3 * i, 1e-4 * (i % 2), 0.5);
  EXPECT_THAT(RefusalOf(survey), HasSubstr("not on one line"));
  survey.p = data.p;
  survey.station = Eigen::Vector3d(4.0, 0.0, 1.0);
  EXPECT_THAT(RefusalOf(survey), HasSubstr("where one station stood"));
  survey.station_errors.distance_offset = 1e-3;
  EXPECT_THAT(RefusalOf(survey), HasSubstr("what one station does to all points"));
  survey.set_up.assign(6, "a");
  EXPECT_EQ(RefusalOf(survey), "none");
}

// A check takes the rig's frame for its points'.
TEST(SetUp, ACheckTakesOne) {
  data::Survey survey;
  survey.set_up = {"a", "b"};
  try {
    CheckPoints({}, survey, "ten.csv");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("ten.csv:set_up"), HasSubstr("2 set-ups")));
  }
}

}  // namespace
}  // namespace unfurl::calib::set_up_test
