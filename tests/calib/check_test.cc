#include "calib/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/random_vector.h"
#include "calib/layout.h"
#include "calib/plan.h"
#include "measure/camera_model.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::check_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::MakeStudy;
using testing::Observe;
using testing::PointsInCube;
using testing::Study;

Observations BarAt(const std::vector<data::RigCamera>& truth, double length, std::uint64_t seed) {
  Rng rng(seed);
  Eigen::Matrix3Xd ends(3, 12);
  for (Eigen::Index k = 0; k < 6; ++k) {
    Eigen::Vector3d way = NormalVector(&rng);
    way *= 0.5 * length / way.norm();
    const Eigen::Vector3d middle = UniformVector(&rng, -0.2, 0.2);
    ends.col(2 * k) = middle - way;
    ends.col(2 * k + 1) = middle + way;
  }
  return Observe(truth, ends, 0.0, 0.05, rng);
}

// One calibration, and checks of it with fresh points and noise.
class Check : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    study_ = new Study(MakeStudy(41));
    rig_ = new data::Rig(FitRig(study_->data, {}, "test").rig);
  }
  static void TearDownTestSuite() {
    delete study_;
    delete rig_;
  }
  static Observations Ten(std::uint64_t seed) {
    return Observe(study_->truth, PointsInCube(10, 0.7, Rng(seed).Stream("ten")), 3e-4, 0.05,
                   Rng(seed));
  }
  static Study* study_;
  static data::Rig* rig_;
};
Study* Check::study_ = nullptr;
data::Rig* Check::rig_ = nullptr;

// Under the truth the chance is even between 0 and 1: of 40 checks with one calibration (whose own
// error they share), few lie below 1%.
TEST_F(Check, AnUnchangedRigIsStillValid) {
  int doubted = 0;
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const CheckResult result = CheckPoints(*rig_, Ten(seed), "test");
    doubted += result.verdict != "still valid";
    sum += result.chance;
  }
  EXPECT_LE(doubted, 3);  // 0.4 expected
  EXPECT_NEAR(sum / 40.0, 0.5, 0.2);
}

TEST_F(Check, ACameraThatMovedIsNamed) {
  Observations data = Ten(50);
  for (Reading& r : data.readings) {
    if (r.camera == 2) r.u_px += 3.0;  // 1.4 mrad
  }
  const CheckResult result = CheckPoints(*rig_, data, "test");
  EXPECT_EQ(result.verdict, "no longer valid");
  EXPECT_THAT(result.reasons, Contains(HasSubstr("without camera \"c3\"")));
}

std::vector<std::pair<int, double>> Named(const CheckResult& result) {
  std::vector<std::pair<int, double>> out;
  for (const CheckedCause& cause : result.causes) out.emplace_back(cause.camera, cause.size);
  std::sort(out.begin(), out.end());
  return out;
}

// Two cameras at once, of which the points' frame, or a third camera, explains a good part.
TEST_F(Check, TwoCamerasThatMovedAreNamed) {
  Rng rng(52);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Observations data = Ten(200 + seed);
    const int one = static_cast<int>(rng.Integer(4)), way = 1 + static_cast<int>(rng.Integer(3));
    const int other = (one + way) % 4;
    std::map<int, double> by;
    for (const int camera : {one, other}) {
      by[camera] = (rng.Uniform() < 0.5 ? -1.0 : 1.0) * std::pow(10.0, rng.Uniform(0.3, 1.5));
    }
    for (Reading& r : data.readings) r.u_px += by.count(r.camera) > 0 ? by[r.camera] : 0.0;
    const CheckResult result = CheckPoints(*rig_, data, "test");
    const auto named = Named(result);
    ASSERT_EQ(named.size(), 2U) << seed << " " << result.reasons[1];
    for (const auto& [camera, size] : named) EXPECT_NEAR(size, by[camera], 0.5) << seed;
    EXPECT_FALSE(std::any_of(result.reasons.begin(), result.reasons.end(), [](const auto& text) {
      return text.find("(0 mm RMS") != std::string::npos;  // of points that were not found
    }));
  }
}

