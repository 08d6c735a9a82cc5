#include "data/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/pose.h"
#include "base/random.h"
#include "data/h5.h"
#include "tests/own_folder.h"

namespace unfurl::data::rig_test {
namespace {

using ::testing::HasSubstr;

class RigFile : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.File(name); }

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

  OwnFolder folder_;
};

void ExpectSameCameras(const Rig& back, const Rig& rig) {
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
}

TEST_F(RigFile, ComesBackBitForBit) {
  const Rig rig = MakeRig();
  WriteRig(Path("rig.h5"), rig, {});
  const Rig back = ReadRig(Path("rig.h5"));
  ExpectSameCameras(back, rig);
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

// As version 2 was written: ten terms and 19 parameters a camera.
void WriteVersion2(const std::string& path, const Rig& rig) {
  constexpr int kTerms = 10, kParameters = 19;
  const auto c = static_cast<int>(rig.cameras.size());
  std::vector<std::string> names, lenses, terms;
  std::vector<std::int32_t> pixels;
  std::vector<double> f, u0, e, floors;
  Eigen::MatrixXd R_CW(c, 9), p_WC(c, 3), values(c, kTerms);
  Eigen::MatrixXd covariance(kParameters * c, kParameters * c);
  const std::vector<std::string> rectilinear = {"x^3", "x y^2", "x^5", "x^3 y^2", "x y^4",
                                                "x^2", "x y",   "y^2", "x^2 y",   "y^3"};
  const std::vector<std::string> fisheye = {"a^3", "a^5", "a y^2", "a^2", "a y",
                                            "y^2", "",    "",      "",    ""};
  for (int j = 0; j < c; ++j) {
    const RigCamera& camera = rig.cameras[static_cast<std::size_t>(j)];
    const bool wide = camera.lens == LensModel::kFisheye;
    names.push_back(camera.name);
    pixels.push_back(camera.pixels);
    lenses.emplace_back(wide ? "fisheye" : "rectilinear");
    const std::vector<std::string>& own = wide ? fisheye : rectilinear;
    terms.insert(terms.end(), own.begin(), own.end());
    for (int k = 0; k < 9; ++k) R_CW(j, k) = camera.R_CW(k / 3, k % 3);
    p_WC.row(j) = camera.p_WC.transpose();
    for (int k = 0; k < kTerms; ++k) values(j, k) = camera.terms_px[static_cast<std::size_t>(k)];
    f.push_back(camera.f_px);
    u0.push_back(camera.u0_px);
    e.push_back(camera.e);
    floors.push_back(FloorOf(rig, static_cast<std::size_t>(j)));
    for (int i = 0; i < c; ++i) {
      covariance.block(kParameters * j, kParameters * i, kParameters, kParameters) =
          rig.covariance.block(kCameraParameters * j, kCameraParameters * i, kParameters,
                               kParameters);
    }
  }
  H5Writer file(path, kRigSchema, 2, {});
  file.Write({"/cameras/name", "1", "cameras' names"}, names);
  file.Write({"/cameras/pixels", "1", "active pixels"}, pixels);
  file.Write({"/cameras/lens", "1", "lens models' names"}, lenses);
  file.Write({"/cameras/R_CW", "1", "rotation from world to camera"}, R_CW);
  file.Write({"/cameras/p_WC", "m", "the slit's centre in the world"}, p_WC);
  file.Write({"/cameras/f", "px", "image scale"}, f);
  file.Write({"/cameras/u0", "px", "reading on the optical axis"}, u0);
  file.Write({"/cameras/e", "m", "distance between the two centres"}, e);
  file.Write({"/cameras/terms", "px", "coefficients of the terms, camera x 10"}, values);
  file.Write({"/cameras/term_names", "1", "what each coefficient multiplies"}, terms);
  file.Write({"/covariance", "rad, m, px", "joint covariance, 19 a camera"}, covariance);
  file.Write({"/model_floor", "px", "the largest floor"}, std::vector<double>{rig.model_floor_px});
  file.Write({"/cameras/floor", "px", "added in quadrature"}, floors);
  const auto corner = [](const Eigen::Vector3d& p) {
    return std::vector<double>{p.x(), p.y(), p.z()};
  };
  file.Write({"/volume_low", "m", "least corner"}, corner(rig.volume_low));
  file.Write({"/volume_high", "m", "greatest corner"}, corner(rig.volume_high));
  file.Write({"/reasons", "1", "why"}, rig.reasons);
  file.Attribute("/", "verdict", rig.verdict);
  file.Commit();
}

// The terms that it lacks are zero, and known to be.
TEST_F(RigFile, OneOfVersion2IsRead) {
  Rig rig = MakeRig();
  for (RigCamera& camera : rig.cameras) {
    // What version 2 called fisheye had six terms.
    const std::size_t had = camera.lens == LensModel::kFisheye ? 6 : 10;
    std::fill(camera.terms_px.begin() + static_cast<std::ptrdiff_t>(had), camera.terms_px.end(),
              0.0);
  }
  for (Eigen::Index k = 0; k < rig.covariance.rows(); ++k) {
    const auto lens = rig.cameras[static_cast<std::size_t>(k / kCameraParameters)].lens;
    if (k % kCameraParameters < kFirstTerm + (lens == LensModel::kFisheye ? 6 : 10)) continue;
    rig.covariance.row(k).setZero();
    rig.covariance.col(k).setZero();
  }
  WriteVersion2(Path("old.h5"), rig);
  const Rig back = ReadRig(Path("old.h5"));
  ExpectSameCameras(back, rig);
  EXPECT_EQ(back.covariance, rig.covariance);
  EXPECT_EQ(back.verdict, rig.verdict);
  // Written again it is of this version, with the same numbers.
  WriteRig(Path("new.h5"), back, {});
  const Rig again = ReadRig(Path("new.h5"));
  EXPECT_EQ(again.covariance, rig.covariance);
  EXPECT_EQ(again.cameras[1].terms_px, rig.cameras[1].terms_px);
}

}  // namespace
}  // namespace unfurl::data::rig_test
