#include "measure/lens/lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/pose.h"
#include "base/random_vector.h"
#include "measure/camera_bank.h"
#include "measure/camera_model.h"

namespace unfurl::measure::lens_test {
namespace {

using Terms = std::array<double, data::kLensTerms>;

Terms RandomTerms(Rng* rng) {
  Terms terms;
  for (double& t : terms) t = 100.0 * rng->Normal();
  return terms;
}

// A term's value by its name: "a^3", "x^3 y^2".
double ValueOfName(const std::string& name, double x, double y) {
  double value = 1.0;
  for (std::size_t at = 0; at < name.size(); ++at) {
    if (name[at] == ' ') continue;
    const double base = name[at] == 'x' ? x : name[at] == 'a' ? std::atan(x) : y;
    int power = 1;
    if (at + 2 < name.size() && name[at + 1] == '^') {
      power = name[at + 2] - '0';
      at += 2;
    }
    value *= std::pow(base, power);
  }
  return value;
}

TEST(Lens, DerivativesAreThoseOfTheValue) {
  // Central differences: their own error is h^2 of third derivatives, 1e-5 of values near 1000.
  constexpr double h = 1e-4, kTolerance = 3e-3;
  Rng rng(7);
  for (const data::LensNames& lens : data::kLensModels) {
    for (int trial = 0; trial < 30; ++trial) {
      const double x = rng.Uniform(-1.5, 1.5), y = rng.Uniform(-0.8, 0.8), f = 1500.0;
      const Terms terms = RandomTerms(&rng);
      const auto u = [&](double at_x, double at_y, double at_f, const Terms& t) {
        return EvaluateLens(lens.model, at_x, at_y, at_f, t.data()).u_px;
      };
      const LensImage image = EvaluateLens(lens.model, x, y, f, terms.data());
      EXPECT_NEAR(image.du_dx, (u(x + h, y, f, terms) - u(x - h, y, f, terms)) / (2.0 * h),
                  kTolerance);
      EXPECT_NEAR(image.du_dy, (u(x, y + h, f, terms) - u(x, y - h, f, terms)) / (2.0 * h),
                  kTolerance);
      EXPECT_NEAR(image.du_df, u(x, y, f + 0.5, terms) - u(x, y, f - 0.5, terms), 1e-9);
      for (std::size_t k = 0; k < terms.size(); ++k) {
        Terms more = terms;
        more[k] += 1.0;
        EXPECT_NEAR(image.du_dt[k], u(x, y, f, more) - u(x, y, f, terms), 1e-9) << lens.name << k;
      }
    }
  }
}

TEST(Lens, TermsAreWhatTheirNamesSay) {
  Rng rng(8);
  const Terms none{};
  for (const data::LensNames& lens : data::kLensModels) {
    for (int trial = 0; trial < 10; ++trial) {
      const double x = rng.Uniform(-1.5, 1.5), y = rng.Uniform(-0.8, 0.8);
      const LensImage image = EvaluateLens(lens.model, x, y, 1.0, none.data());
      for (std::size_t k = 0; k < data::kLensTerms; ++k) {
        const std::string name = lens.terms[k];
        EXPECT_NEAR(image.du_dt[k], name.empty() ? 0.0 : ValueOfName(name, x, y), 1e-12)
            << lens.name << ": " << name;
        EXPECT_EQ(PriorOf(lens.model)[k] > 0.0, !name.empty()) << lens.name << ": " << name;
      }
    }
  }
}

TEST(Lens, OrdersGrowToTheWhole) {
  for (const data::LensNames& lens : data::kLensModels) {
    const auto orders = OrdersOf(lens.model);
    ASSERT_GE(orders.size(), 2U);
    for (std::size_t k = 0; k < data::kLensTerms; ++k) {
      EXPECT_EQ(orders.back().terms[k], lens.terms[k][0] != '\0');
      EXPECT_FALSE(orders.front().terms[k]);
    }
  }
}

// Kannala and Brandt (2006), eq. (6), by the angle between ray and optical axis itself.
TEST(Lens, FisheyeIsAPolynomialOfTheAngle) {
  const double f = 800.0, k1 = -30.0, k2 = 4.0;
  Terms terms{};
  terms[0] = k1;
  terms[1] = k2;
  for (double degrees = -80.0; degrees <= 80.0; degrees += 5.0) {
    const Eigen::Vector3d ray =
        Eigen::AngleAxisd(degrees * M_PI / 180.0, Eigen::Vector3d::UnitY()) *
        Eigen::Vector3d::UnitZ();
    const double angle = std::copysign(std::acos(ray.z()), ray.x());
    const double u =
        EvaluateLens(data::LensModel::kFisheye, ray.x() / ray.z(), 0.3, f, terms.data()).u_px;
    // acos loses half of its digits near the axis.
    EXPECT_NEAR(u, f * angle + k1 * std::pow(angle, 3) + k2 * std::pow(angle, 5), 1e-5);
  }
}

TEST(Lens, StraighteningUndoesTheIdealLens) {
  const Terms none{};
  for (const data::LensNames& lens : data::kLensModels) {
    for (double x = -3.0; x <= 3.0; x += 0.25) {
      const double image = EvaluateLens(lens.model, x, 0.4, 700.0, none.data()).u_px;
      EXPECT_NEAR(Straighten(lens.model, image / 700.0), x, 1e-12);
    }
  }
}

// A rig of unlike lenses: the bank's sums are those of Project, camera by camera.
TEST(Lens, TheBankHoldsUnlikeLenses) {
  Rng rng(5);
  std::vector<data::RigCamera> cameras;
  for (int j = 0; j < 6; ++j) {
    data::RigCamera camera;
    camera.lens = j % 3 == 1 ? data::LensModel::kFisheye : data::LensModel::kRectilinear;
    camera.R_CW = RotationFromVector({0.3 * rng.Normal(), 0.3 * rng.Normal(), 6.0 * rng.Normal()});
    camera.p_WC = {rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), -3.0};
    camera.f_px = 1500.0;
    camera.u0_px = 1000.0;
    camera.e = 0.03;
    camera.terms_px = RandomTerms(&rng);
    cameras.push_back(camera);
  }
  const CameraBank bank(cameras);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d p = UniformVector(&rng, -1, 1);
    std::vector<double> u(bank.lanes(), 0.0), w(bank.lanes(), 0.0), read(bank.lanes());
    Eigen::Matrix3d JwJ = Eigen::Matrix3d::Zero();
    Eigen::Vector3d Jwr = Eigen::Vector3d::Zero();
    double chi_square = 0.0;
    bank.Readings(p.data(), read.data());
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      Projection at;
      ASSERT_TRUE(Project(cameras[c], p, &at));
      EXPECT_NEAR(read[c], at.u_px, 1e-9);
      u[c] = at.u_px + rng.Normal();
      w[c] = c == 2 ? 0.0 : 1.0 + static_cast<double>(c);
      JwJ += w[c] * at.du_dp.transpose() * at.du_dp;
      Jwr += w[c] * (u[c] - at.u_px) * at.du_dp.transpose();
      chi_square += w[c] * (u[c] - at.u_px) * (u[c] - at.u_px);
    }
    CameraBank::Sums sums;
    bank.Accumulate(p.data(), u.data(), w.data(), &sums);
    EXPECT_TRUE(sums.in_front);
    const double size = JwJ.norm();
    EXPECT_NEAR(sums.JwJ[0], JwJ(0, 0), 1e-11 * size);
    EXPECT_NEAR(sums.JwJ[4], JwJ(1, 2), 1e-11 * size);
    EXPECT_NEAR(sums.Jwr[1], Jwr(1), 1e-8 * std::sqrt(size));
    EXPECT_NEAR(sums.chi_square, chi_square, 1e-8);
  }
}

}  // namespace
}  // namespace unfurl::measure::lens_test
