// The simpler estimators of a spot's centre: where they find it, how honest they are, what they
// flag.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/statistics.h"
#include "tests/measure/spot_bench.h"

namespace unfurl::measure::spot_centroid_test {
namespace {

constexpr SpotEstimator kSimple[] = {SpotEstimator::kThresholdedCentroid,
                                     SpotEstimator::kSquaredCentroid, SpotEstimator::kLeastSquares};

SpotBench BenchOf(SpotEstimator estimator) {
  SpotOptions options;
  options.estimator = estimator;
  return SpotBench(12, options);
}

// 300 repeats know an RMS to 4%. Centroids state what the place within the pixel adds as if it were
// noise; it is less for most places, so they may scatter by less than they say, never by a quarter
// more.
TEST(SimpleSpots, ScatterByNoMoreThanTheySay) {
  for (const SpotEstimator estimator : kSimple) {
    SpotBench bench = BenchOf(estimator);
    for (const double width : {1.0, 1.6, 3.0}) {
      Rng rng(17);
      std::vector<double> error, stated, widths;
      for (int i = 0; i < 300; ++i) {
        const double centre = 700.0 + 300.0 * rng.Uniform();
        bench.Clear();
        bench.AddGaussian(centre, width, 60000.0 * width);
        const Spot found = bench.Find(rng);
        ASSERT_TRUE(Usable(found)) << static_cast<int>(estimator) << " " << width;
        error.push_back(found.u_px - centre);
        stated.push_back(found.s_px);
        widths.push_back(found.width_px);
      }
      EXPECT_LT(Rms(error) / Rms(stated), 1.25) << static_cast<int>(estimator) << " " << width;
      EXPECT_GT(Rms(error) / Rms(stated), 0.5) << static_cast<int>(estimator) << " " << width;
      EXPECT_NEAR(Mean(widths) / width, 1.0, 0.15) << static_cast<int>(estimator) << " " << width;
    }
  }
}

// Anywhere in the row, in steps that meet every place of a block.
TEST(SimpleSpots, NoPlaceIsMissed) {
  for (const SpotEstimator estimator : kSimple) {
    SpotBench bench = BenchOf(estimator);
    Rng rng(5);
    const double last = bench.sensor().format.active - 12.0;
    for (double centre = 11.0; centre < last; centre += 12.3) {
      bench.Clear();
      bench.AddGaussian(centre, 1.5, 60000.0);
      const Spot found = bench.Find(rng);
      EXPECT_EQ(found.flags, 0) << centre;
      EXPECT_NEAR(found.u_px, centre, 0.1) << static_cast<int>(estimator);
    }
    bench.Clear();
    EXPECT_FALSE(Usable(bench.Find(rng)));  // a dark line holds none
  }
}

TEST(SimpleSpots, FlagWhatSpoilsThem) {
  for (const SpotEstimator estimator : kSimple) {
    SpotBench bench = BenchOf(estimator);
    Rng rng(5);
    bench.Clear();
    bench.AddGaussian(800.2, 2.0, 4e6);  // far more than full
    EXPECT_TRUE(bench.Find(rng).flags & kSpotSaturated) << static_cast<int>(estimator);
    bench.Clear();
    bench.AddGaussian(0.6, 2.0, 60000.0);
    EXPECT_TRUE(bench.Find(rng).flags & kSpotEdge) << static_cast<int>(estimator);
  }
  // Two lights whose feet meet: a centroid of one stretch is of neither.
  SpotBench bench = BenchOf(SpotEstimator::kThresholdedCentroid);
  Rng rng(5);
  for (const double apart : {-9.0, 9.0}) {
    bench.Clear();
    bench.AddGaussian(900.0, 2.0, 90000.0);
    bench.AddGaussian(900.0 + apart, 2.0, 60000.0);
    const Spot found = bench.Find(rng);
    EXPECT_TRUE(found.flags & kSpotOverlap);
    EXPECT_NEAR(found.u_px, 900.0, 0.5);
  }
}

}  // namespace
}  // namespace unfurl::measure::spot_centroid_test