// A camera that was turned so far that readings are not linear in it, and a bar that it sees.
TEST_F(Check, FarMovesAreFollowed) {
  for (const double turn : {0.01, 0.04}) {
    std::vector<data::RigCamera> moved = study_->truth;
    Eigen::Matrix<double, data::kCameraParameters, 1> change;
    change.setZero();
    change.head<3>() << 0.2 * turn, turn, 0.3 * turn;
    moved[1] = measure::Perturbed(moved[1], change);
    const Observations points =
        Observe(moved, PointsInCube(10, 0.7, Rng(53).Stream("ten")), 3e-4, 0.01, Rng(53));
    for (const CheckResult& result :
         {CheckPoints(*rig_, points, "test"),
          CheckBar(*rig_, BarAt(moved, 1.2, 60), {1.2, 2e-5}, "test")}) {
      ASSERT_EQ(result.causes.size(), 1U) << turn << result.reasons[1];
      EXPECT_EQ(result.causes[0].camera, 1);
    }
  }
}

TEST_F(Check, AWrongPointIsNamedAndTheRigStands) {
  Observations data = Ten(51);
  data.p.col(4) += Eigen::Vector3d(0.02, 0.0, 0.0);
  const CheckResult result = CheckPoints(*rig_, data, "test");
  EXPECT_EQ(result.verdict, "doubtful");
  EXPECT_THAT(result.reasons, Contains(HasSubstr("without point \"p5\"")));
}

// So far that readings are not linear in it: what that leaves is no second cause.
TEST_F(Check, APointThatSlippedByCentimetresIsTheOnlyCause) {
  const Observations ten =
      Observe(study_->truth, PointsInCube(10, 0.7, Rng(54).Stream("ten")), 3e-4, 0.01, Rng(54));
  for (const double metres : {0.01, 0.05, 0.1, 0.2}) {
    for (int axis = 0; axis < 3; ++axis) {
      SCOPED_TRACE(::testing::Message() << metres << " m along axis " << axis);
      Observations data = ten;
      data.p(axis, 4) += metres;
      const CheckResult result = CheckPoints(*rig_, data, "test");
      EXPECT_EQ(result.verdict, "doubtful");
      ASSERT_EQ(result.causes.size(), 1u);
      EXPECT_EQ(result.causes[0].kind, CauseKind::kPoint);
      EXPECT_EQ(result.causes[0].point, 4);
    }
  }
}

// A digit too many, however far it throws a point: beyond the cameras, too, and beside a camera
// that has moved.
TEST_F(Check, APointThatSlippedByMetresIsNamed) {
  for (const double metres : {1.0, 5.0, 100.0, 1e9}) {
    for (int axis = 0; axis < 3; ++axis) {
      SCOPED_TRACE(::testing::Message() << metres << " m along axis " << axis);
      Observations data = Ten(51);
      data.p(axis, 4) += metres;
      const CheckResult result = CheckPoints(*rig_, data, "test");
      EXPECT_EQ(result.verdict, "doubtful");
      ASSERT_EQ(result.causes.size(), 1u);
      EXPECT_EQ(result.causes[0].kind, CauseKind::kPoint);
      EXPECT_EQ(result.causes[0].point, 4);
      EXPECT_NEAR(result.causes[0].size, metres, 0.01);
    }
  }
  Observations data = Ten(52);
  data.p(0, 4) += 7.0;
  for (Reading& r : data.readings) r.u_px += r.camera == 1 ? 3.0 : 0.0;
  const CheckResult both = CheckPoints(*rig_, data, "test");
  EXPECT_EQ(both.verdict, "no longer valid");
  ASSERT_EQ(both.causes.size(), 2u);
  for (const CheckedCause& cause : both.causes) {
    const bool camera = cause.kind == CauseKind::kCamera;
    EXPECT_EQ(camera ? cause.camera : cause.point, camera ? 1 : 4);
  }
}

