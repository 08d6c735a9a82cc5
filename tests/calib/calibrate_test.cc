#include "calib/calibrate.h"

#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "base/error.h"
#include "calib/verdict.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::calibrate_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MakeStudy;
using testing::Observe;
using testing::PointsInCube;
using testing::Study;

std::string Refusal(const Observations& data) {
  try {
    FitRig(data, {}, "survey.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

Observations Survey(const Eigen::Matrix3Xd& points) {
  return Observe(MakeStudy(1).truth, points, 3e-4, 0.05, Rng(4));
}

TEST(Refusal, TooFewPoints) {
  EXPECT_THAT(Refusal(Survey(PointsInCube(11, 0.5, Rng(1)))),
              AllOf(HasSubstr("survey.csv"), HasSubstr("11 points"), HasSubstr("12")));
}

TEST(Refusal, CoplanarPointsWithTheirPlane) {
  Eigen::Matrix3Xd points = PointsInCube(60, 0.9, Rng(2));
  points.row(2).setConstant(0.2);
  EXPECT_THAT(Refusal(Survey(points)), AllOf(HasSubstr("coplanar"), HasSubstr("1.00)")));
}

TEST(Refusal, CollinearPoints) {
  Eigen::Matrix3Xd points = PointsInCube(60, 0.9, Rng(2));
  points.row(1) = 0.3 * points.row(0);
  points.row(2) = -0.2 * points.row(0);
  EXPECT_THAT(Refusal(Survey(points)), HasSubstr("collinear"));
}

TEST(Refusal, ACameraThatSawTooLittle) {
  Observations data = MakeStudy(1).data;
  int left = 9;
  std::erase_if(data.readings, [&](const Reading& r) { return r.camera == 2 && left-- <= 0; });
  EXPECT_THAT(Refusal(data), AllOf(HasSubstr("camera \"c3\""), HasSubstr("sees 9 ")));
}

TEST(Refusal, ACameraThatSawOnePlaneOnly) {
  const Study study = MakeStudy(1, 600);
  Observations data = study.data;
  std::erase_if(data.readings, [&](const Reading& r) {
    return r.camera == 1 && std::abs(study.points(0, r.point)) > 0.04;
  });
  EXPECT_THAT(Refusal(data), AllOf(HasSubstr("camera \"c2\""), HasSubstr("coplanar")));
}

TEST(Refusal, ReadingsThatBelongToOtherPoints) {
  Observations data = MakeStudy(1).data;
  Rng rng(5);
  for (Reading& r : data.readings) {
    if (r.camera == 0) r.u_px = rng.Uniform(0.0, testing::kPixels - 1.0);
  }
  EXPECT_THAT(Refusal(data), AllOf(HasSubstr("camera \"c1\""), HasSubstr("do not fit any camera")));
}

TEST(Refusal, OneCamerasReadingsGivenTwice) {
  Observations data = MakeStudy(1).data;
  std::vector<double> first(data.ids.size(), NAN);
  for (const Reading& r : data.readings) {
    if (r.camera == 0) first[static_cast<std::size_t>(r.point)] = r.u_px;
  }
  std::erase_if(data.readings, [&](const Reading& r) {
    return r.camera == 3 && std::isnan(first[static_cast<std::size_t>(r.point)]);
  });
  for (Reading& r : data.readings) {
    if (r.camera == 3) r.u_px = first[static_cast<std::size_t>(r.point)];
  }
  EXPECT_THAT(Refusal(data), AllOf(HasSubstr("\"c1\" and \"c4\""), HasSubstr("same readings")));
}

TEST(Refusal, TwoCameras) {
  Observations data = MakeStudy(1).data;
  data.cameras.resize(2);
  std::erase_if(data.readings, [](const Reading& r) { return r.camera > 1; });
  EXPECT_THAT(Refusal(data), HasSubstr("2 cameras"));
}

TEST(Calibrate, SoundSurveyIsGoodAndItsHeldOutErrorsArePredicted) {
  Study study = MakeStudy(11);
  study.data = Observe(study.truth, PointsInCube(200, 0.9, Rng(11)), 3e-4, 0.05, Rng(12));
  const Calibration result = Calibrate(study.data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kGood);
  EXPECT_FALSE(result.rig.reasons.empty());
  EXPECT_TRUE(result.report.converged);
  EXPECT_EQ(result.report.readings.size(), study.data.readings.size());
  EXPECT_GT(result.report.held_out.size(), 180U);
  // 3 x 190 squares of unit mean, correlated within a fold: their mean is within a fifth of one.
  EXPECT_NEAR(result.rig.checks.at("held_out_nees_per_dof [1]"), 1.0, 0.2);
  // Two degrees of freedom per hundred are lost to what the loss leaves out.
  const double dof = result.report.degrees_of_freedom;
  EXPECT_NEAR(result.report.chi_square / dof, 1.0, 4.0 * std::sqrt(2.0 / dof) + 0.02);
  EXPECT_NEAR(dof, static_cast<double>(study.data.readings.size()) - 76.0, 20.0);
}

TEST(Calibrate, ResultDoesNotDependOnWorkers) {
  const Study study = MakeStudy(12, 60);
  CalibrateOptions one, four;
  one.workers = 1;
  four.workers = 4;
  const Calibration a = Calibrate(study.data, one, "test"), b = Calibrate(study.data, four, "test");
  EXPECT_EQ(a.rig.checks, b.rig.checks);
  EXPECT_EQ(a.rig.covariance, b.rig.covariance);
}

// A lens that does what no term can: 0.5 px of ripple along the sensor. The floor takes it up, the
// error bars stay true, and the verdict says so.
TEST(ModelFloor, RisesWhenTheLensIsNotOfTheModelsKind) {
  Study study = MakeStudy(13);
  const Calibration before = Calibrate(study.data, {}, "test");
  for (Reading& r : study.data.readings) r.u_px += 0.5 * std::sin(r.u_px / 40.0 + r.camera);
  const Calibration after = Calibrate(study.data, {}, "test");
  EXPECT_LT(before.rig.model_floor_px, 0.04);
  EXPECT_NEAR(after.rig.model_floor_px, 0.5 / std::sqrt(2.0), 0.1);  // the ripple's RMS
  EXPECT_NEAR(after.report.chi_square / after.report.degrees_of_freedom, 1.0, 0.05);
  EXPECT_NEAR(after.rig.checks.at("held_out_nees_per_dof [1]"), 1.0, 0.3);
  EXPECT_EQ(after.rig.verdict, kWithCare);
  EXPECT_THAT(after.rig.reasons, ::testing::Contains(HasSubstr("the lens model or the stated")));
}

// What the survey cannot tell is named: a pinhole's place along its lens axis, which glass betrays
// by its terms in y.
TEST(WeakDirections, PlaceAlongTheLensAxisIsNamedForAPinhole) {
  const auto named = [](const Calibration& result) {
    std::set<int> cameras;
    for (const WeakDirection& weak : result.report.weak) {
      if (weak.name.find("place along its lens axis") != std::string::npos && weak.unit == "m" &&
          weak.sigma > 0.05 && weak.harmless) {
        cameras.insert(weak.camera);
      }
    }
    return cameras.size();
  };
  const Study study = MakeStudy(14, 100, {.distortion = 0.0});
  const Calibration pinhole = Calibrate(study.data, {}, "test");
  EXPECT_EQ(named(pinhole), 4U);
  EXPECT_EQ(named(Calibrate(MakeStudy(14, 100).data, {}, "test")), 0U);
  // And it harms no point: a hundred points of 0.3 mm give 0.3 mm.
  const auto errors = testing::ErrorsOf(pinhole.rig, study.truth, testing::CheckPoints(14));
  EXPECT_LT(errors.Rms(), 5e-4);
}

// Of 0.05 px: what terms that are not there are thought to do stays below it.
constexpr double kReadingNoise = 0.05;  // [px]

// Terms that are not there are not taken, or do next to nothing; terms that are there are.
TEST(LensOrder, CrossValidationTakesWhatIsThere) {
  const Calibration pinhole = Calibrate(MakeStudy(14, 100, {.distortion = 0.0}).data, {}, "test");
  EXPECT_EQ(pinhole.report.lens_model, "pinhole");
  EXPECT_LT(pinhole.report.open_terms.rms_px, kReadingNoise);
  const Calibration glass = Calibrate(MakeStudy(14, 200).data, {}, "test");
  EXPECT_EQ(glass.report.lens_model, "full");
  ASSERT_GT(static_cast<int>(glass.report.orders.size()),
            measure::UsualOrderOf(data::LensModel::kRectilinear));
  // Centimetres for a pinhole: its floor says so.
  EXPECT_GT(glass.report.orders[0].largest_floor_px, 5.0);
  EXPECT_GT(glass.report.orders[0].loss, 1000.0);
}

// One lens with all terms among pinholes: each camera gets its own order, and found points gain
// what the others' needless terms would cost.
TEST(LensOrder, OneBadLensDoesNotBurdenTheOthers) {
  double own = 0.0, shared = 0.0;
  for (std::uint64_t seed = 70; seed < 73; ++seed) {
    Study study = MakeStudy(seed, 60);
    for (std::size_t j = 1; j < 4; ++j) study.truth[j].terms_px.fill(0.0);
    study.data = Observe(study.truth, study.points, 3e-4, 0.05, Rng(seed));
    const Calibration result = Calibrate(study.data, {}, "test");
    ASSERT_EQ(result.report.order, kOrderByCamera);
    EXPECT_EQ(result.report.lens_model, OrderName(result.report.orders.back()));
    EXPECT_LT(result.report.open_terms.rms_px, kReadingNoise);
    EXPECT_FALSE(result.rig.covariance.row(9).isZero(0.0));  // c1 has x^3
    const Eigen::Matrix3Xd check = testing::CheckPoints(seed);
    own += std::pow(testing::ErrorsOf(result.rig, study.truth, check).Rms(), 2);
    shared += std::pow(
        testing::ErrorsOf(FitRig(study.data, {}, "test").rig, study.truth, check).Rms(), 2);
  }
  // 40% of the RMS over many rigs; three of them scatter.
  EXPECT_LT(std::sqrt(own / shared), 0.9);
}

// The same lenses, where a richer model must gain far more than telling the cameras apart does.
TEST(LensOrder, OrdersByCameraMustGainWhatIsAskedOfThem) {
  Study study = MakeStudy(70, 60);
  for (std::size_t j = 1; j < 4; ++j) study.truth[j].terms_px.fill(0.0);
  study.data = Observe(study.truth, study.points, 3e-4, 0.05, Rng(70));
  CalibrateOptions options;
  options.choice.gain = 300.0;  // nats; a pinhole for the bad lens loses thousands
  const CalibrationReport report = Calibrate(study.data, options, "test").report;
  ASSERT_EQ(report.orders.back().order, kOrderByCamera);
  ASSERT_GE(report.order, 0);
  const double shared = report.orders[static_cast<std::size_t>(report.order)].loss;
  EXPECT_GT(shared, report.orders.back().loss);  // there is a gain
  EXPECT_LT(shared, report.orders.back().loss + options.choice.gain);
}

TEST(Advice, PointsNearOnePlaneAndSensorsWithoutReadingsAreTold) {
  Study study = MakeStudy(19, 100);
  study.points.row(2) *= 0.15;
  study.data = Observe(study.truth, study.points, 3e-4, 0.05, Rng(20));
  std::erase_if(study.data.readings,
                [](const Reading& r) { return r.camera == 1 && r.u_px < 700.0; });
  const Calibration result = Calibrate(study.data, {}, "test");
  EXPECT_THAT(result.report.advice,
              ::testing::Contains(AllOf(HasSubstr("one plane"), HasSubstr("at z > "))));
  EXPECT_THAT(result.report.advice,
              ::testing::Contains(AllOf(HasSubstr("\"c2\""), HasSubstr("from pixel 0 to 7"))));
}

// A hinge's survey is a hundredth of a wing's: what to measure is said with as many digits.
TEST(Advice, LengthsHaveTheDigitsOfTheSurvey) {
  Study study = MakeStudy(19, 100);
  study.points.row(2) *= 0.15;
  study.data = Observe(study.truth, study.points, 3e-4, 0.05, Rng(20));
  study.data.p *= 0.01;
  for (Eigen::Matrix3d& cov : study.data.cov) cov *= 1e-4;
  const Calibration result = Calibrate(study.data, {}, "test");
  EXPECT_THAT(result.report.advice,
              ::testing::Contains(::testing::ContainsRegex("within 0.00[0-9]*[1-9] m")));
}

// Five points to each free parameter of a camera: nine, and the lens terms that were taken up.
TEST(Advice, FewPointsAreAskedToBeMore) {
  const auto asks = [](int points) {
    const Calibration result = Calibrate(MakeStudy(23, points).data, {}, "test");
    const std::string words = fmt::format("{}", fmt::join(result.report.advice, "; "));
    return words.find("four times as many") != std::string::npos;
  };
  EXPECT_TRUE(asks(40));
  EXPECT_FALSE(asks(120));
}

TEST(Verdict, DishonestErrorBarsAreNotToBeUsed) {
  const Study study = MakeStudy(15, 60);
  Calibration result = Calibrate(study.data, {}, "test");
  for (HeldOutPoint& point : result.report.held_out) {
    point.error *= 3.0;
    point.squared *= 9.0;
  }
  Judge(result.report, study.data, &result.rig);
  EXPECT_EQ(result.rig.verdict, kDoNotUse);
  EXPECT_THAT(result.rig.reasons.front(), HasSubstr("error bars"));
}

// Four cameras on a horizontal circle, all lens axes upright: no reading tells a height.
TEST(Verdict, ParallelLensAxesAreNotToBeUsed) {
  Study study = MakeStudy(17, 100);
  for (std::size_t j = 0; j < 4; ++j) {
    const double turn = 1.4 * static_cast<double>(j);
    const data::RigCamera pose = testing::LookAt({3.2 * std::cos(turn), 3.2 * std::sin(turn), 0.0},
                                                 Eigen::Vector3d::Zero(), 0.0);
    study.truth[j].R_CW = pose.R_CW;
    study.truth[j].p_WC = pose.p_WC;
    study.truth[j].terms_px.fill(0.0);
  }
  study.data = Observe(study.truth, study.points, 3e-4, 0.05, Rng(18));
  const Calibration result = Calibrate(study.data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kDoNotUse);
}

// Two cameras in one place, each with its own noise: a rig of three and a spare.
TEST(Calibrate, TwoCamerasInOnePlaceWork) {
  Study study = MakeStudy(27, 120);
  const std::string name = study.truth[3].name;
  study.truth[3] = study.truth[0];
  study.truth[3].name = name;
  study.data = Observe(study.truth, study.points, 3e-4, 0.05, Rng(28));
  const RigFit fit = FitRig(study.data, {}, "test");
  const auto errors = testing::ErrorsOf(fit.rig, study.truth, testing::CheckPoints(27));
  ASSERT_GT(errors.error.size(), 100U);
  // One calibration has some 24 independent errors: its RMS is within 50% of its prediction.
  EXPECT_NEAR(errors.Rms(), errors.PredictedRms(), 0.5 * errors.PredictedRms());
}

// The fewest points that are taken: a rig comes out, its error bars know how little that is, and
// the verdict says so.
TEST(Calibrate, TwelvePointsWorkAndSaySo) {
  double squares =
      0.0;  // of errors over what is stated: each rig counts alike, the ill-determined no more
  int rigs = 0;
  for (std::uint64_t seed = 61; seed < 66; ++seed) {
    Study study = MakeStudy(seed);
    study.data = Observe(study.truth, PointsInCube(12, 0.9, Rng(seed)), 3e-4, 0.05, Rng(seed + 1));
    if (study.data.readings.size() < 48) continue;  // a camera that sees fewer refuses by name
    const Calibration result = Calibrate(study.data, {}, "test");
    EXPECT_NE(result.rig.verdict, kGood);
    const auto errors =
        testing::ErrorsOf(result.rig, study.truth, PointsInCube(100, 0.6, Rng(seed).Stream("in")));
    squares += std::pow(errors.Rms() / errors.PredictedRms(), 2);
    ++rigs;
  }
  ASSERT_GE(rigs, 3);
  EXPECT_LT(std::sqrt(squares / rigs), 2.0);
}

TEST(Verdict, TooFewPointsForTheirCamerasAreNotGood) {
  const Calibration result = Calibrate(MakeStudy(16, 20).data, {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
}

TEST(Observations, RefusesReadingsWithoutSigma) {
  data::Survey survey;
  survey.id = {"p1"};
  survey.p = Eigen::Vector3d::Zero();
  survey.cov.resize(6, 1);
  survey.cov << 1e-8, 0.0, 0.0, 1e-8, 0.0, 1e-8;
  survey.cameras = {"c1"};
  survey.u_px = Eigen::MatrixXd::Constant(1, 1, 100.0);
  survey.s_px = Eigen::MatrixXd::Constant(1, 1, 0.0);
  EXPECT_THROW(FromSurvey(survey, "s.csv"), Error);
  survey.s_px(0, 0) = 0.1;
  EXPECT_EQ(FromSurvey(survey, "s.csv").readings.size(), 1U);
  survey.cov(0, 0) = -1.0;
  EXPECT_THROW(FromSurvey(survey, "s.csv"), Error);
}

// A file that was appended to itself: n points twice are no 2n points, whose error bars would be
// 1/sqrt(2) of what they are. Places measured again, with readings of their own, are.
TEST(Observations, RefusesPointsThatAreCopies) {
  data::Survey survey;
  survey.id = {"p1", "p2", "p3", "p1 again"};
  survey.p = Eigen::Matrix3Xd::Zero(3, 4);
  survey.p.row(0) << 0.1234, 0.2, 0.3, 0.1234;
  survey.cov = Eigen::Matrix<double, 6, 1>(1e-8, 0.0, 0.0, 1e-8, 0.0, 1e-8).replicate(1, 4);
  survey.cameras = {"c1", "c2", "c3"};
  survey.u_px.resize(4, 3);
  survey.u_px << 100.01, 200.02, 300.03, 110.0, 210.0, 310.0, 120.0, 220.0, 320.0,  //
      100.02, 200.02, 300.03;
  survey.s_px = Eigen::MatrixXd::Constant(4, 3, 0.02);
  EXPECT_EQ(FromSurvey(survey, "s.csv").readings.size(), 12U);
  survey.u_px(3, 0) = survey.u_px(0, 0);
  try {
    FromSurvey(survey, "s.csv");
    ADD_FAILURE() << "a copy was taken for a measurement";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("\"p1 again\" has the place and the readings of"));
  }
}

}  // namespace
}  // namespace unfurl::calib::calibrate_test
