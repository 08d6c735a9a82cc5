#include "campaign/statistics/chaos.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/probability.h"
#include "base/random.h"
#include "base/statistics.h"
#include "campaign/statistics/chaos_basis.h"
#include "tests/campaign/functions.h"

namespace unfurl::campaign::chaos_test {
namespace {

using testing::HasSubstr;

struct Runs {
  Eigen::MatrixXd points;
  std::vector<double> values;
};

Runs RunsOf(const DesignSpec& spec, const std::function<double(std::span<const double>)>& f) {
  const Design design(spec);
  Runs runs;
  runs.points.resize(spec.dimensions, static_cast<Eigen::Index>(design.size()));
  std::vector<double> u(static_cast<std::size_t>(spec.dimensions));
  for (std::uint64_t i = 0; i < design.size(); ++i) {
    design.Point(i, u);
    runs.points.col(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(u.data(), spec.dimensions);
    runs.values.push_back(f(u));
  }
  return runs;
}

// Integrals over u by the trapezoidal rule in the normal score, which is exact to rounding.
TEST(ChaosBasisTest, PolynomialsAreOrthonormal) {
  constexpr int kDegree = 6;
  constexpr double kStep = 0.01;
  for (const ChaosBasis basis : {ChaosBasis::kLegendre, ChaosBasis::kHermite}) {
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kDegree + 1, kDegree + 1);
    Eigen::VectorXd p(kDegree + 1);
    for (double z = -8.0; z <= 8.0; z += kStep) {
      const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
      Polynomials(basis, NormalCdf(z), kDegree, p.data());
      gram += p * p.transpose() * density * kStep;
    }
    EXPECT_LT((gram - Eigen::MatrixXd::Identity(7, 7)).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(ChaosBasisTest, TermsAreThoseWithinTheNorm) {
  EXPECT_EQ(TermsOf(3, 2, 1.0, 3, 100).size(), 10u);  // (3 + 2 over 2)
  EXPECT_EQ(TermsOf(5, 3, 1.0, 5, 100).size(), 56u);
  EXPECT_EQ(TermsOf(5, 3, 1.0, 1, 100).size(), 16u);
  EXPECT_EQ(TermsOf(2, 4, 0.5, 2, 100).size(), 10u);  // 1 + 2 * 4 + one product: 1 + 1 = sqrt(4)
  EXPECT_TRUE(TermsOf(50, 4, 1.0, 3, 100).empty());
}

// A polynomial is met exactly, with no more terms than it has, and from any design.
TEST(PolynomialChaosTest, MeetsPolynomialsOfEitherBasis) {
  const auto of_u = [](std::span<const double> u) { return 3 + u[0] - 2 * u[1] * u[1] * u[2]; };
  const auto of_z = [](std::span<const double> u) {
    const double a = NormalQuantile(u[0]), b = NormalQuantile(u[3]);
    return 1 + a * b + 0.5 * b * b;
  };
  for (const DesignKind kind : {DesignKind::kRandom, DesignKind::kSobol, DesignKind::kLatin}) {
    const DesignSpec spec{.kind = kind, .runs = 200, .dimensions = 4};
    const Runs a = RunsOf(spec, of_u), b = RunsOf(spec, of_z);
    const PolynomialChaos u = PolynomialChaos::Fit(a.points, a.values);
    EXPECT_EQ(u.basis(), ChaosBasis::kLegendre);
    EXPECT_LT(u.terms().size(), 12u);
    EXPECT_GT(u.q2_lower(), 1.0 - 1e-9);
    EXPECT_NEAR(u.Predict(std::vector<double>{0.1, 0.9, 0.3, 0.5}), 3.1 - 2 * 0.81 * 0.3, 1e-9);
    const PolynomialChaos z = PolynomialChaos::Fit(b.points, b.values);
    EXPECT_EQ(z.basis(), ChaosBasis::kHermite);
    EXPECT_TRUE(z.usable());
    EXPECT_NEAR(z.mean(), 1.5, 1e-9);
    EXPECT_NEAR(z.variance(), 1.5, 1e-9);          // 1 of a b, 0.5 of b^2 / 2
    EXPECT_NEAR(z.indices()[0].first, 0.0, 1e-9);  // a alone does nothing
    EXPECT_NEAR(z.indices()[0].total, 2.0 / 3, 1e-9);
    EXPECT_NEAR(z.indices()[3].first, 1.0 / 3, 1e-9);
    EXPECT_NEAR(z.indices()[1].total, 0.0, 1e-9);
  }
}

class ChaosOf : public testing::TestWithParam<TestFunction> {};
INSTANTIATE_TEST_SUITE_P(All, ChaosOf, testing::Values(Ishigami(), GFunction()),
                         [](const auto& the) { return the.param.name; });

TEST_P(ChaosOf, IndicesEqualTheirClosedForms) {
  const TestFunction& f = GetParam();
  const Runs runs =
      RunsOf({.kind = DesignKind::kSobol, .runs = 1000, .dimensions = f.dimensions}, f.f);
  const PolynomialChaos chaos = PolynomialChaos::Fit(runs.points, runs.values);
  EXPECT_TRUE(chaos.usable());
  // Smooth functions are met; those with kinks, as |4 u - 2|, to some percent.
  EXPECT_GT(chaos.q2(), f.name == "ishigami" ? 0.999 : 0.95);
  for (std::size_t k = 0; k < f.first.size(); ++k) {
    const ChaosIndex& i = chaos.indices()[k];
    EXPECT_NEAR(i.first, f.first[k], 3 * i.first_error) << k;
    EXPECT_NEAR(i.total, f.total[k], 3 * i.total_error) << k;
    EXPECT_LT(i.total_error, 0.06);
  }
  EXPECT_NEAR(chaos.mean(), f.mean, 0.02 * std::sqrt(f.variance));
  // What q2 says is what holds for points that no fit has seen.
  const Runs fresh = RunsOf({.runs = 4000, .seed = 77, .dimensions = f.dimensions}, f.f);
  double left = 0.0;
  for (Eigen::Index i = 0; i < 4000; ++i) {
    const Eigen::VectorXd u = fresh.points.col(i);
    left += std::pow(chaos.Predict({u.data(), static_cast<std::size_t>(u.size())}) -
                         fresh.values[static_cast<std::size_t>(i)],
                     2.0) /
            4000;
  }
  const double told = 1.0 - chaos.q2();
  EXPECT_LT(left / f.variance, 1.5 * told);  // folds have a fifth of the runs less: told is more
  EXPECT_GT(left / f.variance, 0.2 * told);
}

// Noise is not explained: neither with many candidates nor by leave-one-out.
TEST(PolynomialChaosTest, SaysWhenThereIsNothingToFit) {
  Rng rng(1);
  for (const std::uint64_t runs : {40, 400}) {
    Runs noise = RunsOf({.runs = runs, .dimensions = 6},
                        [&](std::span<const double>) { return rng.Normal(); });
    const PolynomialChaos chaos = PolynomialChaos::Fit(noise.points, noise.values);
    EXPECT_FALSE(chaos.usable());
    EXPECT_LT(chaos.q2(), 0.2);
    EXPECT_THAT(chaos.notes().back(), HasSubstr("not usable"));
  }
  const Runs few = RunsOf({.runs = 19, .dimensions = 3}, Ishigami().f);
  EXPECT_THAT(PolynomialChaos::Fit(few.points, few.values).notes().back(), HasSubstr("19 runs"));
  const Runs flat =
      RunsOf({.runs = 50, .dimensions = 3}, [](std::span<const double>) { return 2.0; });
  EXPECT_FALSE(PolynomialChaos::Fit(flat.points, flat.values).usable());
}

// On a grid a polynomial may be exact and yet wrong everywhere else: Ishigami's sine has one value
// at all of four levels. No fold of the grid tells; the judge does.
TEST(PolynomialChaosTest, IsNotTakenInByAGrid) {
  for (const DesignSpec& spec :
       {DesignSpec{.kind = DesignKind::kGrid, .dimensions = 3, .levels = {5}},
        DesignSpec{.kind = DesignKind::kMorris, .runs = 400, .dimensions = 3}}) {
    const Runs runs = RunsOf(spec, Ishigami().f);
    const PolynomialChaos chaos = PolynomialChaos::Fit(runs.points, runs.values);
    EXPECT_FALSE(chaos.usable());
    EXPECT_THAT(chaos.notes().back(), HasSubstr("values of input 1"));
  }
}

TEST(PolynomialChaosTest, KnowsNoUnits) {
  const Runs runs = RunsOf({.runs = 200, .dimensions = 3}, Ishigami().f);
  const PolynomialChaos one = PolynomialChaos::Fit(runs.points, runs.values);
  for (const double unit : {1e-100, 1e100}) {
    std::vector<double> values;
    for (double v : runs.values) values.push_back(unit * v);
    const PolynomialChaos other = PolynomialChaos::Fit(runs.points, values);
    EXPECT_EQ(other.usable(), one.usable());
    EXPECT_NEAR(other.q2(), one.q2(), 1e-6);
    EXPECT_NEAR(other.mean() / unit, one.mean(), 1e-6);
    EXPECT_NEAR(other.indices()[1].total, one.indices()[1].total, 1e-6);
  }
}

TEST(PolynomialChaosTest, LeavesFailedRunsOutAndRefusesBadInput) {
  Runs runs =
      RunsOf({.runs = 300, .dimensions = 3}, [](std::span<const double> u) { return u[0]; });
  runs.values[5] = runs.values[6] = std::nan("");
  const PolynomialChaos chaos = PolynomialChaos::Fit(runs.points, runs.values);
  EXPECT_EQ(chaos.failed(), 2u);
  EXPECT_EQ(chaos.runs(), 298u);
  EXPECT_TRUE(chaos.usable());
  EXPECT_THAT(chaos.notes().at(0), HasSubstr("2 runs failed"));
  EXPECT_THROW(chaos.Predict(std::vector<double>{0.5}), Error);
  EXPECT_THROW(PolynomialChaos::Fit(runs.points, std::vector<double>(3)), Error);
  runs.points(0, 0) = 1.5;
  EXPECT_THROW(PolynomialChaos::Fit(runs.points, runs.values), Error);
}

}  // namespace
}  // namespace unfurl::campaign::chaos_test
