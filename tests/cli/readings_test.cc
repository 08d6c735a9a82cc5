// `unfurl reconstruct` of readings, as a person uses it: those that a survey's cameras had of
// places in a row stand for a trial's.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "data/survey.h"
#include "data/tracks.h"
#include "tests/cli/program.h"

namespace unfurl::cli {
namespace {

using ::testing::HasSubstr;

class ReadingsVerb : public ProgramTest {
 protected:
  static constexpr int kPlaces = 60;
  static double X(int i) { return -0.5 + 0.01 * i; }

  // readings.csv of a mark that goes along x through glass and sensors of the shipped laboratory.
  void Record() const {
    std::string places = "id,x [m],y [m],z [m]\n";
    for (int i = 0; i < kPlaces; ++i) places += fmt::format("{},{},0.1,0.2\n", i, X(i));
    Put("places.csv", places);
    ASSERT_EQ(Run({"expose", "--survey", "places.csv", "--lab", Shipped("lab.toml"), "-o",
                   "lines.h5", "--quiet"})
                  .code,
              0);
    ASSERT_EQ(Run({"convert", "lines.h5", "survey.csv", "--quiet"}).code, 0);
    const data::Survey survey = data::ReadSurvey((folder_ / "survey.csv").string());
    std::string readings = "time [s],mark,camera,u [px],s [px]\n";
    for (int i = 0; i < kPlaces; ++i) {
      for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
        const auto at = static_cast<Eigen::Index>(c);
        readings += fmt::format("{},tip,{},{},{}\n", 0.01 * i, survey.cameras[c],
                                survey.u_px(i, at), survey.s_px(i, at));
      }
    }
    Put("readings.csv", readings);
    for (const char* name : {"places.csv", "lines.h5", "survey.csv"}) {
      std::filesystem::remove(folder_ / name);
    }
  }
};

TEST_F(ReadingsVerb, BecomeTracksThatAreWhereTheMarkWas) {
  Record();
  const Outcome outcome = Run({"reconstruct", "readings.csv", "--rig", Shipped("rig.h5"), "-o",
                               "tracks.h5", "--report", "page.html", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["usable"], kPlaces);
  const data::Tracks tracks = data::ReadTracks((folder_ / "tracks.h5").string());
  ASSERT_EQ(tracks.size(), std::size_t{kPlaces});
  for (int i = 0; i < kPlaces; ++i) {
    // Five of its sigmas of 0.06 mm an axis, readings and calibration.
    EXPECT_LT((tracks.p.col(i) - Eigen::Vector3d(X(i), 0.1, 0.2)).norm(), 5 * 1.8 * 0.06e-3) << i;
  }
  EXPECT_THAT(Run({"info", "tracks.h5"}).out, HasSubstr("readings.csv"));
}

TEST_F(ReadingsVerb, WhatIsNoReadingIsRefused) {
  Record();
  const std::vector<std::string> files = {"readings.csv"};
  const std::vector<std::string> command = {"reconstruct",     "readings.csv", "--rig",
                                            Shipped("rig.h5"), "-o",           "tracks.h5"};
  const auto with = [&](const std::string& option, const std::string& value) {
    std::vector<std::string> all = command;
    all.insert(all.end(), {option, value});
    return all;
  };
  ExpectRefused(Run(with("--picture", "streaks.png")), {"readings.csv", "holds readings", "leave"},
                files);
  const std::string good = Get("readings.csv");
  Put("readings.csv", good + "0.7,tip,attic,5,0.1\n");
  ExpectRefused(Run(command), {"readings.csv", "'attic'", "name its cameras as the rig does"},
                files);
  Put("readings.csv", good + "0.7,tip,north_east,5,-0.1\n");
  ExpectRefused(Run(command), {fmt::format("readings.csv:{}:s", 4 * kPlaces + 2), "impossible"},
                files);
  Put("readings.csv", good + "0.7,tip,north_east,5000,0.1\n");
  ExpectRefused(Run(command), {"readings.csv", "reads 5000 px at 0.7 s", "2160 pixels"}, files);
}

}  // namespace
}  // namespace unfurl::cli
