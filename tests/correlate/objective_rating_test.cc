#include "correlate/compare/objective_rating.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "base/error.h"
#include "base/random.h"

namespace unfurl::correlate::objective_rating_test {
namespace {

constexpr double kRoundOff = 1e-12;  // issue: closed forms to 1e-12

std::vector<double> Pulse(std::size_t n, double middle, double height = 1.0) {
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double u = (static_cast<double>(i) - middle) / 20.0;
    x[i] = height * std::exp(-u * u);
  }
  return x;
}

TEST(ObjectiveRating, IdenticalSignalsAreExcellent) {
  const auto x = Pulse(400, 200.0);
  const ObjectiveRating r = RateObjectively(x, x);
  for (const double score : {r.corridor, r.phase, r.magnitude, r.slope, r.overall}) {
    EXPECT_NEAR(score, 1.0, kRoundOff);
  }
  EXPECT_EQ(r.grade, RatingGrade::kExcellent);
}

TEST(ObjectiveRating, AConstantApartFromAConstant) {
  // T = 1, C = 1.2: between the corridors, the diagonal is the shortest path, slopes are both zero.
  const std::vector<double> t(50, 1.0), c(50, 1.2);
  const ObjectiveRating r = RateObjectively(t, c);
  EXPECT_NEAR(r.corridor, std::pow((0.5 - 0.2) / 0.45, 2), kRoundOff);
  EXPECT_NEAR(r.phase, 1.0, kRoundOff);
  EXPECT_NEAR(r.magnitude, (0.5 - 0.2) / 0.5, kRoundOff);
  EXPECT_NEAR(r.slope, 1.0, kRoundOff);
  EXPECT_NEAR(r.overall, 0.4 * r.corridor + 0.2 + 0.2 * 0.6 + 0.2, kRoundOff);
  EXPECT_NEAR(RateObjectively(t, std::vector<double>(50, 1.04)).corridor, 1.0, kRoundOff);
  EXPECT_NEAR(RateObjectively(t, std::vector<double>(50, 1.6)).corridor, 0.0, kRoundOff);
  EXPECT_NEAR(RateObjectively(t, std::vector<double>(50, 1.6)).magnitude, 0.0, kRoundOff);
}

TEST(ObjectiveRating, APulseThatComesLateLosesPhaseOnly) {
  const ObjectiveRating late = RateObjectively(Pulse(400, 200.0), Pulse(400, 216.0));
  EXPECT_EQ(late.shift, 16);
  EXPECT_NEAR(late.phase, 1.0 - 16.0 / 80.0, kRoundOff);
  EXPECT_NEAR(late.magnitude, 1.0, kRoundOff);
  EXPECT_NEAR(late.slope, 1.0, kRoundOff);
  EXPECT_LT(late.corridor, 1.0);
  const ObjectiveRating early = RateObjectively(Pulse(400, 200.0), Pulse(400, 190.0));
  EXPECT_EQ(early.shift, -10);
  EXPECT_NEAR(early.phase, 1.0 - 10.0 / 80.0, kRoundOff);
  EXPECT_NEAR(early.magnitude, 1.0, kRoundOff);
  EXPECT_NEAR(early.slope, 1.0, kRoundOff);
}

TEST(ObjectiveRating, APulseTooLargeLosesSlopeInProportion) {
  // C = 1.3 T: every averaged slope is 1.3 times as large, so the error is 0.3 of 2.
  const ObjectiveRating r = RateObjectively(Pulse(400, 200.0), Pulse(400, 200.0, 1.3));
  EXPECT_NEAR(r.phase, 1.0, kRoundOff);
  EXPECT_NEAR(r.slope, 1.0 - 0.3 / 2.0, kRoundOff);
  double corridor = 0.0;  // the definition, written out
  for (const double v : Pulse(400, 200.0)) {
    const double e = 0.3 * v;
    corridor += e <= 0.05 ? 1.0 : std::pow((0.5 - e) / 0.45, 2);
  }
  EXPECT_NEAR(r.corridor, corridor / 400.0, kRoundOff);
}

TEST(ObjectiveRating, OfManyEqualShiftsTheSmallestIsTaken) {
  std::vector<double> t(400), c(400);
  for (std::size_t i = 0; i < t.size(); ++i) {
    t[i] = std::sin(2.0 * std::numbers::pi * static_cast<double>(i) / 40.0);
    c[i] = std::sin(2.0 * std::numbers::pi * (static_cast<double>(i) - 3.0) / 40.0);
  }
  EXPECT_EQ(RateObjectively(t, c).shift, 3);  // not 43, which fits as well
}

// Damped oscillations correlate a few periods on as they do at no shift, but for the noise.
TEST(ObjectiveRating, NoiseChoosesNoPeriod) {
  Rng rng(2);
  for (int draw = 0; draw < 20; ++draw) {
    std::vector<double> t(1000), c(1000), late(1000);
    for (std::size_t i = 0; i < t.size(); ++i) {
      const auto at = [&](double x) {
        return std::exp(-x / 800.0) * std::sin(2.0 * std::numbers::pi * x / 40.0);
      };
      c[i] = at(static_cast<double>(i));
      t[i] = c[i] + 0.002 * rng.Normal();
      late[i] = at(static_cast<double>(i) - 3.0);
    }
    const ObjectiveRating r = RateObjectively(t, c);
    EXPECT_EQ(r.shift, 0);
    EXPECT_EQ(r.grade, RatingGrade::kExcellent);
    EXPECT_EQ(RateObjectively(t, late).shift, 3);
  }
}

// What comes once is where it is, noise or not.
TEST(ObjectiveRating, NoiseHidesNoShift) {
  Rng rng(3);
  auto t = Pulse(400, 200.0), c = Pulse(400, 243.0);
  for (double& v : t) v += 0.01 * rng.Normal();
  EXPECT_NEAR(RateObjectively(t, c).shift, 43, 1);
}

// Least cost over every path there is, by trying them all.
double CheapestByTrial(const std::vector<double>& x, const std::vector<double>& y, int band) {
  const int n = static_cast<int>(x.size());
  double best = 1e300;
  std::function<void(int, int, double)> walk = [&](int i, int j, double cost) {
    if (i >= n || j >= n || std::abs(i - j) > band) return;
    const double e = x[static_cast<std::size_t>(i)] - y[static_cast<std::size_t>(j)];
    cost += e * e;
    if (i == n - 1 && j == n - 1) best = std::min(best, cost);
    walk(i + 1, j, cost);
    walk(i, j + 1, cost);
    walk(i + 1, j + 1, cost);
  };
  walk(0, 0, 0.0);
  return best;
}

TEST(WarpingPath, IsTheCheapestOfAllPaths) {
  Rng rng(3);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<double> x(8), y(8);
    for (double& v : x) v = rng.Normal();
    for (double& v : y) v = rng.Normal();
    for (int band : {0, 1, 3}) {
      const auto path = WarpingPath(x, y, band);
      ASSERT_EQ(path.front(), std::make_pair(0, 0));
      ASSERT_EQ(path.back(), std::make_pair(7, 7));
      double cost = 0.0;
      for (std::size_t k = 0; k < path.size(); ++k) {
        const auto [i, j] = path[k];
        ASSERT_LE(std::abs(i - j), band);
        if (k > 0) {
          const int di = i - path[k - 1].first, dj = j - path[k - 1].second;
          ASSERT_TRUE(di >= 0 && dj >= 0 && di <= 1 && dj <= 1 && di + dj >= 1);
        }
        const double e = x[static_cast<std::size_t>(i)] - y[static_cast<std::size_t>(j)];
        cost += e * e;
      }
      EXPECT_NEAR(cost, CheapestByTrial(x, y, band), kRoundOff);
    }
  }
}

