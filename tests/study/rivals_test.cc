// Laws that compete for one trial.
#include "study/rivals.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/study/swing.h"

namespace unfurl::study::rivals_test {
namespace {

class RivalsTest : public SwingTest {};

TEST_F(RivalsTest, TheLawThatMadeTheTrialIsTheProbableOne) {
  const std::vector<data::Study> laws = {LawStudy("linear", {"damper"}),
                                         LawStudy("quadratic", {"quadratic_damper"})};
  for (const bool quadratic : {false, true}) {
    Record({.linear = quadratic ? 0.0 : 0.02, .quadratic = quadratic ? 0.02 : 0.0}, 1e-3, 7);
    const std::vector<Rival> found = WeighRivals(laws, {});
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].name, quadratic ? "quadratic" : "linear");
    EXPECT_GT(found[0].probability, 0.999);
    EXPECT_TRUE(found[0].explains);
    EXPECT_NEAR(found[0].probability + found[1].probability, 1.0, 1e-12);
    EXPECT_EQ(found[0].deviance, 0.0);
    EXPECT_GT(found[1].deviance, 100.0);
    EXPECT_GT(found[1].behind.gain, 3.0 * found[1].behind.sigma);
  }
}

// One law against itself: neither is the likelier. With another that is not in the trial beside it,
// the one without: what the other gains is chance.
TEST_F(RivalsTest, AParameterCosts) {
  Record({.linear = 0.02}, 1e-3, 3);
  const data::Study linear = LawStudy("linear", {"damper"});
  const std::vector<Rival> same = WeighRivals({linear, linear}, {});
  EXPECT_NEAR(same[0].probability, 0.5, 1e-9);
  const data::Study both = LawStudy("both", {"damper", "quadratic_damper"});
  const std::vector<Rival> found = WeighRivals({both, linear}, {});
  EXPECT_EQ(found[0].name, "linear");
  EXPECT_GT(found[0].probability, 0.5);
  EXPECT_LT(found[1].probability, 0.5);
  EXPECT_LE(found[1].deviance, found[0].deviance + 0.01);
}

TEST_F(RivalsTest, UnlikeTrialsAreRefused) {
  Record({.linear = 0.02}, 1e-3, 3);
  const data::Study linear = LawStudy("linear", {"damper"});
  EXPECT_THROW(WeighRivals({linear}, {}), Error);
  Put("fewer.csv", "t [s],angle [rad]\n0.0,0.6\n0.01,0.6\n0.02,0.599\n0.03,0.598\n0.04,0.597\n");
  data::Study other = linear;
  other.trials[0].channels[0].file = (folder_ / "fewer.csv").string();
  EXPECT_THROW(WeighRivals({linear, other}, {}), Error);
}

}  // namespace
}  // namespace unfurl::study::rivals_test
