#include "base/signals.h"

#include <gtest/gtest.h>

namespace unfurl::signals_test {
namespace {

TEST(Printable, WordsStay) {
  const std::string text = "Außenarm \xe2\x88\x9a 5 \xf0\x9f\x9b\xb0\n\tline";
  EXPECT_EQ(Printable(text), text);
}

TEST(Printable, NothingReachesTheTerminalsInterpreter) {
  EXPECT_EQ(Printable("a\x1b[2Jb\x07\x7f"), "a\\x1b[2Jb\\x07\\x7f");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\xc2\\x9b"
            "31m");  // 8-bit CSI
  EXPECT_EQ(Printable("x\xe2\x80\xae"
                      "gpj"),
            "x\\xe2\\x80\\xae"
            "gpj");  // right to left
  EXPECT_EQ(Printable("\r"), "\\x0d");
}

TEST(Printable, BytesThatAreNoUtf8) {
  EXPECT_EQ(Printable("caf\xe9.h5"), "caf\\xe9.h5");
  EXPECT_EQ(Printable("\xc0\xaf"), "\\xc0\\xaf");        // overlong
  EXPECT_EQ(Printable("end\xe2\x82"), "end\\xe2\\x82");  // cut off
  EXPECT_EQ(Printable("\xff\xfe"), "\\xff\\xfe");
}

}  // namespace
}  // namespace unfurl::signals_test
