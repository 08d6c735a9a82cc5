#include "report/escape.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

namespace unfurl::report::escape_test {
namespace {

TEST(EscapeHtml, LeavesNothingThatStartsOrEndsMarkup) {
  EXPECT_EQ(EscapeHtml("<b a=\"1\" c='2'>&</b>"),
            "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;&lt;/b&gt;");
  EXPECT_EQ(EscapeHtml(std::string_view("a\0b\x1f\x7f\tc\n", 8)), "ab\tc\n");
  EXPECT_EQ(EscapeHtml("0.2\u00b0 \u00b1 1 \u00b5m"), "0.2\u00b0 \u00b1 1 \u00b5m");
}

TEST(EscapeJsonForScript, IsTheSameJsonWithoutAnyLessThan) {
  const nlohmann::json original = {{"a", "</script><!--"}, {"b", {1, 2.5, nullptr}}};
  const std::string escaped = EscapeJsonForScript(original.dump());
  EXPECT_EQ(escaped.find('<'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(escaped), original);
}

// RFC 4648, section 10.
TEST(Base64, PublishedVectors) {
  const auto encode = [](const std::string& text) {
    return Base64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  EXPECT_EQ(encode(""), "");
  EXPECT_EQ(encode("f"), "Zg==");
  EXPECT_EQ(encode("fo"), "Zm8=");
  EXPECT_EQ(encode("foo"), "Zm9v");
  EXPECT_EQ(encode("foob"), "Zm9vYg==");
  EXPECT_EQ(encode("fooba"), "Zm9vYmE=");
  EXPECT_EQ(encode("foobar"), "Zm9vYmFy");
  EXPECT_EQ(encode("\xff\xfe\xfd"), "//79");
}

}  // namespace
}  // namespace unfurl::report::escape_test