// The whole rating a second time, straight from the definitions, on whole matrices.
ObjectiveRating Plainly(const std::vector<double>& T, const std::vector<double>& C) {
  ObjectiveRating r;
  const int n = static_cast<int>(T.size());
  auto at = [](const std::vector<double>& v, int i) { return v[static_cast<std::size_t>(i)]; };
  double norm = 0.0;
  for (double v : T) norm = std::max(norm, std::abs(v));
  for (int i = 0; i < n; ++i) {
    const double e = std::abs(at(T, i) - at(C, i)) / norm;
    r.corridor += (e < 0.05 ? 1.0 : e > 0.5 ? 0.0 : (0.5 - e) * (0.5 - e) / 0.2025) / n;
  }
  double best = -2.0;
  for (int k = 0; k <= n / 5; ++k) {
    for (int sign : {1, -1}) {
      double sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
      for (int i = 0; i < n - k; ++i) {
        const double x = at(T, sign > 0 ? i : i + k), y = at(C, sign > 0 ? i + k : i);
        sx += x, sy += y, sxx += x * x, syy += y * y, sxy += x * y;
      }
      const double m = n - k;
      const double rho = (sxy - sx * sy / m) / std::sqrt((sxx - sx * sx / m) * (syy - sy * sy / m));
      if (rho > best + 1e-9) best = rho, r.shift = sign * k;
    }
  }
  r.phase = 1.0 - std::abs(r.shift) / (0.2 * n);
  std::vector<double> t, c;
  for (int i = 0; i < n; ++i) {
    const int j = i + r.shift;
    if (j >= 0 && j < n) t.push_back(at(T, i)), c.push_back(at(C, j));
  }
  const int m = static_cast<int>(t.size()), band = static_cast<int>(std::ceil(0.1 * m)) - 1;
  std::vector<std::vector<double>> D(m, std::vector<double>(m, 1e300));
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < m; ++j) {
      if (std::abs(i - j) > band) continue;
      double before = i + j == 0 ? 0.0 : 1e300;
      if (i > 0) before = std::min(before, D[i - 1][j]);
      if (j > 0) before = std::min(before, D[i][j - 1]);
      if (i > 0 && j > 0) before = std::min(before, D[i - 1][j - 1]);
      D[i][j] = before + (at(c, i) - at(t, j)) * (at(c, i) - at(t, j));
    }
  }
  double apart = 0.0, size = 0.0;
  for (int i = m - 1, j = m - 1; i >= 0 && j >= 0;) {
    apart += std::abs(at(c, i) - at(t, j));
    size += std::abs(at(t, j));
    const double up = i > 0 ? D[i - 1][j] : 1e301, left = j > 0 ? D[i][j - 1] : 1e301;
    const double both = i > 0 && j > 0 ? D[i - 1][j - 1] : 1e301;
    if (i + j == 0) break;
    if (up <= left && up <= both) {
      --i;
    } else if (left <= both) {
      --j;
    } else {
      --i, --j;
    }
  }
  r.magnitude = std::max(0.0, 1.0 - apart / size / 0.5);
  auto slopes = [&](const std::vector<double>& v) {
    std::vector<double> d(m), s(m);
    for (int i = 0; i < m; ++i) {
      d[i] = i == 0       ? at(v, 1) - at(v, 0)
             : i == m - 1 ? at(v, m - 1) - at(v, m - 2)
                          : 0.5 * (at(v, i + 1) - at(v, i - 1));
    }
    for (int i = 0; i < m; ++i) {
      const int h = std::min({4, i, m - 1 - i});
      for (int k = -h; k <= h; ++k) s[i] += d[i + k] / (2 * h + 1);
    }
    return s;
  };
  const auto st = slopes(t), sc = slopes(c);
  apart = size = 0.0;
  for (int i = 0; i < m; ++i) apart += std::abs(st[i] - sc[i]), size += std::abs(st[i]);
  r.slope = std::max(0.0, 1.0 - apart / size / 2.0);
  r.overall = 0.4 * r.corridor + 0.2 * (r.phase + r.magnitude + r.slope);
  return r;
}

