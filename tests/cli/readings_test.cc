// `unfurl reconstruct` of readings, as a person uses it: those that a survey's cameras had of
// places in a row stand for a trial's.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial_health.h"
#include "tests/cli/program.h"

namespace unfurl::cli::readings_test {
namespace {

using ::testing::HasSubstr;

class ReadingsVerb : public ProgramTest {
 protected:
  static constexpr int kPlaces = 150;
  static Eigen::Vector3d Place(int i) {
    return {-0.7 + 0.01 * i, 0.6 * std::sin(0.08 * i), 0.5 * std::cos(0.05 * i)};
  }

  // readings.csv of a mark that winds through the volume, seen through glass and sensors of the
  // shipped laboratory.
  void Record() const {
    std::string places = "id,x [m],y [m],z [m]\n";
    for (int i = 0; i < kPlaces; ++i) {
      const Eigen::Vector3d p = Place(i);
      places += fmt::format("{},{},{},{}\n", i, p.x(), p.y(), p.z());
    }
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
        readings += fmt::format("{},tip,{},{},{}\n", 0.02 * i, survey.cameras[c],
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
    EXPECT_LT((tracks.p.col(i) - Place(i)).norm(), 5 * 1.8 * 0.06e-3) << i;
  }
  EXPECT_THAT(Run({"info", "tracks.h5"}).out, HasSubstr("readings.csv"));
}

// A camera that moved by 1 px before the trial: named first, left out, or put right.
TEST_F(ReadingsVerb, AMovedCameraIsSaidFirst) {
  Record();
  std::istringstream rows(Get("readings.csv"));
  std::string moved, row;
  while (std::getline(rows, row)) {
    const std::string name = ",north_west,";
    const std::size_t at = row.find(name);
    if (at != std::string::npos) {
      const std::size_t from = at + name.size(), to = row.find(',', from);
      row = row.substr(0, from) + fmt::format("{}", std::stod(row.substr(from)) + 1.0) +
            row.substr(to);
    }
    moved += row + "\n";
  }
  Put("moved.csv", moved);
  for (const bool correct : {false, true}) {
    std::vector<std::string> command = {"reconstruct", "moved.csv", "--rig",    Shipped("rig.h5"),
                                        "-o",          "tracks.h5", "--report", "page.html"};
    if (correct) command.push_back("--correct");
    const Outcome text = Run(command);
    ASSERT_EQ(text.code, 0) << text.out << text.err;
    EXPECT_EQ(text.out.find("camera "), 0U) << text.out;
    EXPECT_THAT(text.out, HasSubstr("moved by"));
    const data::TrialHealth health = data::ReadTrialHealth((folder_ / "tracks.h5").string());
    ASSERT_EQ(health.words.size(), 1U);
    EXPECT_EQ(health.corrected, correct);
    EXPECT_EQ(health.cameras[static_cast<std::size_t>(health.camera[0])], "north_west");
    EXPECT_NEAR(health.size[0], 1.0, 0.1);
    EXPECT_FALSE(std::isfinite(health.from[0]));
    EXPECT_EQ(health.offset_px.rows(), static_cast<Eigen::Index>(health.t.size()));
    EXPECT_THAT(Get("page.html"), HasSubstr(health.words[0]));
    command.push_back("--json");
    const auto json = nlohmann::json::parse(Run(command).out);
    EXPECT_EQ(json["health"]["faults"][0]["camera"], "north_west");
    EXPECT_EQ(json["health"]["faults"][0]["words"], health.words[0]);
    EXPECT_EQ(json["health"]["faults"][0]["certain"], true);
    EXPECT_EQ(json["usable"], kPlaces);
  }
}

// A mark at rest, and two of four cameras bumped: any of them explains that, and that is no
// success.
TEST_F(ReadingsVerb, WhatNobodyCanTellApartEndsInOne) {
  Record();
  std::istringstream rows(Get("readings.csv"));
  std::string text, row;
  std::getline(rows, row);
  text = row + "\n";
  std::vector<std::string> place;  // the first: ",tip,CAMERA,u,s" by camera
  while (place.size() < 4 && std::getline(rows, row)) place.push_back(row.substr(row.find(',')));
  for (int i = 0; i < kPlaces; ++i) {
    for (std::size_t c = 0; c < place.size(); ++c) {
      const std::size_t from = place[c].rfind(',', place[c].rfind(',') - 1) + 1;
      const std::size_t to = place[c].find(',', from);
      const double bump = 3 * i >= 2 * kPlaces ? 2.0 * static_cast<double>(c == 1) - (c == 3) : 0.0;
      const double u = std::stod(place[c].substr(from)) + bump + 0.01 * ((i + c) % 3);
      text += fmt::format("{}{}{}{}\n", 0.02 * i, place[c].substr(0, from), u, place[c].substr(to));
    }
  }
  Put("still.csv", text);
  const Outcome outcome =
      Run({"reconstruct", "still.csv", "--rig", Shipped("rig.h5"), "-o", "tracks.h5"});
  EXPECT_EQ(outcome.code, 1) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("not usable: camera "));
  EXPECT_THAT(outcome.err, HasSubstr("it cannot be told which"));
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
  Put("readings.csv", good + "7.0,tip,attic,5,0.1\n");
  ExpectRefused(Run(command), {"readings.csv", "'attic'", "name its cameras as the rig does"},
                files);
  Put("readings.csv", good + "7.0,tip,north_east,5,-0.1\n");
  ExpectRefused(Run(command), {fmt::format("readings.csv:{}:s", 4 * kPlaces + 2), "impossible"},
                files);
  Put("readings.csv", good + "7.0,tip,north_east,5000,0.1\n");
  ExpectRefused(Run(command), {"readings.csv", "reads 5000 px at 7 s", "2160 pixels"}, files);
}

}  // namespace
}  // namespace unfurl::cli::readings_test
