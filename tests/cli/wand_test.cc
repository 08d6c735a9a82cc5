// `unfurl calibrate --wand` as a person uses it, on a bar waved before the shipped laboratory: rays
// through its glass, its sensors' lines, spots found in them.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/random.h"
#include "tests/cli/program.h"

namespace unfurl::cli::wand_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kBar = 0.75;  // [m]

class WandVerb : public ProgramTest {
 protected:
  // wand.csv of a bar in `poses` poses, ids 1a, 1b, 2a, ..; few.csv of ten places.
  void Wave(int poses) const {
    Rng rng(7);
    std::string bar = "id,x [m],y [m],z [m]\n", few = bar;
    for (int k = 1; k <= poses; ++k) {
      double middle[3], direction[3], square = 0.0;
      for (int i = 0; i < 3; ++i) {
        middle[i] = rng.Uniform(-0.8, 0.8);
        direction[i] = rng.Normal();
        square += direction[i] * direction[i];
      }
      for (const int end : {-1, 1}) {
        const double step = 0.5 * kBar * end / std::sqrt(square);
        bar +=
            fmt::format("{}{},{},{},{}\n", k, end < 0 ? 'a' : 'b', middle[0] + step * direction[0],
                        middle[1] + step * direction[1], middle[2] + step * direction[2]);
      }
    }
    for (int k = 1; k <= 10; ++k) {
      few += fmt::format("P{},{},{},{}\n", k, rng.Uniform(-1.0, 1.0), rng.Uniform(-1.0, 1.0),
                         rng.Uniform(-1.0, 1.0));
    }
    Expose(bar, "wand");
    Expose(few, "few");
  }
  void Expose(const std::string& places, const std::string& name) const {
    Put("places.csv", places);
    ASSERT_EQ(Run({"expose", "--survey", "places.csv", "--lab", Shipped("lab.toml"), "-o",
                   "lines.h5", "--quiet"})
                  .code,
              0);
    ASSERT_EQ(Run({"convert", "lines.h5", name + ".csv", "--quiet"}).code, 0);
    for (const char* file : {"places.csv", "lines.h5"}) std::filesystem::remove(folder_ / file);
  }
  Outcome Calibrate(std::vector<std::string> more) const {
    std::vector<std::string> arguments = {"calibrate", "--wand", "wand.csv", "--bar",
                                          "0.75m+-0.1mm"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }
};

TEST_F(WandVerb, ByPointsItIsTheSurveysFrame) {
  Wave(120);
  const Outcome made =
      Calibrate({"--points", "few.csv", "-o", "rig.h5", "--report", "page.html", "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  const auto summary = nlohmann::json::parse(made.out);
  EXPECT_EQ(summary["verdict"], "good");
  EXPECT_EQ(summary["frame"], "by the surveyed points");
  EXPECT_EQ(summary["poses"], 120);
  EXPECT_NEAR(summary["marks"][1]["place"].get<double>(), kBar, 3e-4);  // 3 sigma
  EXPECT_LT(summary["checks"]["held_out_length_rms [m]"].get<double>(), 2e-4);
  EXPECT_THAT(Get("page.html"),
              AllOf(HasSubstr("good"), HasSubstr("The bar, x and y"), HasSubstr("held-out poses")));
  // The same points, seen with other noise, are where the rig finds them.
  const Outcome checked = Run({"check", "rig.h5", "few.csv", "--json"});
  EXPECT_EQ(nlohmann::json::parse(checked.out)["verdict"], "still valid") << checked.out;
}

// 25 poses before cameras whose lenses the shipped rig knows, and which did not move.
TEST_F(WandVerb, LensesFromBefore) {
  Wave(25);
  const std::string rig = Shipped("rig.h5");
  const auto lenses = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--lenses", rig, "--json", "-o", "rig.h5", "--report", "page.html"});
    const Outcome made = Calibrate(more);
    EXPECT_EQ(made.code, 0) << made.err;
    return nlohmann::json::parse(made.out)["lenses"];
  };
  const auto placed = lenses({"--points", "few.csv"});
  ASSERT_EQ(placed.size(), 4);
  for (const auto& lens : placed) {
    EXPECT_GT(lens["chance"].get<double>(), 1e-4);
    EXPECT_LT(lens["turned"].get<double>(), 5.0 * lens["turned_sigma"].get<double>());
  }
  EXPECT_THAT(Get("page.html"), HasSubstr("from where it was when its lens was calibrated"));
  const auto alone = lenses({});  // in a frame of its own
  ASSERT_EQ(alone.size(), 4);
  for (const auto& lens : alone) EXPECT_TRUE(lens["moved"].is_null());
  EXPECT_THAT(Get("page.html"), ::testing::Not(HasSubstr("from where it was")));
}

TEST_F(WandVerb, WithoutPointsTheFrameIsSaid) {
  Wave(80);
  const auto frame = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--json", "-o", more.empty() ? "own.h5" : "rig.h5"});
    const Outcome made = Calibrate(more);
    EXPECT_EQ(made.code, 0) << made.err;
    return nlohmann::json::parse(made.out)["frame"].get<std::string>();
  };
  EXPECT_THAT(frame({"--layout", Shipped("lab.toml")}), HasSubstr("by the planned places"));
  EXPECT_THAT(frame({"--frame", "north_east,north_west,south_west"}), HasSubstr("by cameras"));
  EXPECT_THAT(frame({}), HasSubstr("its own"));
  EXPECT_THAT(frame({"--plumb", "3", "--origin", "4", "--from", "own.h5"}),
              HasSubstr("by gravity"));
}

TEST_F(WandVerb, BadInputIsRefusedByName) {
  Wave(30);
  const std::string good = Get("wand.csv");
  const std::vector<std::string> files = {"few.csv", "wand.csv"};
  const auto refused = [&](const std::vector<std::string>& more,
                           const std::vector<std::string>& words) {
    ExpectRefused(Calibrate(more), words, files);
  };
  refused({"--order", "cubi"}, {"--order", "cubi", "give one of"});
  refused({"--sigma", "1e-3"}, {"--sigma excludes --wand"});
  refused({"--readings", "few.csv"}, {"--readings", "beside --wand", "--points"});
  refused({"--frame", "a,b,c"}, {"wand.csv", "no camera \"a\"", "name cameras"});
  refused({"--plumb", "3"}, {"--plumb", "--origin"});
  refused({"--plumb", "3", "--origin", "nowhere"}, {"no pose \"nowhere\"", "name a pose"});
  refused({"few.csv"}, {"SURVEY", "beside --wand", "--points"});
  refused({"--from", "few.csv"}, {"few.csv", "HDF5"});
  refused({"--points", "nowhere.csv"}, {"nowhere.csv", "check the name"});
  ExpectRefused(Run({"calibrate", "--wand", "wand.csv"}), {"--bar", "0.7501m+-0.1mm"}, files);
  ExpectRefused(Run({"calibrate", "--wand", "wand.csv", "--bar", "0.75m"}),
                {"--bar", "how well it is known"}, files);
  ExpectRefused(Run({"calibrate", "--wand", "wand.csv", "--bar", "0.3m,0.75m+-1mm"}),
                {"wand.csv", "2 marks (a and b), but the bar has 3"}, files);
  ExpectRefused(Run({"calibrate", "few.csv", "--bar", "0.75m+-0.1mm"}), {"--bar requires --wand"},
                files);
  ExpectRefused(Run({"calibrate"}), {"SURVEY", "--wand"}, files);

  const std::size_t second = good.find("\n1b,");
  Put("wand.csv", good.substr(0, second) + "\n1a" + good.substr(second + 3));
  refused({}, {"wand.csv:5:id", "mark 'a' of pose '1' comes twice"});
  // Nine poses; two of them that nobody can tell apart in time is the reader's test.
  Put("wand.csv", good.substr(0, good.find("\n10a,") + 1));
  refused({}, {"wand.csv", "9 poses", "at least 20"});
  Put("wand.csv", good);  // points beside a bar are in one frame
  std::istringstream few(Get("few.csv"));
  std::string two, line;
  for (int row = -1; std::getline(few, line);) {
    if (!line.starts_with('#')) line += row++ < 0 ? ",set_up" : row % 2 == 0 ? ",door" : ",wall";
    two += line + "\n";
  }
  Put("two.csv", two);
  ExpectRefused(Calibrate({"--points", "two.csv"}), {"two.csv:set_up", "2 set-ups"},
                {"few.csv", "two.csv", "wand.csv"});
}

TEST_F(WandVerb, ReadingsOfABarAreConvertedAndAreNoSurvey) {
  Put("bar.csv",
      "# cameras: a, b, c\npose,mark,u1 [px],s1 [px],u2 [px],s2 [px],u3 [px],s3 [px]\n"
      "1,a,5.25,0.1,6,0.1,7,0.1\n1,b,8,0.1,,,9.5,0.1\n");
  ASSERT_EQ(Run({"convert", "bar.csv", "bar.h5"}).code, 0);
  ASSERT_EQ(Run({"convert", "bar.h5", "again.csv"}).code, 0);
  EXPECT_THAT(Get("again.csv"),
              AllOf(HasSubstr("# cameras: a, b, c"), HasSubstr("\n1,a,5.25,0.1,6"),
                    HasSubstr("\n1,b,8,0.1,,,9.5,0.1")));
  const std::vector<std::string> files = Files();
  ExpectRefused(Run({"convert", "bar.csv", "bar.c3d"}),
                {"bar.c3d", "readings of a bar cannot become '.c3d'"}, files);
  ExpectRefused(Run({"calibrate", "bar.csv"}), {"bar.csv", "holds readings of a bar", "--wand"},
                files);
}

}  // namespace
}  // namespace unfurl::cli::wand_test
