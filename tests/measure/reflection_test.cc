#include "tests/measure/reflection.h"

#include <gtest/gtest.h>

#include "base/statistics.h"

namespace unfurl::measure::reflection_test {
namespace {

TEST(Reflection, APaneThatMirrorsAsBrightAsTheMark) {
  // It stands beside the volume and shows two cameras a second spot, nine tenths as bright.
  const data::LabReflection pane{{{1.6, 0.0, 0.5}, {1.0, 0.0, 0.0}, 1.5}, 0.9};
  const ReflectionScore score = Reflected(pane, 0.5, 20260);
  score.Print();
  EXPECT_GT(score.second_spots, 100U);
  EXPECT_GE(score.right, score.samples * 99 / 100);
  EXPECT_EQ(score.silent, 0U);
}

// The brightest spot of a camera is not the mark's, for as long as the pane shows one. Positions
// are made from the others; error bars are of those.
TEST(Reflection, APaneThatShowsMoreThanTheMarkWidensNoErrorBars) {
  const data::LabReflection pane{{{1.6, 0.0, 0.5}, {1.0, 0.0, 0.0}, 1.5}, 3.0};
  const ReflectionScore score = Reflected(pane, 0.5, 20260);
  score.Print();
  ASSERT_FALSE(score.errors.empty());
  EXPECT_EQ(score.silent, 0U);
  // Half of the errors are within 1.54 standard deviations of three coordinates alike, in all
  // between 0.67 and 1.54 / sqrt(3) of the root of their sum; ten times as large is another matter.
  EXPECT_LT(Median(score.stated), 10.0 * Median(score.errors));
}

}  // namespace
}  // namespace unfurl::measure::reflection_test
