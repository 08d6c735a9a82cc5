// `unfurl expose` and `unfurl reconstruct` where the room is against it: they work, or say by name
// what is missing, and never give a wild point.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "data/run.h"
#include "data/tracks.h"
#include "tests/cli/program.h"

namespace unfurl::cli::hard_rooms_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr double kWild = 5e-3;  // beyond the rig's own error, 0.2 mm, many times over [m]

class HardRooms : public ProgramTest {
 protected:
  // Four marks on ellipses about the middle of the shipped volume, drifting along x.
  void PutRun(double duration, double drift = 0.0) const {
    data::RunLayout layout;
    layout.marks = {"mark1", "mark1b", "mark2", "mark3"};
    for (const std::string& mark : layout.marks) {
      for (const char* axis : {".x", ".y", ".vx", ".vy"}) {
        layout.quantities.push_back({mark + axis, axis[1] == 'v' ? "m/s" : "m", ""});
      }
    }
    data::RunWriter writer((folder_ / "run.h5").string(), {}, layout);
    for (int i = 0; i <= std::lround(duration * 1000.0); ++i) {
      const double t = 1e-3 * i;
      std::vector<double> values;
      for (int m = 0; m < 4; ++m) {
        const double reach = 0.15 + 0.3 * m, at = (2.0 - 0.3 * m) * t + m, rate = 2.0 - 0.3 * m;
        values.insert(values.end(),
                      {0.8 + reach * std::sin(at) + drift * t, 0.2 + 0.6 * reach * std::cos(at),
                       reach * rate * std::cos(at) + drift, -0.6 * reach * rate * std::sin(at)});
      }
      writer.Append(t, values);
    }
    writer.SetText("status", "good");
    writer.Commit();
  }

  // A lab of the shipped one's cameras with more in it.
  void PutLab(const std::string& more, const std::string& base = "lab.toml") const {
    Put("room.toml", "include = [\"" + Shipped(base) + "\"]\n" + more);
  }

  struct Result {
    Outcome expose, reconstruct;
    json summary;
    std::size_t samples = 0, usable = 0;
    double worst = 0.0;  // of what is claimed [m]
    double Share() const { return static_cast<double>(usable) / static_cast<double>(samples); }
  };
  Result Record(const std::vector<std::string>& more = {},
                const std::vector<std::string>& reconstruct = {}) const {
    Result result;
    std::vector<std::string> expose = {"expose",    "run.h5",  "--lab",
                                       "room.toml", "--truth", "truth.h5",
                                       "--quiet",   "--set",   "strobe.lead=[0.05, 0.06]"};
    for (const std::string& setting : more) expose.insert(expose.end(), {"--set", setting});
    result.expose = Run(expose);
    EXPECT_EQ(result.expose.code, 0) << result.expose.err;
    if (result.expose.code != 0) return result;
    std::vector<std::string> arguments = {"reconstruct", "trial.h5", "--rig", Shipped("rig.h5"),
                                          "--json"};
    arguments.insert(arguments.end(), reconstruct.begin(), reconstruct.end());
    result.reconstruct = Run(arguments);
    EXPECT_LE(result.reconstruct.code, 1) << result.reconstruct.err;
    if (result.reconstruct.code > 1) return result;
    result.summary = json::parse(result.reconstruct.out);
    const data::Tracks truth = data::ReadTracks((folder_ / "truth.h5").string());
    const data::Tracks tracks = data::ReadTracks((folder_ / "tracks.h5").string());
    EXPECT_EQ(tracks.size(), truth.size());
    result.samples = tracks.size();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (!data::Usable(tracks.status[i])) continue;
      ++result.usable;
      const auto col = static_cast<Eigen::Index>(i);
      // Marks that are lit together come in the order of the slot's name in both.
      EXPECT_EQ(tracks.t[i], truth.t[i]);
      EXPECT_EQ(tracks.marks[static_cast<std::size_t>(tracks.mark[i])],
                truth.marks[static_cast<std::size_t>(truth.mark[i])]);
      result.worst = std::max(result.worst, (tracks.p.col(col) - truth.p.col(col)).norm());
    }
    EXPECT_LT(result.worst, kWild);
    return result;
  }
};

TEST_F(HardRooms, LowLight) {
  PutRun(0.1);
  PutLab("");
  const Result dim = Record({"led.peak=0.02"});  // 80 counts at the best place
  EXPECT_GT(dim.Share(), 0.9);
  const Result dark = Record({"led.peak=0.0005"});
  EXPECT_EQ(dark.usable, 0U);
  EXPECT_EQ(dark.reconstruct.code, 1);
  EXPECT_GT(dark.summary["unsolved"]["too few readings"].get<std::size_t>(), 0U);
}

TEST_F(HardRooms, MainsFlickerAndAllThatARoomAlwaysHas) {
  PutRun(0.1);
  PutLab("", "lab_full.toml");
  EXPECT_EQ(Record().Share(), 1.0);
  EXPECT_GT(Record({"ambient.level=1e7", "ambient.flicker=1.0"}).Share(), 0.95);
}

