#include "tests/measure/reflection.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace unfurl::measure::reflection_test
