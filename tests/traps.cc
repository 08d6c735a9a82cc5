// Linked into a test program: floating-point traps while its tests run.
#include <gtest/gtest.h>

#include <cfenv>

namespace unfurl {
namespace {

class Traps : public testing::EmptyTestEventListener {
 public:
  void OnTestStart(const testing::TestInfo&) override {
    std::feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
  }
  void OnTestEnd(const testing::TestInfo&) override { fedisableexcept(FE_ALL_EXCEPT); }
};

const bool appended = [] {
  testing::UnitTest::GetInstance()->listeners().Append(new Traps);
  return true;
}();

}  // namespace
}  // namespace unfurl
