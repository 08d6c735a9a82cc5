#include "correlate/hierarchy/hierarchy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/dense.h"
#include "base/error.h"
#include "base/random.h"
#include "base/statistics.h"
#include "tests/correlate/campaigns.h"
#include "tests/repeats.h"

namespace unfurl::correlate::hierarchy_test {
namespace {

// Three parameters, of which two scatter together, seen with correlated errors.
struct Structure {
  Eigen::Vector3d mean{1.0, -2.0, 5.0};
  Eigen::Matrix3d scatter;  // its square root
  Eigen::Matrix3d own;      // square root of a trial's covariance
  Structure() {
    scatter << 1.0, 0.0, 0.0, 0.8, 0.6, 0.0, 0.0, 0.0, 0.0;
    own << 0.5, 0.0, 0.0, 0.1, 0.4, 0.0, 0.35, -0.2, 0.3;
  }
  static Eigen::Vector3d Normals(Rng& rng) { return {rng.Normal(), rng.Normal(), rng.Normal()}; }

  HierarchyProblem Campaign(Eigen::Index trials, Rng& rng) const {
    HierarchyProblem problem;
    problem.shared = Eigen::Matrix3d::Zero();
    for (Eigen::Index i = 0; i < trials; ++i) {
      const double factor = 1.0 + 0.2 * static_cast<double>(i % 3);  // errors are not all equal
      problem.trials.push_back({"trial " + std::to_string(i + 1),
                                mean + scatter * Normals(rng) + factor * own * Normals(rng),
                                factor * factor * own * own.transpose()});
    }
    return problem;
  }
};

TEST(Hierarchy, TakesEachParameterByItself) {
  Rng rng(3);
  const HierarchyProblem problem = Structure().Campaign(8, rng);
  const Hierarchy all(problem);
  for (Eigen::Index j = 0; j < 3; ++j) {
    Eigen::VectorXd y(8), v(8);
    for (Eigen::Index i = 0; i < 8; ++i) {
      const TrialEstimate& t = problem.trials[static_cast<std::size_t>(i)];
      y(i) = t.value(j), v(i) = t.covariance(j, j);
    }
    const RandomEffect one(y, v, 0.0, ScatterLevels(8));
    const ParameterScatter& p = all.parameters()[static_cast<std::size_t>(j)];
    EXPECT_DOUBLE_EQ(p.value, one.Value());
    EXPECT_DOUBLE_EQ(p.scatter, one.Scatter());
    EXPECT_DOUBLE_EQ(p.scatter95.high, one.Scatter95().high);
    EXPECT_DOUBLE_EQ(p.next95.low, one.Next().Middle95().low);
    EXPECT_DOUBLE_EQ(p.effect[3], one.Effect(3).Mean());
    EXPECT_DOUBLE_EQ(p.left_out[5].p, LeaveOneOut(y, v)[5].p);
    EXPECT_NEAR(all.covariance()(j, j), p.sigma * p.sigma, 1e-12);
  }
  EXPECT_GT(all.covariance()(0, 1), 0.0);  // that scatter together
}

// A combination of parameters that scatter together is covered as each of them is.
TEST(Hierarchy, CoversACombination) {
  const auto campaigns = static_cast<std::size_t>(Repeats(250, 1000));
  Rng rng(5);
  const Structure s;
  const Eigen::Vector3d direction(0.7, 1.1, -0.4);
  std::size_t next = 0, sample = 0, mean = 0;
  for (std::size_t k = 0; k < campaigns; ++k) {
    const Hierarchy h(s.Campaign(8, rng));
    const double truth = direction.dot(s.mean + s.scatter * Structure::Normals(rng));
    const Interval path = h.NextAlong(direction), noisy = h.NextAlong(direction, 0.25);
    const double shown = truth + 0.5 * rng.Normal();
    next += path.low < truth && truth < path.high;
    sample += noisy.low < shown && shown < noisy.high;
    mean += Inside(h.Along(direction).Mean(), direction.dot(s.mean));
  }
  ExpectWithin(next, campaigns, 0.93, 0.97);
  ExpectWithin(sample, campaigns, 0.93, 0.97);
  ExpectWithin(mean, campaigns, 0.93, 0.97);
}

// Told which parameter has one value, the others are known better, and all are covered.
TEST(Hierarchy, HoldsWhatHasOneValue) {
  const auto campaigns = static_cast<std::size_t>(Repeats(250, 1000));
  Rng rng(7);
  const Structure s;
  std::size_t common = 0, scattering = 0, next = 0;
  double own_held = 0.0, own_free = 0.0;
  for (std::size_t k = 0; k < campaigns; ++k) {
    HierarchyProblem problem = s.Campaign(5, rng);
    if (k == 0) own_free = Hierarchy(problem).parameters()[0].own[0];
    problem.scatters = {true, true, false};
    const Hierarchy h(problem);
    const ParameterScatter &a = h.parameters()[0], &c = h.parameters()[2];
    own_held = a.own[0];
    EXPECT_FALSE(c.scatters);
    common += c.mean95.low < s.mean(2) && s.mean(2) < c.mean95.high;
    scattering += a.mean95.low < s.mean(0) && s.mean(0) < a.mean95.high;
    const double truth = s.mean(0) + (s.scatter * Structure::Normals(rng))(0);
    next += a.next95.low < truth && truth < a.next95.high;
  }
  EXPECT_LT(own_held, 0.95 * own_free);
  ExpectWithin(common, campaigns, 0.95, 0.95);
  ExpectWithin(scattering, campaigns, 0.93, 0.97);
  ExpectWithin(next, campaigns, 0.93, 0.97);
}

// Where no parameter scatters the mean is the generalised least-squares one.
TEST(Hierarchy, OfOneValueIsLeastSquares) {
  Rng rng(11);
  HierarchyProblem problem = Structure().Campaign(4, rng);
  problem.scatters = {false, false, false};
  const Hierarchy h(problem);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d pull = Eigen::Vector3d::Zero();
  for (const TrialEstimate& t : problem.trials) {
    const Eigen::Matrix3d inverse = t.covariance.inverse();
    information += inverse;
    pull += inverse * t.value;
  }
  const Eigen::Matrix3d covariance = information.inverse();
  EXPECT_TRUE(h.covariance().isApprox(covariance, 1e-9));
  for (Eigen::Index j = 0; j < 3; ++j) {
    EXPECT_NEAR(h.parameters()[static_cast<std::size_t>(j)].value, (covariance * pull)(j), 1e-10);
  }
  const Eigen::Vector3d d(1.0, 2.0, 3.0);
  const Interval next = h.NextAlong(d);
  EXPECT_NEAR(next.high - next.low, 2.0 * kHalf95 * std::sqrt(d.dot(covariance * d)), 1e-9);
  const Interval nothing = h.NextAlong(Eigen::Vector3d::Zero());
  EXPECT_EQ(nothing.low, 0.0);
  EXPECT_EQ(nothing.high, 0.0);
}

// Trials that are alike say so: the joint probability is uniform. Kolmogorov's test at 0.1%.
TEST(Hierarchy, TestsWhetherTrialsAreAlike) {
  const auto campaigns = static_cast<std::size_t>(Repeats(250, 1000));
  Rng rng(13);
  Structure s;
  s.scatter.setZero();
  std::vector<double> p;
  for (std::size_t k = 0; k < campaigns; ++k) {
    const Hierarchy h(s.Campaign(3, rng));
    EXPECT_EQ(h.freedom(), 6.0);
    p.push_back(h.alike_p());
  }
  std::sort(p.begin(), p.end());
  double largest = 0.0;
  for (std::size_t k = 0; k < campaigns; ++k) {
    const auto n = static_cast<double>(campaigns);
    const auto at = static_cast<double>(k);
    largest = std::max({largest, std::abs(p[k] - at / n), std::abs(p[k] - (at + 1.0) / n)});
  }
  EXPECT_LT(largest * std::sqrt(static_cast<double>(campaigns)), 1.95);
}

TEST(Hierarchy, NamesTheTrialThatIsUnlike) {
  Rng rng(17);
  HierarchyProblem problem = Structure().Campaign(8, rng);
  problem.trials[4].value += Eigen::Vector3d(0.0, 30.0, 0.0);
  const std::vector<double> p = Hierarchy(problem).unlike_p();
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (i == 4) {
      EXPECT_LT(p[i], 1e-3);
    } else {
      EXPECT_GT(p[i], 0.05 / 8.0);
    }
  }
}

TEST(Hierarchy, RefusesWhatItCannotUse) {
  Rng rng(19);
  const HierarchyProblem good = Structure().Campaign(3, rng);
  HierarchyProblem bad = good;
  bad.trials.pop_back();
  EXPECT_THROW(Hierarchy{bad}, Error);
  bad = good;
  bad.trials[1].covariance(0, 0) = -1.0;
  EXPECT_THROW(Hierarchy{bad}, Error);
  bad = good;
  bad.trials[2].value(1) = std::nan("");
  EXPECT_THROW(Hierarchy{bad}, Error);
  bad = good;
  bad.shared = Eigen::Matrix2d::Identity();
  EXPECT_THROW(Hierarchy{bad}, Error);
  bad = good;
  bad.scatters = {true};
  EXPECT_THROW(Hierarchy{bad}, Error);
}

}  // namespace
}  // namespace unfurl::correlate::hierarchy_test
