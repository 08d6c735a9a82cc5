// kill -9 at many random moments.
#include "tests/cli/fit_cases.h"

namespace unfurl::cli::fit_verb_slow_test {
namespace {

constexpr int kKills = 50;  // issue

TEST_F(FitVerbTest, FiftyKills) { ExpectResumes(kKills, 2); }

}  // namespace
}  // namespace unfurl::cli::fit_verb_slow_test
