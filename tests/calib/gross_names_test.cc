// Gross errors of every kind at once in surveys with rays through the glass of laboratories of many
// kinds, at readings of any precision: each is named as what it is, and good readings stay.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "base/random_vector.h"
#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/explain.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::gross_names_test {
namespace {

constexpr std::size_t kLabs = testing::Labs(2, 60);
constexpr int kPoints = 150;

struct Tally {
  int planted = 0, named = 0;  // gross errors
  int good = 0, lost = 0;      // readings
  void Add(const Tally& other) {
    planted += other.planted;
    named += other.named;
    good += other.good;
    lost += other.lost;
  }
};

bool IsNamed(const std::vector<GrossFinding>& findings, const std::vector<GrossKind>& kinds,
             std::vector<int> points, int camera) {
  std::sort(points.begin(), points.end());
  return std::any_of(findings.begin(), findings.end(), [&](const GrossFinding& finding) {
    std::vector<int> found = finding.points;
    std::sort(found.begin(), found.end());
    return std::find(kinds.begin(), kinds.end(), finding.kind) != kinds.end() && found == points &&
           (camera < 0 || finding.camera == camera);
  });
}

// Three places displaced by 10 to 100 mm of a metre, two labels swapped, three shifted in a ring,
// and up to four readings off by 0.15 to 5% of the row where four cameras see the point.
Tally PlantAll(std::uint64_t seed, double reading_sigma) {
  double half = 0.0;
  const data::Lab kind = testing::RandomLab(seed, &half);
  testing::TracedLab lab(kind, half, seed);
  lab.reading_sigma = reading_sigma;
  Observations data = lab.Survey(kPoints);
  Rng rng = lab.rng.Stream("gross errors of all kinds");
  std::vector<int> order(kPoints);
  for (int i = 0; i < kPoints; ++i) order[static_cast<std::size_t>(i)] = i;
  for (std::size_t i = kPoints - 1; i > 0; --i) std::swap(order[i], order[rng.Integer(i + 1)]);

  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d way = NormalVector(&rng);
    data.p.col(order[k]) += half * std::pow(10.0, rng.Uniform(-2.0, -1.0)) * way.normalized();
  }
  data.p.col(order[3]).swap(data.p.col(order[4]));
  data.p.col(order[5]).swap(data.p.col(order[6]));
  data.p.col(order[6]).swap(data.p.col(order[7]));
  std::vector<char> wild(data.readings.size(), 0);
  for (std::size_t k = 8; k < 12; ++k) {
    std::vector<std::size_t> mine;
    for (std::size_t r = 0; r < data.readings.size(); ++r) {
      if (data.readings[r].point == order[k]) mine.push_back(r);
    }
    if (mine.size() < 4) continue;
    const std::size_t r = mine[rng.Integer(mine.size())];
    const double row = data.pixels[static_cast<std::size_t>(data.readings[r].camera)];
    const double sign = rng.Uniform() < 0.5 ? -1.0 : 1.0;
    data.readings[r].u_px += sign * row * std::pow(10.0, rng.Uniform(-2.8, -1.3));
    wild[r] = 1;
  }

  const RigFit fit = FitRig(data, {}, "test");
  const auto findings = ExplainGross(data, fit.bundle, {});
  Tally out;
  const auto expect = [&](const std::vector<GrossKind>& kinds, const std::vector<int>& points,
                          int camera) {
    ++out.planted;
    out.named += IsNamed(findings, kinds, points, camera) ? 1 : 0;
  };
  for (std::size_t k = 0; k < 3; ++k) {
    // One that happens to lie along an axis may be called so.
    expect({GrossKind::kDisplacedPoint, GrossKind::kAlongOneAxis}, {order[k]}, -1);
  }
  expect({GrossKind::kSwappedPoints}, {order[3], order[4]}, -1);
  expect({GrossKind::kShiftedLabels}, {order[5], order[6], order[7]}, -1);
  for (std::size_t r = 0; r < wild.size(); ++r) {
    if (wild[r] != 0) {
      expect({GrossKind::kWildReading}, {data.readings[r].point}, data.readings[r].camera);
      continue;
    }
    ++out.good;
    out.lost += fit.bundle.weighting.Uses(r) ? 0 : 1;
  }
  return out;
}

void ExpectNamed(double reading_sigma) {
  std::vector<Tally> all(kLabs);
  ParallelFor(kLabs, 0, [&](std::size_t k) { all[k] = PlantAll(40 + k, reading_sigma); });
  Tally sum;
  for (const Tally& one : all) sum.Add(one);
  std::printf("readings %.3f px: %d of %d named as what they are, %d of %d good readings lost\n",
              reading_sigma, sum.named, sum.planted, sum.lost, sum.good);
  EXPECT_GE(sum.named, 0.95 * sum.planted);
  EXPECT_LE(sum.lost, 0.01 * sum.good);
}

TEST(TracedNames, PreciseReadings) { ExpectNamed(0.002); }
TEST(TracedNames, GoodReadings) { ExpectNamed(0.01); }
TEST(TracedNames, UsualReadings) { ExpectNamed(0.05); }

}  // namespace
}  // namespace unfurl::calib::gross_names_test
