#include "base/progress.h"

#include <gtest/gtest.h>

namespace unfurl::progress_test {
namespace {

TEST(Progress, TellsWhatIsLeftWhereItCanBeKnown) {
  EXPECT_EQ(ProgressLine("fit", 0.4, 12.0, "stages"), "fit  40 %  12 s, 18 s left  stages");
  EXPECT_EQ(ProgressLine("fit", 1.0, 12.0, ""), "fit  99 %  12 s, 0 s left  ");
  // Neither before anything is done, nor where it takes longer than was expected.
  EXPECT_EQ(ProgressLine("fit", 0.0, 1.0, "screening"), "fit   0 %  1 s  screening");
  EXPECT_EQ(ProgressLine("fit", 1.5, 90.0, "starts"),
            "fit  99 %  90 s, longer than expected  starts");
}

}  // namespace
}  // namespace unfurl::progress_test
