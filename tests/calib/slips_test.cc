// Slips in how whole files were written, with readings through glass: each is named, and sound
// files are left alone.
#include "calib/slips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.h"
#include "calib/calibrate.h"
#include "calib/check.h"
#include "calib/layout.h"
#include "calib/verdict.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::slips_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TracedLab;

// Calibrated once for all tests.
struct Hall {
  TracedLab lab{11};
  data::Rig rig = FitRig(lab.Survey(150), {}, "test").rig;

  Observations Points() const {
    TracedLab other = lab;
    other.rng = lab.rng.Stream("points to check with");
    return other.Survey(12);
  }
};
const Hall& TheHall() {
  static const Hall hall;
  return hall;
}

std::string RefusalOf(const Observations& data) {
  try {
    CheckPoints(TheHall().rig, data, "points.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Slips, MillimetresUnderTheNameOfMetres) {
  Observations data = TheHall().Points();
  data.p *= 1e3;
  EXPECT_THAT(RefusalOf(data), AllOf(HasSubstr("points.csv"), HasSubstr("millimetres under")));
  data.p *= 1e-6;
  EXPECT_THAT(RefusalOf(data), HasSubstr("metres under the name of millimetres"));
}

// Coordinates that all lie near one place fit no better than a twentieth of wholly wrong ones.
TEST(Slips, EachUnitByItsName) {
  for (const UnitSlip& unit : UnitSlips()) {
    Observations data = TheHall().Points();
    data.p /= unit.factor;
    EXPECT_THAT(RefusalOf(data),
                AllOf(HasSubstr("the coordinates are " + unit.what), HasSubstr("x [" + unit.unit)));
  }
  Observations data = TheHall().Points();
  data.p *= 70.0;
  EXPECT_THAT(RefusalOf(data), Not(HasSubstr("under the name of")));
}

TEST(Slips, ARowFromItsOtherEnd) {
  Observations data = TheHall().Points();
  for (Reading& r : data.readings) r.u_px = r.camera == 2 ? 2159.0 - r.u_px : r.u_px;
  EXPECT_THAT(RefusalOf(data),
              AllOf(HasSubstr("the row of camera \"" + TheHall().rig.cameras[2].name),
                    HasSubstr("write 2159 less")));
}

// Of places that were found without them, some of which are grossly wrong or not found at all.
TEST(Slips, AnotherUnitThanTheBars) {
  Rng rng(5);
  Eigen::Matrix3Xd found(3, 9);
  for (Eigen::Index i = 0; i < found.size(); ++i) found(i) = rng.Uniform(-3.0, 3.0);
  Eigen::Matrix3Xd stated =
      Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitY()).toRotationMatrix() * found;
  stated.colwise() += Eigen::Vector3d(100.0, 200.0, 5.0);
  stated.col(4) *= 3.0;
  found.col(7).setConstant(NAN);
  EXPECT_FALSE(FindScaleSlip(stated, found).found);
  EXPECT_THAT(FindScaleSlip(1e3 * stated, found).what, HasSubstr("millimetres under the name of"));
  EXPECT_THAT(FindScaleSlip(1e-3 * stated, found).what,
              HasSubstr("metres under the name of millimetres"));
  EXPECT_THAT(FindScaleSlip(stated / 0.0254, found).what, HasSubstr("inches under the name of"));
  EXPECT_FALSE(FindScaleSlip(1.2 * stated, found).found);  // that is another matter
}

TEST(Slips, LeftHandedAndExchangedColumns) {
  Observations data = TheHall().Points();
  data.p.row(0).swap(data.p.row(1));
  EXPECT_THAT(RefusalOf(data), HasSubstr("x and y are exchanged"));
  data.p.row(1).swap(data.p.row(2));  // x, y, z hold y, z, x of the rig's frame
  EXPECT_THAT(RefusalOf(data), HasSubstr("the columns x, y, z hold z, x, y"));
  data = TheHall().Points();
  data.p.row(2) *= -1.0;
  EXPECT_THAT(RefusalOf(data), HasSubstr("z has the wrong sign"));
}

TEST(Slips, CamerasAndRows) {
  Observations data = TheHall().Points();
  for (Reading& r : data.readings) {
    if (r.camera == 1 || r.camera == 2) r.camera = 3 - r.camera;
  }
  EXPECT_THAT(RefusalOf(data),
              AllOf(HasSubstr("exchanged"), HasSubstr(TheHall().rig.cameras[1].name),
                    HasSubstr(TheHall().rig.cameras[2].name)));
  data = TheHall().Points();
  Eigen::Matrix3Xd shifted = data.p;
  for (Eigen::Index i = 0; i + 1 < data.p.cols(); ++i) shifted.col(i) = data.p.col(i + 1);
  shifted.col(shifted.cols() - 1) = data.p.col(0);
  data.p = shifted;
  EXPECT_THAT(RefusalOf(data), HasSubstr("belong to the point before it"));
}

TEST(Slips, ReadingsOneRowOffInASurvey) {
  Observations data = TheHall().lab.Survey(80);
  const Eigen::Matrix3Xd p = data.p;
  for (Eigen::Index i = 0; i < p.cols(); ++i) data.p.col(i) = p.col((i + 1) % p.cols());
  try {
    FitRig(data, {}, "survey.csv");
    FAIL() << "fitted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("the row before"), HasSubstr("by one row")));
  }
}

// A lamp in place of the LED: no fault of points and no other camera's.
TEST(Slips, ACameraThatReadsTheSameOfAllPoints) {
  Observations data = TheHall().lab.Survey(80);
  Rng rng(7);
  for (Reading& r : data.readings) r.u_px = r.camera == 2 ? 700.0 + 0.02 * rng.Normal() : r.u_px;
  try {
    FitRig(data, {}, "survey.csv");
    FAIL() << "fitted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr(data.cameras[2]), HasSubstr("reads 700.0 px wherever")));
  }
}

TEST(Slips, ASurveyInMillimetresIsNotToBeUsed) {
  Observations data = TheHall().lab.Survey(100);
  data.p *= 1e3;
  for (Eigen::Matrix3d& cov : data.cov) cov *= 1e6;
  const data::Rig rig = Calibrate(data, {.order = kFullOrder}, "test").rig;
  EXPECT_EQ(rig.verdict, kDoNotUse);
  EXPECT_THAT(rig.reasons.front(), HasSubstr("millimetres under the name of metres"));
}

// A camera knocked by a tenth of its row, a displaced point, another frame by a rotation: not
// slips.
TEST(Slips, FaultsOfOtherKindsAreNone) {
  const Observations sound = TheHall().Points();
  const std::vector<std::size_t> match = {0, 1, 2, 3};
  EXPECT_FALSE(FindSlip(TheHall().rig, sound, match).found);
  Observations data = sound;
  for (Reading& r : data.readings) r.u_px += r.camera == 0 ? 216.0 : 0.0;
  EXPECT_FALSE(FindSlip(TheHall().rig, data, match).found);
  data = sound;
  data.p.col(0) += Eigen::Vector3d(0.5, 0.2, -0.4);
  EXPECT_FALSE(FindSlip(TheHall().rig, data, match).found);
  data = sound;
  const Eigen::AngleAxisd turn(0.4, Eigen::Vector3d(1.0, 2.0, 0.5).normalized());
  data.p = turn.toRotationMatrix() * data.p;  // an AngleAxis makes 3 x 3 of a product
  EXPECT_FALSE(FindSlip(TheHall().rig, data, match).found);
  EXPECT_FALSE(FindUnitSlip(TheHall().rig).found);
}

// The laboratory's own plan, without mounting errors.
data::Lab PlanOf(const std::vector<std::string>& overrides = {}) {
  return data::ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml", overrides);
}

std::string LayoutVerdict(const Observations& data, const data::Lab& lab) {
  data::Rig rig = FitRig(data, {}, "test").rig;
  rig.verdict = kGood;
  JudgeLayout(lab, &rig);
  return rig.verdict == kGood ? "" : rig.reasons.front();
}

// What a bar's wrong length does, or a station's scale: cameras put up to some millimetres tell it
// as far as they can, and blame no sound one.
TEST(LayoutScale, IsHeldAgainstThePlan) {
  const data::Lab lab = PlanOf();
  const auto called_off = [&](double scale, double knocked, std::uint64_t seed) {
    Rng rng(seed);
    data::Rig rig;
    const Eigen::AngleAxisd turn(rng.Uniform(0.0, 3.0),
                                 Eigen::Vector3d(1.0, 2.0, 0.5).normalized());
    for (const data::LabCamera& meant : lab.cameras) {
      Eigen::Vector3d place = meant.position;
      for (double& x : place) x += lab.mounting.position * rng.Normal();
      data::RigCamera camera;
      camera.name = meant.name;
      camera.p_WC = scale * (turn * place) + Eigen::Vector3d(5.0, -3.0, 1.0);
      if (rig.cameras.empty()) camera.p_WC.x() += knocked;
      rig.cameras.push_back(camera);
    }
    return CompareScale(rig, lab).off;
  };
  int false_alarms = 0, longer = 0, shorter = 0, knocked = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    false_alarms += called_off(1.0, 0.0, seed) ? 1 : 0;
    longer += called_off(1.01, 0.0, seed) ? 1 : 0;
    shorter += called_off(0.99, 0.0, seed) ? 1 : 0;
    knocked += called_off(1.0, 0.3, seed) ? 1 : 0;
  }
  EXPECT_LE(false_alarms, 2);  // 0.1% of 400
  // 1% of cameras 1.4 m from their middle is five sigmas and more, less where places happen to be
  // off otherwise.
  EXPECT_GT(longer, 300);
  EXPECT_GT(shorter, 300);
  EXPECT_LE(knocked, 4);  // one camera elsewhere is no scale
}

