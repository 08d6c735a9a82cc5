// What a trial with bad optics tells, and what it must not say.
#include <gtest/gtest.h>

#include "tests/correlate/optics_cases.h"

namespace unfurl::correlate::optics_test {
namespace {

// One draw of each; optics_slow_test.cc repeats them.
TEST(Optics, ASmoothErrorThatTheTracksClaimDoesNotLeadTheFitAstray) {
  const OpticsCount count = CountOptics({5e-3, true}, 1, 1);
  EXPECT_EQ(count.usable, 1) << count.words;
  EXPECT_EQ(count.unexplained, 0) << count.words;
  EXPECT_EQ(count.wrongly, 0) << count.words;
}

}  // namespace
}  // namespace unfurl::correlate::optics_test
