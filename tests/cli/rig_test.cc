// `unfurl plan`, `unfurl check` and `unfurl calibrate --report` as a person uses them.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "data/survey.h"
#include "tests/cli/program.h"
#include "tests/source_dir.h"

namespace unfurl::cli::rig_test {
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

// Places of one's own in millimetres, and a station's data sheet; better ones give a better rig.
TEST_F(RigVerbs, PlanOfPlannedPoints) {
  std::string points = "# station: 4, 0, 1\nid,x [mm],y [mm],z [mm]\n";
  Rng rng(3);
  for (int k = 0; k < 60; ++k) {
    points += fmt::format("P{},{},{},{}\n", k, rng.Uniform(-1e3, 1e3), rng.Uniform(-1e3, 1e3),
                          rng.Uniform(-1e3, 1e3));
  }
  Put("points.csv", points);
  const auto median = [&](const std::string& station, const std::string& of) {
    const Outcome made = Run(
        {"plan", of, "--points", "points.csv", "--station", station, "--columns", "4", "--json"});
    EXPECT_EQ(made.err, "");
    const auto summary = nlohmann::json::parse(made.out);
    EXPECT_EQ(summary["points"], 60);
    return summary["cases"][0]["median_m"].get<double>();
  };
  const double fine = median("0.3mm+2ppm, 0.05mrad", Shipped("lab.toml"));
  EXPECT_GT(median("0.9mm+2ppm, 0.15mrad", Shipped("lab.toml")), 2.0 * fine);
  // The shipped rig is that laboratory, but for mounting errors and what a fit takes in.
  EXPECT_NEAR(median("0.3mm+2ppm, 0.05mrad", Shipped("rig.h5")), fine, 0.3 * fine);
  const auto refused = [&](const std::vector<std::string>& more,
                           const std::vector<std::string>& words) {
    std::vector<std::string> arguments = {"plan", Shipped("lab.toml")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ExpectRefused(Run(arguments), words, {"points.csv"});
  };
  refused({"--points", "11"}, {"--points", "12"});
  refused({"--points", "20.5"}, {"--points", "whole number"});
  refused({"--points", "points.csv", "--station", "1mm"}, {"--station", "0.1mrad"});
  refused({"--station", "1mm+2ppm, 1arcsec"}, {"--station", "--points points.csv"});
  Put("points.csv", points.substr(points.find("id,")));
  refused({"--points", "points.csv", "--station", "1mm+2ppm, 1arcsec"},
          {"points.csv", "--station-at"});
  ExpectRefused(Run({"plan", Shipped("rig.h5"), "--points", "points.csv"}),
                {"points.csv", "uncertainty", "--station"}, {"points.csv"});
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
  EXPECT_GE(calibration["orders"].size(), 6u);
  EXPECT_THAT(Get("page.html"), AllOf(HasSubstr("Verdict: good"), HasSubstr("Lens models"),
                                      HasSubstr("Uncertainty")));
  ASSERT_EQ(Run({"convert", Shipped("survey.h5"), "survey.csv", "--quiet"}).code, 0);
  // All up to the header, and the first ten points.
  std::string ten = Get("survey.csv");
  std::size_t end = ten.find("\nid,") + 1;
  for (int line = 0; line < 11; ++line) end = ten.find('\n', end) + 1;
  Put("ten.csv", ten.substr(0, end));
  const Outcome check = Run({"check", "rig.h5", "ten.csv", "--json"});
  EXPECT_EQ(check.code, 0) << check.err;
  const auto checked = nlohmann::json::parse(check.out);
  EXPECT_EQ(checked["verdict"], "still valid");
  EXPECT_EQ(checked["points"].size(), 10u);

  ASSERT_EQ(Run({"check", "rig.h5", "ten.csv", "--report", "check.html", "--quiet"}).code, 0);
  EXPECT_THAT(Get("check.html"),
              AllOf(HasSubstr("The calibration is still valid"), HasSubstr("north_east"),
                    HasSubstr("Readings along the sensor"), HasSubstr("<svg")));
  // The same points, 2 mm higher: the page says so, and what the exit code is.
  const data::Survey survey = data::ReadSurvey((folder_ / "ten.csv").string());
  data::Survey moved = survey;
  moved.p.row(2).array() += 2e-3;
  data::WriteSurveyCsv((folder_ / "moved.csv").string(), moved);
  EXPECT_EQ(Run({"check", "rig.h5", "moved.csv", "--report", "bad.html", "--quiet"}).code, 1);
  EXPECT_THAT(Get("bad.html"), HasSubstr("The calibration is no longer valid"));
  // A bar of two of the points, as far apart as they were surveyed.
  std::string bar = "# cameras: " + fmt::format("{}", fmt::join(survey.cameras, ", ")) + "\nid";
  for (int c = 1; c <= 4; ++c) bar += fmt::format(",u{0} [px],s{0} [px]", c);
  for (const Eigen::Index i : {0, 1}) {
    bar += i == 0 ? "\n1a" : "\n1b";
    for (Eigen::Index c = 0; c < 4; ++c) {
      bar += std::isnan(survey.u_px(i, c))
                 ? ",,"
                 : fmt::format(",{},{}", survey.u_px(i, c), survey.s_px(i, c));
    }
  }
  Put("bar.csv", bar + "\n");
  const double length = (survey.p.col(0) - survey.p.col(1)).norm();
  ASSERT_EQ(Run({"check", "rig.h5", "bar.csv", "--bar", fmt::format("{}", length), "--bar-sigma",
                 "6e-4", "--report", "bar.html", "--quiet"})
                .code,
            0);
  EXPECT_THAT(Get("bar.html"), AllOf(HasSubstr("Placements of the bar"), HasSubstr("1a to 1b")));
  const auto with = [&](std::vector<std::string> words) {
    std::vector<std::string> all = {"check", "rig.h5", "bar.csv", "--json", "--bar"};
    all.insert(all.end(), words.begin(), words.end());
    return Run(all).out;
  };
  const std::string told = with({fmt::format("{}", length), "--bar-sigma", "6e-4"});
  EXPECT_THAT(told, HasSubstr("\"verdict\""));
  EXPECT_EQ(with({fmt::format("{}m+-0.6mm", length)}), told);
  EXPECT_EQ(with({fmt::format("{}mm", 1e3 * length), "--bar-sigma", "6e-4"}), told);
  ExpectRefused(Run({"check", "rig.h5", "bar.csv", "--bar", "1m+-1mm", "--bar-sigma", "1e-3"}),
                {"--bar-sigma", "stated by --bar, too"}, Files());
}

// The shipped set's rig as a program of version 2 of its format wrote it, with ten terms a camera.
TEST_F(RigVerbs, ARigOfVersion2IsUsed) {
  std::filesystem::copy_file(UNFURL_SOURCE_DIR "/tests/data/rig_version_2.h5", folder_ / "old.h5");
  ASSERT_EQ(Run({"convert", Shipped("survey.h5"), "survey.csv", "--quiet"}).code, 0);
  const Outcome outcome = Run({"check", "old.h5", "survey.csv", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto checked = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(checked["verdict"], "still valid");
  // With the rig of today they differ by less than the fit's own tolerance.
  const auto today =
      nlohmann::json::parse(Run({"check", Shipped("rig.h5"), "survey.csv", "--json"}).out);
  ASSERT_EQ(checked["points"].size(), today["points"].size());
  for (std::size_t k = 0; k < checked["points"].size(); ++k) {
    EXPECT_NEAR(checked["points"][k]["error"].get<double>(),
                today["points"][k]["error"].get<double>(), 1e-5);
  }
}

// What all points share, stated in the survey or as options, is in the summary and in the reasons.
TEST_F(RigVerbs, CommonErrorOfTheStation) {
  ASSERT_EQ(Run({"convert", Shipped("survey.h5"), "survey.csv", "--quiet"}).code, 0);
  const std::string text = Get("survey.csv");
  Put("stated.csv", "# station: 4, -3, 0.5\n# distance error: 1e-3, 1.5e-6\n" + text);
  const Outcome stated = Run({"calibrate", "stated.csv", "--order", "quintic-even", "--json"});
  ASSERT_EQ(stated.code, 0) << stated.err;
  const auto first = nlohmann::json::parse(stated.out);
  ASSERT_EQ(first["common"].size(), 2u);
  EXPECT_EQ(first["common"][0]["name"], "distance offset");
  const double sigma = first["common"][0]["sigma"].get<double>();
  EXPECT_LT(sigma, 1e-3);
  EXPECT_GT(sigma, 0.5e-3);  // readings tell little of it
  const Outcome options = Run({"calibrate", "survey.csv", "--order", "quintic-even", "--station",
                               "4", "-3", "0.5", "--distance-error", "1e-3", "1.5e-6", "--json"});
  const auto second = nlohmann::json::parse(options.out);
  // The covariances of the CSV are the same numbers to their last digit.
  EXPECT_NEAR(second["common"][0]["sigma"].get<double>(), sigma, 1e-6 * sigma);
  EXPECT_NEAR(second["common"][0]["value"].get<double>(), first["common"][0]["value"].get<double>(),
              1e-6 * sigma);
  // It goes through an HDF5 survey and back.
  ASSERT_EQ(Run({"convert", "stated.csv", "stated.h5", "--quiet"}).code, 0);
  ASSERT_EQ(Run({"convert", "stated.h5", "again.csv", "--quiet"}).code, 0);
  EXPECT_THAT(Get("again.csv"), AllOf(HasSubstr("# station: 4, -3, 0.5"),
                                      HasSubstr("# distance error: 0.001, 1.5e-06")));
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"calibrate", "survey.csv", "-o", "x.h5", "--distance-error", "1e-3", "0"}),
                {"survey.csv", "--station"}, before);
  Put("stated.csv", "# distance error: 1e-3\n" + text);
  ExpectRefused(Run({"calibrate", "stated.csv", "-o", "x.h5"}), {"stated.csv", "distance error"},
                before);
}

// The half of the shipped survey as from another set-up that stands 2 mm off: found and named.
TEST_F(RigVerbs, ASecondSetUpOfTheStation) {
  ASSERT_EQ(Run({"convert", Shipped("survey.h5"), "survey.csv", "--quiet"}).code, 0);
  data::Survey survey = data::ReadSurvey((folder_ / "survey.csv").string());
  for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
    const bool wall = survey.p(1, i) > 0.1;
    survey.set_up.emplace_back(wall ? "wall" : "door");
    if (wall) survey.p(0, i) += 2e-3;
  }
  data::WriteSurveyCsv((folder_ / "two.csv").string(), survey);
  const Outcome made =
      Run({"calibrate", "two.csv", "-o", "rig.h5", "--order", "quintic-even", "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  const auto summary = nlohmann::json::parse(made.out);
  ASSERT_EQ(summary["set_ups"].size(), 1u);
  const auto& wall = summary["set_ups"][0];
  EXPECT_EQ(wall["name"], "wall");
  EXPECT_EQ(wall["first"], "door");
  EXPECT_EQ(wall["off"], true);
  const double sigma = wall["shift_sigma_m"][0].get<double>();
  EXPECT_NEAR(wall["shift_m"][0].get<double>(), 2e-3, 4.0 * sigma);
  EXPECT_LT(sigma, 0.3e-3);
  ASSERT_EQ(summary["common"].size(), 6u);
  EXPECT_EQ(summary["common"][0]["set_up"], "wall");
  const Outcome text = Run({"calibrate", "two.csv", "-o", "rig.h5", "--order", "quintic-even"});
  EXPECT_THAT(text.out, HasSubstr("set-up \"wall\""));
  EXPECT_THAT(text.out, HasSubstr("is off from \"door\""));
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"check", "rig.h5", "two.csv"}), {"two.csv:set_up", "2 set-ups"}, before);
  ExpectRefused(Run({"calibrate", "two.csv", "-o", "x.h5", "--station", "4", "0", "1"}),
                {"two.csv", "2 set-ups"}, before);
  std::string unnamed = Get("two.csv");
  unnamed.replace(unnamed.rfind(",door,"), 6, ",,");
  Put("unnamed.csv", unnamed);
  ExpectRefused(Run({"calibrate", "unnamed.csv", "-o", "x.h5"}), {"unnamed.csv:", ":set_up"},
                Files());
  EXPECT_THAT(Run({"calibrate", "--help"}).out, HasSubstr("set_up"));
}

TEST_F(RigVerbs, BadInput) {
  ExpectRefused(Run({"plan", "nowhere.toml"}), {"nowhere.toml"}, {});
  ExpectRefused(Run({"check", Shipped("rig.h5"), Shipped("points.csv")}), {"points.csv"}, {});
  ExpectRefused(Run({"calibrate", Shipped("survey.h5"), "--order", "nonic"}),
                {"nonic", "quintic-even"}, {});
  ExpectRefused(Run({"check", Shipped("rig.h5"), Shipped("survey.h5"), "--bar-sigma", "1e-5"}),
                {"--bar"}, {});
  Put("points.gsi", "110001+00000P01 81..00+00001000 82..00+00002000 83..00+00000500\n");
  ExpectRefused(Run({"calibrate", "points.gsi"}), {"points.gsi", "--readings"}, {"points.gsi"});
}

}  // namespace
}  // namespace unfurl::cli::rig_test