TEST(LayoutSlips, AreNamed) {
  const data::Lab lab = PlanOf();
  const Observations sound = TheHall().lab.Survey(60);
  EXPECT_EQ(LayoutVerdict(sound, lab), "");
  Observations data = sound;
  std::swap(data.cameras[0], data.cameras[1]);
  EXPECT_THAT(LayoutVerdict(data, lab),
              AllOf(HasSubstr("\"north_east\" are exchanged"), Not(HasSubstr("left-handed"))));
  data = sound;
  data.p *= 1e3;
  EXPECT_THAT(LayoutVerdict(data, lab), HasSubstr("millimetres under the name of metres"));
  Observations feet = sound;
  feet.p /= 0.3048;
  EXPECT_THAT(LayoutVerdict(feet, lab),
              AllOf(HasSubstr("feet under the name of metres"), HasSubstr("\"x [ft]\"")));
  data.p.row(0).swap(data.p.row(1));
  EXPECT_THAT(LayoutVerdict(data, lab),
              AllOf(HasSubstr("millimetres under the name of metres"), HasSubstr("left-handed")));
}

// Cameras that stand in no symmetry: a mirror image is no exchange of two.
TEST(LayoutSlips, AMirrorImageIsNamedFirst) {
  const data::Lab lab = PlanOf();
  Observations data = TheHall().lab.Survey(60);
  data.p.row(0).swap(data.p.row(1));
  const std::string square = LayoutVerdict(data, lab);
  EXPECT_THAT(square, ::testing::StartsWith("the survey is left-handed"));
  EXPECT_THAT(square, HasSubstr("or the readings of cameras"));  // in a square it may be that
  std::erase_if(data.readings, [](const Reading& r) { return r.camera == 3; });
  data.cameras.pop_back();
  EXPECT_THAT(LayoutVerdict(data, lab), HasSubstr("left-handed"));
}

// 0.3 mm as 0.3 m, and as 0.3 um.
TEST(Slips, StandardDeviationsInAnotherUnit) {
  Observations data = TheHall().lab.Survey(60);
  for (Eigen::Matrix3d& cov : data.cov) cov *= 1e6;
  Calibration result = Calibrate(data, {.order = kFullOrder}, "test");
  EXPECT_EQ(result.rig.verdict, kDoNotUse);
  EXPECT_THAT(result.rig.reasons,
              ::testing::Contains(HasSubstr("millimetres under the name of metres")));
  for (Eigen::Matrix3d& cov : data.cov) cov *= 1e-12;
  result = Calibrate(data, {.order = kFullOrder}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, ::testing::Contains(HasSubstr("which no station reaches")));
}

}  // namespace
}  // namespace unfurl::calib::slips_test