// Three cameras around a volume, whose rows lie as in a laboratory for four.
std::vector<data::RigCamera> MakeFlatThree() {
  std::vector<data::RigCamera> cameras;
  const double height[] = {35.0, -10.0, 20.0};
  for (int j = 0; j < 3; ++j) {
    const double turn = 2.0 * M_PI * (j + 0.5) / 3.0, up = height[j] * M_PI / 180.0;
    const Eigen::Vector3d place =
        2.9 *
        Eigen::Vector3d(std::cos(turn) * std::cos(up), std::sin(turn) * std::cos(up), std::sin(up));
    cameras.push_back(
        testing::LookAt(place, Eigen::Vector3d::Zero(), (j % 2 == 0 ? -1.0 : 1.0) * M_PI / 4.0));
    cameras.back().name = "c" + std::to_string(j + 1);
    cameras.back().f_px = 2000.0;
    cameras.back().u0_px = 1079.5;
    cameras.back().e = 0.03;
  }
  return cameras;
}

// Two labels exchanged: a camera that were moved until it explained that would have points behind
// it, and one of them was called wrongly placed, as an error of the input.
TEST_F(Check, TwoLabelsExchangedAreNoErrorOfOtherPoints) {
  const Observations ten = Ten(53);
  for (int a = 0; a < 10; ++a) {
    for (int b = 0; b < a; ++b) {
      Observations data = ten;
      data.p.col(a).swap(data.p.col(b));
      SCOPED_TRACE(data.ids[static_cast<std::size_t>(a)] + " and " +
                   data.ids[static_cast<std::size_t>(b)]);
      CheckResult result;
      ASSERT_NO_THROW(result = CheckPoints(*rig_, data, "test"));
      EXPECT_NE(result.verdict, "still valid");
    }
  }
}

// A placement that was pasted twice tells nothing more.
TEST_F(Check, PlacementsThatAreCopiesAreRefused) {
  Observations data = BarAt(study_->truth, 1.2, 60);
  std::vector<Reading> copied;
  for (const Reading& r : data.readings) {
    if (r.point < 2) copied.push_back({r.point + 2, r.camera, r.u_px, r.s_px});
  }
  ASSERT_GE(copied.size(), 6U);
  std::vector<Reading> all;
  for (const Reading& r : data.readings) {
    if (r.point == 2 || r.point == 3) continue;
    if (r.point > 3 && !copied.empty()) {
      all.insert(all.end(), copied.begin(), copied.end());
      copied.clear();
    }
    all.push_back(r);
  }
  data.readings = all;
  try {
    CheckBar(*rig_, data, {1.2, 2e-5}, "bar.csv");
    ADD_FAILURE() << "a copy was taken for a measurement";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("has the readings of placement"));
  }
}

TEST_F(Check, ABarOfKnownLength) {
  Observations data = BarAt(study_->truth, 1.2, 60);
  for (Eigen::Index i = 0; i < 12; ++i) data.p.col(i).setZero();  // where they are is not told
  const CheckResult good = CheckBar(*rig_, data, {1.2, 2e-5}, "test");
  EXPECT_EQ(good.verdict, "still valid") << good.chance;
  EXPECT_LT(good.rms, 0.5e-3);
  const CheckResult bad = CheckBar(*rig_, data, {1.203, 2e-5}, "test");
  EXPECT_EQ(bad.verdict, "no longer valid");
  EXPECT_NEAR(bad.rms, 3e-3, 0.3e-3);
  EXPECT_THAT(bad.reasons, Contains(HasSubstr("mm too short")));
}

// Three cameras whose planes meet at small angles in parts of the volume: ends of the bar that no
// three readings place are placed by the other end and the length. An unchanged rig is then doubted
// as seldom as any.
TEST(CheckOfThreeCameras, ABarIsFoundWhereItsEndsAreNot) {
  const std::vector<data::RigCamera> truth = MakeFlatThree();
  const Rng rng(70);
  const Observations survey = Observe(truth, PointsInCube(150, 0.9, rng.Stream("places")), 3e-4,
                                      0.05, rng.Stream("survey"));
  const data::Rig rig = FitRig(survey, {}, "test").rig;
  int doubted = 0, lost = 0;
  constexpr int kChecks = 25;
  for (std::uint64_t seed = 1; seed <= kChecks; ++seed) {
    Rng draw(1000 + seed);
    Eigen::Matrix3Xd ends(3, 20);
    for (Eigen::Index k = 0; k < 10; ++k) {
      Eigen::Vector3d way = NormalVector(&draw);
      way *= 0.3 / way.norm();
      const Eigen::Vector3d middle = UniformVector(&draw, -0.6, 0.6);
      ends.col(2 * k) = middle - way;
      ends.col(2 * k + 1) = middle + way;
    }
    const CheckResult result =
        CheckBar(rig, Observe(truth, ends, 0.0, 0.05, draw), {0.6, 5e-5}, "test");
    doubted += result.verdict != "still valid";
    for (const CheckedPoint& bar : result.points) lost += std::isnan(bar.error) ? 1 : 0;
  }
  EXPECT_GT(lost, kChecks);  // or it tests nothing
  EXPECT_LE(doubted, 2);     // 0.25 expected
}