TEST(ObjectiveRating, AgreesWithTheDefinitionsWrittenOutPlainly) {
  for (int trial = 0; trial < 10; ++trial) {
    Rng rng(static_cast<std::uint64_t>(40 + trial));
    std::vector<double> T, C;
    const double late = rng.Uniform(-12.0, 12.0), factor = rng.Uniform(0.7, 1.4);
    for (int i = 0; i < 157; ++i) {
      // Of no period, so that noise has no choice.
      auto curve = [](double u) {
        return std::exp(-u / 60.0) * std::sin(u / 6.0 + u * u / 1500.0) + 0.2;
      };
      T.push_back(curve(i) + 0.02 * rng.Normal());
      C.push_back(factor * curve(i - late) + 0.02 * rng.Normal());
    }
    const ObjectiveRating a = RateObjectively(T, C), b = Plainly(T, C);
    EXPECT_EQ(a.shift, b.shift);
    EXPECT_NEAR(a.corridor, b.corridor, kRoundOff);
    EXPECT_NEAR(a.phase, b.phase, kRoundOff);
    EXPECT_NEAR(a.magnitude, b.magnitude, kRoundOff);
    EXPECT_NEAR(a.slope, b.slope, kRoundOff);
    EXPECT_NEAR(a.overall, b.overall, kRoundOff);
  }
}

TEST(ObjectiveRating, GradesByTheStandardsThresholds) {
  EXPECT_EQ(GradeOf(0.941), RatingGrade::kExcellent);
  EXPECT_EQ(GradeOf(0.94), RatingGrade::kGood);
  EXPECT_EQ(GradeOf(0.80), RatingGrade::kFair);
  EXPECT_EQ(GradeOf(0.58), RatingGrade::kPoor);
}

TEST(ObjectiveRating, TooShortIsRefused) {
  const std::vector<double> x(9, 1.0), y(12, 1.0);
  EXPECT_THROW(RateObjectively(x, x), Error);
  EXPECT_THROW(RateObjectively(y, std::vector<double>(11, 1.0)), Error);
}

}  // namespace
}  // namespace unfurl::correlate::objective_rating_test
