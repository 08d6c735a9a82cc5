#include "helpers.h"

#include <gtest/gtest.h>

namespace unfurl::structure::helpers_test {
namespace {

std::string File(const std::string& function) {
  return "namespace unfurl::data {\nnamespace {\n\n" + function +
         "\n}\n\n}  // namespace\n}  // namespace unfurl::data\n";
}

TEST(CheckHelpers, FindsThoseThatACallMayConfuse) {
  EXPECT_EQ(CheckHelpers({{"data/a.cc", File("int Old(const fs::path& p) {\n  return 1;")},
                          {"data/b.cc", File("int Old(const std::string& s) {\n  return 2;")}})
                .size(),
            1U);
  EXPECT_EQ(
      CheckHelpers({{"data/a.cc", File("int Old(int n,\n        double x) {\n  return 1;")},
                    {"data/b.cc", File("int Old(std::map<int, int> n, int m) {\n  return 2;")}})
          .size(),
      1U);
}

TEST(CheckHelpers, PassesThoseThatItCannot) {
  EXPECT_TRUE(CheckHelpers({{"data/a.cc", File("int Old(const Run& r) {\n  return 1;")},
                            {"data/b.cc", File("int Old(const std::string& s) {\n  return 2;")}})
                  .empty());
  EXPECT_TRUE(CheckHelpers({{"data/a.cc", File("int Old(int n) {\n  return 1;")},
                            {"data/b.cc", File("int Old(int n, int m) {\n  return 2;")}})
                  .empty());
  EXPECT_TRUE(CheckHelpers({{"data/a.cc", "namespace unfurl {\nint Old(int n) {\n}\n}\n"},
                            {"data/b.cc", File("int Old(int n) {\n  return 2;")}})
                  .empty());
}

}  // namespace
}  // namespace unfurl::structure::helpers_test