TEST_F(HardRooms, SaturationIsFlaggedAndRefused) {
  PutRun(0.1);
  PutLab("");
  const Result bright = Record({"led.peak=3.0", "sensor.blooming=0.3"});
  // A spot of full pixels has too little left to be read; where its tails are wide, it is.
  EXPECT_LT(bright.Share(), 0.5);
  // The others have three readings that nothing before or after vouches for.
  EXPECT_GT(2 * bright.summary["unsolved"]["too few readings"].get<std::size_t>(),
            bright.samples - bright.usable);
  EXPECT_EQ(bright.reconstruct.code, 1);
  EXPECT_THAT(bright.reconstruct.err, testing::HasSubstr("samples have a position"));
}

TEST_F(HardRooms, MarksThatLeaveTheView) {
  // 8 m/s for 0.3 s: out of the volume, over the edges of the sensors, out of sight.
  PutRun(0.3, 8.0);
  PutLab("");
  const Result result = Record();
  EXPECT_GT(result.usable, 100U);
  ASSERT_LT(result.usable, result.samples);
  EXPECT_GT(result.summary["unsolved"]["too few readings"].get<std::size_t>(), 10U);
}

TEST_F(HardRooms, TwoCamerasOnlyAreTooFew) {
  // Screens before two of the four, on one side: what they leave is two planes that meet in a line.
  PutRun(0.1);
  PutLab(
      "[occluder.one]\ncentre = [0.9, 0.9, 2.6]\nnormal = [0.3, 0.3, 0.9]\nradius = 0.4\n"
      "[occluder.two]\ncentre = [0.9, -0.9, 2.6]\nnormal = [0.3, -0.3, 0.9]\nradius = 0.4\n");
  const Result result = Record();
  EXPECT_EQ(result.usable, 0U);
  EXPECT_EQ(result.reconstruct.code, 1);
  EXPECT_EQ(result.summary["unsolved"]["too few readings"].get<std::size_t>(), result.samples);
}

TEST_F(HardRooms, MirrorLampAndPasserBy) {
  PutRun(0.1);
  PutLab(
      "[reflection.pane]\ncentre = [1.6, 0.0, 0.5]\nnormal = [1.0, 0.0, 0.0]\nradius = 1.5\n"
      "reflectance = 0.5\n"
      "[lamp.exit]\nposition = [-0.6, 0.9, 0.4]\nbrightness = 0.3\nflicker = 0.5\n"
      "[occluder.passer_by]\ncentre = [0.4, 0.4, 1.2]\nnormal = [0.0, 0.0, 1.0]\nradius = 0.15\n"
      "from = 0.05\nuntil = 0.1\n");
  EXPECT_GT(Record().Share(), 0.9);
}

TEST_F(HardRooms, MarksLitTogether) {
  PutRun(0.15);
  PutLab("");
  const std::string slots = "strobe.slots=[\"mark1+mark3\", \"mark1b+mark2\", \"dark\"]";
  // Where they start, to a centimetre.
  Put("start.csv",
      "mark,x [m],y [m],z [m]\nmark1,-0.045,-0.009,0.001\nmark1b,0.335,0.048,0\n"
      "mark2,0.642,-0.272,0\nmark3,0.110,-0.709,0.005\n");
  const Result unnamed = Record({slots});
  EXPECT_GT(unnamed.samples, 200U);
  EXPECT_GT(unnamed.Share(), 0.9);
  EXPECT_EQ(unnamed.summary["named_by_place"].size(), 4U);
  const Result named = Record({slots}, {"--start", "start.csv"});
  EXPECT_GT(named.Share(), 0.9);
  EXPECT_FALSE(named.summary.contains("named_by_place"));
}

TEST_F(HardRooms, WhatIsNotThereIsNamed) {
  Put("room.toml", "include = [\"" + Shipped("lab.toml") + "\"]\n");
  const std::vector<std::string> before = {"room.toml"};
  ExpectRefused(Run({"expose", "run.h5", "--lab", "room.toml", "--seed", "7"}),
                {"`unfurl expose` has no option --seed", "unfurl expose --help"}, before);
  ExpectRefused(Run({"expose", "--survey", "points.csv", "--lab=room.toml", "--seed", "7"}),
                {"`unfurl expose` has no option --seed"}, before);
  ExpectRefused(Run({"expose", "run.h5", "--lab", "room.toml", "--set", "led.peek=0.1"}),
                {"led.peek"}, before);
  ExpectRefused(Run({"expose", "run.h5", "--lab", "room.toml", "--set",
                     "occluder.arm.centre=[0.0, 0.0, 1.0]"}),
                {"occluder.arm"}, before);
  PutRun(0.05);
  ExpectRefused(Run({"expose", "run.h5", "--lab", "room.toml", "--set",
                     "strobe.slots=[\"mark1+mark9\", \"dark\"]"}),
                {"run.h5", "mark9"}, {"room.toml", "run.h5"});
}

}  // namespace
}  // namespace unfurl::cli::hard_rooms_test
