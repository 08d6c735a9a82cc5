#include "base/count.h"

#include <gtest/gtest.h>

namespace unfurl::count_test {
namespace {

TEST(Counted, OneIsSingular) {
  EXPECT_EQ(Counted(0, "sample"), "0 samples");
  EXPECT_EQ(Counted(1, "sample"), "1 sample");
  EXPECT_EQ(Counted(21, "sample"), "21 samples");
}

}  // namespace
}  // namespace unfurl::count_test
