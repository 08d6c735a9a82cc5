// A latch's switch beside the marks, through `unfurl fit`.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "data/run.h"
#include "tests/cli/fit_cases.h"

namespace unfurl::cli::fit_events_test {
namespace {

using ::testing::HasSubstr;

class FitEventsTest : public FitVerbTest {
 protected:
  void SetUp() override {
    FitVerbTest::SetUp();
    MakeTracks("tracks.h5", {}, 5);
  }
  void MakeStudyWith(const std::string& event) const {
    MakeStudy("study.toml", "[trial]\ntracks = \"tracks.h5\"\n[trial.event.switch]\n" + event,
              "[profile]\nlevels = []\n");
  }
};

TEST_F(FitEventsTest, ASwitchTakesPartAndIsReported) {
  const data::Run truth = data::ReadRun((folder_ / "truth.h5").string());
  double latch = 0.0;
  for (const data::RunEvent& e : truth.events) {
    if (e.kind == "latch" && latch == 0.0) latch = e.t;
  }
  ASSERT_GT(latch, 0.0);
  MakeStudyWith(fmt::format("joint = \"hinge\"\ntime = {:.6f}\nsigma = 1e-4\n", latch));
  const Outcome fit = Good({"fit", "study.toml", "-o", "fit.h5"});
  EXPECT_THAT(fit.out,
              HasSubstr(fmt::format("The latch of hinge was observed at {:.4f} s", latch)));
  EXPECT_THAT(fit.out, HasSubstr("of its sigma) from the model's"));
  // One that never comes is said to.
  MakeStudyWith(fmt::format("joint = \"hinge\"\ncount = 1000\ntime = 1.0\nsigma = 10.0\n"));
  EXPECT_THAT(Good({"fit", "study.toml", "-o", "fit.h5"}).out,
              HasSubstr("observed at 1.0000 s; the model has none"));
}

TEST_F(FitEventsTest, BadOnesAreRefused) {
  struct Case {
    const char *event, *what;
  };
  for (const Case& c :
       {Case{"joint = \"elbow\"\ntime = 0.7\nsigma = 1e-4\n", "hinge"},
        Case{"joint = \"hinge\"\ntime = 70.0\nsigma = 1e-4\n", "outside of the record"},
        Case{"joint = \"hinge\"\ntime = 0.7\nsigma = 0.0\n", "sigma"},
        Case{"joint = \"hinge\"\ntime = 0.7\n", "sigma"},
        Case{"kind = \"latched\"\njoint = \"hinge\"\ntime = 0.7\nsigma = 1e-4\n", "contact_start"},
        Case{"kind = \"watch\"\nwatch = \"hinge\"\ntime = 0.7\nsigma = 1e-4\n", "no watch"}}) {
    MakeStudyWith(c.event);
    ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5"}), {"study.toml", c.what}, Files());
  }
}

}  // namespace
}  // namespace unfurl::cli::fit_events_test
