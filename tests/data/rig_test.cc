#include "data/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "base/pose.h"
#include "base/random.h"
#include "data/h5.h"

namespace unfurl::data {
namespace {

using ::testing::HasSubstr;

class RigFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              (std::string("unfurl_rig_") + info->name() + "_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  static Rig MakeRig() {
    Rng rng(11);
    Rig rig;
    for (int j = 0; j < 3; ++j) {
      RigCamera camera;
      camera.name = "camera " + std::to_string(j);
      camera.pixels = 2048 + 1000 * j;
      camera.lens = j == 1 ? LensModel::kFisheye : LensModel::kRectilinear;
      camera.R_CW = RotationFromVector({rng.Normal(), rng.Normal(), rng.Normal()});
      camera.p_WC = {rng.Normal(), rng.Normal(), rng.Normal()};
      camera.f_px = 2200.0 + rng.Normal();
      camera.u0_px = 1080.0 + rng.Normal();
      camera.e = 0.03;
      for (double& term : camera.terms_px) term = 100.0 * rng.Normal();
      rig.cameras.push_back(camera);
    }
    Eigen::MatrixXd half(3 * kCameraParameters, 3 * kCameraParameters);
    for (Eigen::Index i = 0; i < half.size(); ++i) half.data()[i] = rng.Normal();
    rig.covariance = half * half.transpose();
    rig.covariance.row(8).setZero();  // held fixed
    rig.covariance.col(8).setZero();
    rig.model_floor_px = 0.025;
    rig.volume_low = {-1.0, -1.1, -1.2};
    rig.volume_high = {1.3, 1.4, 1.5};
    rig.checks = {{"held_out_rms [m]", 2.5e-4}, {"chi_square_per_dof [1]", 1.02}};
    rig.verdict = "usable with care";
    rig.reasons = {"one", "two"};
    return rig;
  }

  // The refusal of a file made from `rig`, or "" when it is accepted.
  std::string Refusal(const Rig& rig) const {
    WriteRig(Path("bad.h5"), rig, {});
    try {
      ReadRig(Path("bad.h5"));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
};

TEST_F(RigFile, ComesBackBitForBit) {
  const Rig rig = MakeRig();
  WriteRig(Path("rig.h5"), rig, {});
  const Rig back = ReadRig(Path("rig.h5"));
  ASSERT_EQ(back.cameras.size(), rig.cameras.size());
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    EXPECT_EQ(back.cameras[j].name, rig.cameras[j].name);
    EXPECT_EQ(back.cameras[j].pixels, rig.cameras[j].pixels);
    EXPECT_EQ(back.cameras[j].lens, rig.cameras[j].lens);
    EXPECT_EQ(back.cameras[j].R_CW, rig.cameras[j].R_CW);
    EXPECT_EQ(back.cameras[j].p_WC, rig.cameras[j].p_WC);
    EXPECT_EQ(back.cameras[j].f_px, rig.cameras[j].f_px);
    EXPECT_EQ(back.cameras[j].u0_px, rig.cameras[j].u0_px);
    EXPECT_EQ(back.cameras[j].e, rig.cameras[j].e);
    EXPECT_EQ(back.cameras[j].terms_px, rig.cameras[j].terms_px);
  }
  EXPECT_EQ(back.covariance, rig.covariance);
  EXPECT_EQ(back.model_floor_px, rig.model_floor_px);
  EXPECT_EQ(back.volume_low, rig.volume_low);
  EXPECT_EQ(back.volume_high, rig.volume_high);
  EXPECT_EQ(back.checks, rig.checks);
  EXPECT_EQ(back.verdict, rig.verdict);
  EXPECT_EQ(back.reasons, rig.reasons);
}

TEST_F(RigFile, EveryNumberCarriesItsUnit) {
  WriteRig(Path("rig.h5"), MakeRig(), {});
  const H5Reader file(Path("rig.h5"), kRigSchema, kRigVersion);
  EXPECT_EQ(file.Units("/cameras/p_WC"), "m");
  EXPECT_EQ(file.Units("/cameras/f"), "px");
  EXPECT_EQ(file.Units("/checks/held_out_rms"), "m");
  EXPECT_EQ(file.Units("/checks/chi_square_per_dof"), "1");
}

TEST_F(RigFile, RefusesWhatIsNoRig) {
  EXPECT_EQ(Refusal(MakeRig()), "");
  Rig rig = MakeRig();
  rig.cameras[2].pixels = 0;
  EXPECT_THAT(Refusal(rig), HasSubstr("/cameras/pixels"));
  rig = MakeRig();
  rig.cameras[1].R_CW = -rig.cameras[1].R_CW;
  EXPECT_THAT(Refusal(rig), HasSubstr("camera \"camera 1\" has no proper rotation"));
  rig = MakeRig();
  rig.covariance(3, 3) = -1.0;
  EXPECT_THAT(Refusal(rig), HasSubstr("positive semidefinite"));
  rig = MakeRig();
  rig.covariance(0, 1) += 10.0;
  EXPECT_THAT(Refusal(rig), HasSubstr("symmetric"));
  rig = MakeRig();
  rig.covariance.conservativeResize(38, 38);
  EXPECT_THAT(Refusal(rig), HasSubstr("93 x 93"));
  rig = MakeRig();
  rig.cameras[0].f_px = std::nan("");
  EXPECT_THAT(Refusal(rig), HasSubstr("/cameras/f"));
  rig = MakeRig();
  rig.model_floor_px = -0.1;
  EXPECT_THAT(Refusal(rig), HasSubstr("/model_floor"));
  rig = MakeRig();
  rig.volume_high = rig.volume_low;
  EXPECT_THAT(Refusal(rig), HasSubstr("/volume_high"));
}

// Nothing in a rig of version 1 says where its rows end.
TEST_F(RigFile, AnOlderOneIsRefused) {
  {
    H5Writer file(Path("old.h5"), kRigSchema, 1, {});
    file.Write({"/cameras/name", "1", "cameras' names"}, std::vector<std::string>{"a"});
    file.Commit();
  }
  try {
    ReadRig(Path("old.h5"));
    FAIL() << "was read";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("how many pixels"));
    EXPECT_THAT(error.what(), HasSubstr("calibrate again"));
  }
}

}  // namespace
}  // namespace unfurl::data
