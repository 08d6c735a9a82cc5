// Clearance of 5 mm at a beam's end, and optics that are wrong by as much in a smooth way.
#include <gtest/gtest.h>

#include "tests/correlate/optics_cases.h"

namespace unfurl::correlate::optics_slow_test {
namespace {

constexpr int kSeeds = 20;

class OpticsSlow : public ::testing::Test {
 protected:
  static OpticsCount Count(const OpticsCase& which) {
    const OpticsCount c = CountOptics(which, kSeeds, 1);
    fmt::print(
        "{:g} mm, {}: {} of {} usable, {} not explained; {} determined, {} of them wrongly; "
        "clearance found {}; covered {}, {}, {}; largest errors {:.2g}%, {:.2g}%, {:.2g}%\n{}",
        1e3 * which.rms, which.claimed ? "claimed" : "not claimed", c.usable, c.trials,
        c.unexplained, c.determined, c.wrongly, c.clearance_found, c.covered[0], c.covered[1],
        c.covered[2], c.percent[0], c.percent[1], c.percent[2], c.words);
    EXPECT_EQ(c.usable, kSeeds);
    return c;
  }
  // So many of `of` intervals at 95% leave the truth out by chance, once in a hundred.
  static bool Chance(int wrongly, int of) {
    return BinomialInterval(static_cast<std::size_t>(wrongly), static_cast<std::size_t>(of), 0.98)
               .first <= 0.05;
  }
};

TEST_F(OpticsSlow, FiveMillimetresThatTheTracksClaim) {
  const OpticsCount c = Count({5e-3, true});
  EXPECT_TRUE(Chance(c.wrongly, c.determined)) << c.wrongly;
}
TEST_F(OpticsSlow, FiveMillimetresThatTheyDoNot) {
  const OpticsCount c = Count({5e-3, false});
  EXPECT_EQ(c.unexplained, kSeeds);
  EXPECT_EQ(c.determined, 0);
}
TEST_F(OpticsSlow, TwoTenthsThatTheTracksClaim) {
  const OpticsCount c = Count({2e-4, true});
  EXPECT_TRUE(Chance(c.wrongly, c.determined)) << c.wrongly;
  EXPECT_EQ(c.clearance_found, kSeeds);
}

}  // namespace
}  // namespace unfurl::correlate::optics_slow_test
