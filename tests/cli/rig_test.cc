// `unfurl plan`, `unfurl check` and `unfurl calibrate --report` as a person uses them.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/cli/program.h"

namespace unfurl::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class RigVerbs : public ProgramTest {};

TEST_F(RigVerbs, PlanOfTheShippedLaboratory) {
  const Outcome outcome =
      Run({"plan", Shipped("lab.toml"), "--report", "plan.html", "--columns", "6", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["verdict"], "Any one camera may fail");
  ASSERT_EQ(summary["cases"].size(), 5u);
  // What calibrations of such laboratories reach (docs/accuracy.md): 0.16 mm RMS over the volume.
  const double median = summary["cases"][0]["median_m"].get<double>();
  EXPECT_GT(median, 0.10e-3);
  EXPECT_LT(median, 0.18e-3);
  for (std::size_t k = 1; k < 5; ++k) {
    EXPECT_GT(summary["cases"][k]["median_m"].get<double>(), median);
  }
  EXPECT_THAT(Get("plan.html"), AllOf(HasSubstr("without north_east"), HasSubstr("<svg")));
}

TEST_F(RigVerbs, PlanOfParallelLensAxesSparesNoCamera) {
  const Outcome outcome =
      Run({"plan", Shipped("lab.toml"), "--set", "camera.north_west.roll=0.785398163", "--set",
           "camera.south_east.roll=0.785398163", "--json"});
  EXPECT_EQ(outcome.err, "");
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_NE(summary["verdict"], "Any one camera may fail");
}

TEST_F(RigVerbs, CalibrateThenCheckTenPoints) {
  const Outcome made = Run({"calibrate", Shipped("survey.h5"), "-o", "rig.h5", "--report",
                            "page.html", "--layout", Shipped("lab.toml"), "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  const auto calibration = nlohmann::json::parse(made.out);
  EXPECT_EQ(calibration["verdict"], "good");
  EXPECT_EQ(calibration["orders"].size(), 6u);
  EXPECT_THAT(Get("page.html"), AllOf(HasSubstr("Verdict: good"), HasSubstr("Lens models"),
                                      HasSubstr("Uncertainty")));
  ASSERT_EQ(Run({"convert", Shipped("survey.h5"), "survey.csv", "--quiet"}).code, 0);
  // Its comment, its header and the first ten points.
  std::string ten = Get("survey.csv");
  std::size_t end = 0;
  for (int line = 0; line < 12; ++line) end = ten.find('\n', end) + 1;
  Put("ten.csv", ten.substr(0, end));
  const Outcome check = Run({"check", "rig.h5", "ten.csv", "--json"});
  EXPECT_EQ(check.code, 0) << check.err;
  const auto checked = nlohmann::json::parse(check.out);
  EXPECT_EQ(checked["verdict"], "still valid");
  EXPECT_EQ(checked["points"].size(), 10u);
}

TEST_F(RigVerbs, BadInput) {
  ExpectRefused(Run({"plan", "nowhere.toml"}), {"nowhere.toml"}, {});
  ExpectRefused(Run({"check", Shipped("rig.h5"), Shipped("points.csv")}), {"points.csv"}, {});
  ExpectRefused(Run({"calibrate", Shipped("survey.h5"), "--order", "septic"}),
                {"septic", "quintic-even"}, {});
  ExpectRefused(Run({"check", Shipped("rig.h5"), Shipped("survey.h5"), "--bar-sigma", "1e-5"}),
                {"--bar"}, {});
  Put("points.gsi", "110001+00000P01 81..00+00001000 82..00+00002000 83..00+00000500\n");
  ExpectRefused(Run({"calibrate", "points.gsi"}), {"points.gsi", "--readings"}, {"points.gsi"});
}

}  // namespace
}  // namespace unfurl::cli
