#include "sim/effects/moment_table.h"

#include <gtest/gtest.h>

#include <cmath>

namespace unfurl::sim::moment_table_test {
namespace {

MomentTable TableOf(const std::vector<double>& points, const std::vector<double>& moments) {
  data::SceneMomentTable record;
  record.coordinate = points;
  record.moment = moments;
  return MomentTable(record);
}

// A tape spring: a steep rise, a peak, a long plateau.
const std::vector<double> kAngle = {-0.5, -0.1, 0.0, 0.05, 0.1, 0.3, 1.5, 3.0};
const std::vector<double> kMoment = {0.2, 0.2, 0.0, -1.2, -1.5, -0.4, -0.35, -0.35};

TEST(MomentTable, GoThroughTheirPointsWithoutBulges) {
  const MomentTable tables = TableOf(kAngle, kMoment);
  for (std::size_t k = 0; k < kAngle.size(); ++k) {
    EXPECT_NEAR(tables.At(kAngle[k]).moment, kMoment[k], 1e-15);
    if (k + 1 == kAngle.size()) break;
    const double low = std::min(kMoment[k], kMoment[k + 1]);
    const double high = std::max(kMoment[k], kMoment[k + 1]);
    double last = kMoment[k];
    const double direction = kMoment[k + 1] - kMoment[k];
    for (int i = 1; i <= 100; ++i) {
      const double q = kAngle[k] + (kAngle[k + 1] - kAngle[k]) * i / 100;
      const double moment = tables.At(q).moment;
      EXPECT_GE(moment, low - 1e-14);
      EXPECT_LE(moment, high + 1e-14);
      EXPECT_GE((moment - last) * direction, -1e-14);
      last = moment;
    }
  }
}

TEST(MomentTable, SlopeAndPotentialBelongToTheMoment) {
  const MomentTable tables = TableOf(kAngle, kMoment);
  constexpr double h = 1e-6;
  for (double q = -1.0; q < 4.0; q += 0.0371) {
    const auto up = tables.At(q + h), down = tables.At(q - h), here = tables.At(q);
    EXPECT_NEAR((up.potential - down.potential) / (2 * h), -here.moment, 1e-8) << q;
    EXPECT_NEAR((up.moment - down.moment) / (2 * h), here.slope, 2e-4) << q;
  }
  // The slope has no jumps, and the potential begins at zero.
  for (const double q : kAngle) {
    EXPECT_NEAR(tables.At(q + 1e-12).slope, tables.At(q - 1e-12).slope, 1e-7) << q;
  }
  EXPECT_EQ(tables.At(kAngle.front()).potential, 0.0);
}

TEST(MomentTable, GoOnStraightBeyondTheEnds) {
  const MomentTable tables = TableOf({0.0, 1.0, 2.0}, {0.0, 1.0, 4.0});
  for (const double end : {0.0, 2.0}) {
    const auto at = tables.At(end);
    const double out = end == 0.0 ? -1.0 : 1.0;
    EXPECT_NEAR(tables.At(end + 3 * out).moment, at.moment + 3 * out * at.slope, 1e-14);
    EXPECT_EQ(tables.At(end + 3 * out).slope, at.slope);
  }
}

// Straight lines are kept; a parabola is met to the third order of the spacing inside.
TEST(MomentTable, FollowSmoothCurves) {
  const MomentTable line = TableOf({0.0, 0.3, 1.0, 1.1}, {1.0, 0.4, -1.0, -1.2});
  for (double q = -1.0; q < 2.0; q += 0.1) EXPECT_NEAR(line.At(q).moment, 1.0 - 2.0 * q, 1e-14);
  double last = 0.0;
  for (const int n : {10, 20, 40}) {
    std::vector<double> x, y;
    for (int k = 0; k <= n; ++k) {
      x.push_back(1.0 + static_cast<double>(k) / n);
      y.push_back(std::exp(x.back()));
    }
    const MomentTable curve = TableOf(x, y);
    double worst = 0.0;
    for (double q = 1.3; q < 1.7; q += 0.001) {
      worst = std::max(worst, std::fabs(curve.At(q).moment - std::exp(q)));
    }
    if (last > 0.0) {
      EXPECT_GT(std::log2(last / worst), 2.7);
      EXPECT_LT(std::log2(last / worst), 3.3);
    }
    last = worst;
  }
}

// At the ends the slope is that of the parabola through three points, so of a parabola its own,
// whatever the spacing.
TEST(MomentTable, EndsFollowAParabola) {
  const std::vector<double> x = {0.5, 0.8, 1.7, 1.9, 3.0};
  for (const double side : {1.0, -1.0}) {  // the same from its other end
    std::vector<double> q, moment;
    for (std::size_t k = 0; k < x.size(); ++k)
      q.push_back(side > 0.0 ? x[k] : -x[x.size() - 1 - k]);
    for (const double at : q) moment.push_back(3.0 + 2.0 * side * at + 0.7 * at * at);
    const MomentTable table = TableOf(q, moment);
    for (const double end : {q.front(), q.back()}) {
      EXPECT_NEAR(table.At(end).slope, 2.0 * side + 1.4 * end, 1e-13);
    }
  }
}

// Inside, Fritsch and Butland's formula as Brodlie writes it: with a = (h + 2 h') / (3 (h + h')), h
// before and h' after the point, the slope is c c' / (a c' + (1 - a) c). Zero where the chords c,
// c' turn.
TEST(MomentTable, SlopesInsideAreTheWeightedHarmonicMean) {
  const std::vector<double> x = {0.0, 0.3, 1.0, 1.1, 2.0, 2.2}, y = {0.0, 0.2, 1.5, 1.6, 1.2, -0.9};
  const MomentTable table = TableOf(x, y);
  for (std::size_t k = 1; k + 1 < x.size(); ++k) {
    const double h0 = x[k] - x[k - 1], h1 = x[k + 1] - x[k];
    const double c0 = (y[k] - y[k - 1]) / h0, c1 = (y[k + 1] - y[k]) / h1;
    const double a = (h0 + 2.0 * h1) / (3.0 * (h0 + h1));
    const double slope = c0 * c1 > 0.0 ? c0 * c1 / (a * c1 + (1.0 - a) * c0) : 0.0;
    EXPECT_NEAR(table.At(x[k]).slope, slope, 1e-13) << k;
  }
}

// Where the parabola at an end would leave the chords' range the slope is held: at zero where it
// turns, at three chords where the next one turns.
TEST(MomentTable, EndsAreHeldMonotone) {
  const MomentTable flat =
      TableOf({0.0, 1.0, 2.0}, {0.0, 1.0, 6.0});  // the parabola begins with -1
  EXPECT_EQ(flat.At(0.0).slope, 0.0);
  const MomentTable steep = TableOf({0.0, 1.0, 2.0}, {0.0, 1.0, -5.0});  // with 4.5
  EXPECT_EQ(steep.At(0.0).slope, 3.0);
  const MomentTable gentle = TableOf({0.0, 1.0, 2.0}, {0.0, 1.0, 0.5});  // with 1.75
  EXPECT_NEAR(gentle.At(0.0).slope, 1.75, 1e-14);
}

TEST(MomentTable, TwoPointsAreALine) {
  const MomentTable line = TableOf({-1.0, 1.0}, {3.0, -1.0});
  EXPECT_NEAR(line.At(0.5).moment, 0.0, 1e-15);
  EXPECT_NEAR(line.At(5.0).moment, -9.0, 1e-14);
}

}  // namespace
}  // namespace unfurl::sim::moment_table_test