// What the map says of a place is what the rig's covariance says there, by the other way round:
// errors of many re-calibrations are not needed for that, the covariance tests have them.
TEST_F(Check, MapAgreesWithTheRigsOwnCovariance) {
  MapOptions options;
  options.columns = 3;
  options.layers = 2;
  options.low = Eigen::Vector3d::Constant(-0.6);
  options.high = Eigen::Vector3d::Constant(0.6);
  options.reading_sigma_px = 0.05;
  const UncertaintyMap map = MapUncertainty(*rig_, SeenOnRow(*rig_), options);
  ASSERT_EQ(map.sigma.size(), 18U);
  EXPECT_EQ(map.Found(), 1.0);
  EXPECT_LT((map.Middle(0) - Eigen::Vector3d(-0.4, -0.4, -0.3)).norm(), 1e-12);
  EXPECT_LT((map.Middle(17) - Eigen::Vector3d(0.4, 0.4, 0.3)).norm(), 1e-12);
  for (std::size_t k = 0; k < map.sigma.size(); ++k) {
    // Normal equations of this place by hand: cov = (J^T J)^-1 s^2, plus L Sigma L^T.
    Eigen::MatrixXd J(4, 3), G = Eigen::MatrixXd::Zero(4, 4 * data::kCameraParameters);
    for (Eigen::Index c = 0; c < 4; ++c) {
      measure::Projection h;
      ASSERT_TRUE(measure::Project(rig_->cameras[static_cast<std::size_t>(c)], map.Middle(k), &h));
      const double s = std::hypot(0.05, data::FloorOf(*rig_, static_cast<std::size_t>(c)));
      J.row(c) = h.du_dp / s;
      G.block(c, data::kCameraParameters * c, 1, data::kCameraParameters) = h.du_dc / s;
    }
    const Eigen::MatrixXd A = (J.transpose() * J).inverse(), L = A * J.transpose() * G;
    const Eigen::Matrix3d whole = A + L * rig_->covariance * L.transpose();
    const double expected = std::sqrt(whole.trace());
    EXPECT_NEAR(map.sigma[k], expected, 1e-4 * expected);
    EXPECT_LT((map.covariance[k] - whole).norm(), 3e-4 * whole.norm());
  }
  // Less light, less to see by: a lost camera makes no place better.
  const UncertaintyMap lost = MapUncertainty(*rig_, SeenOnRow(*rig_), options, 1);
  for (std::size_t k = 0; k < map.sigma.size(); ++k) EXPECT_GT(lost.sigma[k], map.sigma[k]);
}

TEST_F(Check, AMirroredWorldIsToldByTheLayout) {
  data::Lab lab;
  for (const auto& camera : study_->truth) {
    data::LabCamera nominal;
    nominal.name = camera.name;
    nominal.position = camera.p_WC + Eigen::Vector3d(0.05, -0.03, 0.02);
    nominal.look_at.setZero();
    lab.cameras.push_back(nominal);
  }
  EXPECT_FALSE(CompareLayout(*rig_, lab).mirrored);
  Observations mirrored = study_->data;
  mirrored.p.row(0).swap(mirrored.p.row(1));  // N, E, H
  const data::Rig rig = FitRig(mirrored, {}, "test").rig;
  EXPECT_TRUE(CompareLayout(rig, lab).mirrored);
}

}  // namespace
}  // namespace unfurl::calib::check_test
