// Rigid bodies made of welded ones, against mechanics by hand.

#include "sim/model/composites.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/sim/scenes.h"

namespace unfurl::sim::composites_test {
namespace {

constexpr double kRounding = 1e-15;

TEST(PlanePose, ActsAsMatricesDo) {
  const PlanePose a{0.3, -0.8, 0.7}, b{-1.1, 0.4, -2.1};
  const PlanePose c = a * b;
  // As R(0.7) applied to b's origin, added to a's.
  EXPECT_NEAR(c.x, 0.3 + std::cos(0.7) * -1.1 - std::sin(0.7) * 0.4, kRounding);
  EXPECT_NEAR(c.y, -0.8 + std::sin(0.7) * -1.1 + std::cos(0.7) * 0.4, kRounding);
  EXPECT_NEAR(c.angle, -1.4, kRounding);
  for (const PlanePose& none : {a * a.Inverse(), a.Inverse() * a}) {
    EXPECT_NEAR(none.x, 0.0, 4 * kRounding);
    EXPECT_NEAR(none.y, 0.0, 4 * kRounding);
    EXPECT_NEAR(none.angle, 0.0, kRounding);
  }
}

// Two bars welded into an L at their ends, the second turned by a right angle: masses add, the
// common centre is the weighted mean, and inertias move by Steiner's rule.
TEST(MergeWeldedBodies, AddsMassesAndMovesInertias) {
  const Composites merged =
      MergeWeldedBodies(data::ParseScene("[scene]\nname = \"L\"\nduration = 1.0\n"
                                         "[body.a]\nmass = 2.0\ninertia = 0.3\n"
                                         "[body.b]\nmass = 3.0\ninertia = 0.4\n"
                                         "[body.c]\nmass = 1.0\ninertia = 0.1\n"
                                         "[weld.corner]\ninner = \"a\"\ninner_point = [1.0, "
                                         "0.0]\nouter = \"b\"\nouter_point = [-0.5, 0.0]\n"
                                         "angle = 1.5707963267948966\n",
                                         "L.toml"));
  ASSERT_EQ(merged.list.size(), 3U);  // the ground, the L, c
  EXPECT_TRUE(merged.list[0].ground);
  const Composite& both = merged.list[1];
  EXPECT_EQ(both.members, (std::vector<int>{0, 1}));
  EXPECT_NEAR(both.mass, 5.0, kRounding);
  // In a's frame b's centre is at (1, 0.5), the common one at (0.6, 0.3).
  EXPECT_NEAR(merged.body_in[0].x, -0.6, 4 * kRounding);
  EXPECT_NEAR(merged.body_in[0].y, -0.3, 4 * kRounding);
  EXPECT_NEAR(merged.body_in[1].x, 0.4, 4 * kRounding);
  EXPECT_NEAR(merged.body_in[1].y, 0.2, 4 * kRounding);
  EXPECT_NEAR(merged.body_in[1].angle, M_PI_2, kRounding);
  EXPECT_NEAR(both.inertia, 0.3 + 0.4 + 2.0 * (0.36 + 0.09) + 3.0 * (0.16 + 0.04), 4 * kRounding);
  EXPECT_EQ(merged.of_body, (std::vector<int>{1, 1, 2}));
  EXPECT_NEAR(merged.list[2].inertia, 0.1, kRounding);
}

// The same chain reached from its last body: the weld read backwards is the inverse pose.
TEST(MergeWeldedBodies, ReadsAWeldFromEitherSide) {
  const auto merged = [](const std::string& first, const std::string& second) {
    return MergeWeldedBodies(
        data::ParseScene("[scene]\nname = \"chain\"\nduration = 1.0\n[body." + first +
                             "]\nmass = 2.0\ninertia = 0.3\n[body." + second +
                             "]\nmass = 2.0\ninertia = 0.3\n"
                             "[weld.w]\ninner = \"a\"\ninner_point = [0.7, 0.2]\nouter = "
                             "\"b\"\nouter_point = [-0.4, 0.1]\nangle = 0.6\n",
                         "chain.toml"));
  };
  const Composites forward = merged("a", "b"), back = merged("b", "a");
  EXPECT_NEAR(forward.list[1].inertia, back.list[1].inertia, 1e-14);
  const PlanePose b_in_a = forward.body_in[0].Inverse() * forward.body_in[1];
  const PlanePose again = back.body_in[1].Inverse() * back.body_in[0];
  EXPECT_NEAR(b_in_a.x, again.x, 1e-14);
  EXPECT_NEAR(b_in_a.y, again.y, 1e-14);
  EXPECT_NEAR(b_in_a.angle, again.angle, 1e-14);
  // By hand: b's centre is R(0.6) (0.4, -0.1) from the weld at (0.7, 0.2).
  EXPECT_NEAR(b_in_a.x, 0.7 + 0.4 * std::cos(0.6) + 0.1 * std::sin(0.6), 1e-14);
  EXPECT_NEAR(b_in_a.y, 0.2 + 0.4 * std::sin(0.6) - 0.1 * std::cos(0.6), 1e-14);
}

}  // namespace
}  // namespace unfurl::sim::composites_test
