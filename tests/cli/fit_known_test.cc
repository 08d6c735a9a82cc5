// What is known of a trial's clock, frame and units, through the real program.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "data/fit.h"
#include "data/tracks.h"
#include "tests/cli/fit_cases.h"
#include "tests/source_dir.h"

namespace unfurl::cli::fit_known_test {
namespace {

using ::testing::HasSubstr;

constexpr char kQuick[] = "[profile]\nlevels = []\n";

class FitKnownTest : public FitVerbTest {
 protected:
  void SetUp() override {
    FitVerbTest::SetUp();
    MakeTracks("tracks.h5", {}, 5);
  }
  // The tracks with their times and lengths changed.
  void Rewrite(const std::string& name, const std::function<void(data::Tracks*)>& change) const {
    data::Tracks tracks = data::ReadTracks((folder_ / "tracks.h5").string());
    change(&tracks);
    data::WriteTracks((folder_ / name).string(), tracks, data::Provenance{});
  }
  nlohmann::json Fitted(const std::string& trial) const {
    MakeStudy("study.toml", "[trial]\ntracks = \"tracks.h5\"\nwindow = [0.0, 0.8]\n" + trial,
              kQuick);
    return nlohmann::json::parse(Good({"fit", "study.toml", "-o", "fit.h5", "--json"}).out);
  }
};

std::vector<std::string> Names(const nlohmann::json& fit) {
  std::vector<std::string> out;
  for (const auto& n : fit.value("nuisances", nlohmann::json::array())) out.push_back(n.at("name"));
  return out;
}

std::string Reasons(const nlohmann::json& fit) {
  std::string all;
  for (const auto& reason : fit.at("reasons")) all += std::string(reason) + "\n";
  return all;
}

TEST_F(FitKnownTest, WhatIsKnownIsNotFittedAndIsReported) {
  const nlohmann::json all = Fitted("offset = 0.0\nframe = \"known\"\ndrift = \"known\"\n");
  EXPECT_TRUE(Names(all).empty());
  EXPECT_THAT(Reasons(all), HasSubstr("The time offset was known, 0 s, and not sought."));
  EXPECT_THAT(Reasons(all), HasSubstr("The frame was known, and not sought."));
  const nlohmann::json free = Fitted("");
  const nlohmann::json some = Fitted(
      "offset = { mean = 1e-4, sigma = 1e-4 }\nframe = { sigma_rotation = 1e-3, sigma_shift = 1e-3 "
      "}\ndrift = \"free\"\n");
  EXPECT_THAT(Names(some), ::testing::IsSupersetOf({"time offset", "clock drift"}));
  EXPECT_THAT(Reasons(some), HasSubstr("known beforehand"));
  for (std::size_t j = 0; j < 2; ++j) {  // what is known cannot make the values worse known
    EXPECT_LE(double(all.at("parameters")[j].at("sigma_data")),
              1.02 * double(free.at("parameters")[j].at("sigma_data")));
    EXPECT_NEAR(double(all.at("parameters")[j].at("value")),
                double(free.at("parameters")[j].at("value")),
                4.0 * double(free.at("parameters")[j].at("sigma")));
  }
  const Outcome text = Good({"correlate", "tracks.h5", "truth.h5", "--offset", "0", "--frame",
                             "known", "--drift", "0+-1e-4"});
  EXPECT_THAT(text.out, HasSubstr("that was known, and not sought"));
  EXPECT_THAT(text.out, HasSubstr("Its frame was known, and not sought."));
}

TEST_F(FitKnownTest, NonsenseIsRefused) {
  MakeStudy("study.toml", "[trial]\ntracks = \"tracks.h5\"\n", kQuick);
  for (const char* set :
       {"trial.offset=\"about\"", "trial.offset={mean=0.1, sigma=0.0}", "trial.drift=2.0",
        "trial.frame={sigma_shift=1e-3}", "trial.frame={rotation=[0.0, 1.0]}"}) {
    ExpectRefused(Run({"fit", "study.toml", "--set", set}), {"trial."}, Files());
  }
  for (const auto& [option, value] : std::vector<std::pair<std::string, std::string>>{
           {"--offset", "soon"}, {"--offset", "0.1+-0"}, {"--drift", "nan"}, {"--frame", "1e-3"}}) {
    ExpectRefused(Run({"correlate", "tracks.h5", "truth.h5", option, value}), {option}, Files());
  }
}

// A tenth too short, and the clock known: that is what is reported, and no shift in time.
TEST_F(FitKnownTest, AWrongScaleIsNotHiddenByAShiftInTime) {
  Rewrite("short.h5", [](data::Tracks* t) { t->p *= 0.9; });
  const Outcome known = Good({"correlate", "short.h5", "truth.h5", "--offset", "known", "--json"});
  const auto json = nlohmann::json::parse(known.out);
  EXPECT_EQ(json.at("time_offset").at("value"), 0.0);
  EXPECT_GT(double(json.at("chi2_per_dof")), 100.0);
}

TEST_F(FitKnownTest, MillisecondsAndMillimetresAreNamedAtOnce) {
  Rewrite("ms.h5", [](data::Tracks* t) {
    for (double& stamp : t->t) stamp *= 1e3;
  });
  Rewrite("mm.h5", [](data::Tracks* t) {
    t->p *= 1e3;
    t->cov *= 1e6;
  });
  MakeStudy("study.toml", "[trial]\ntracks = \"tracks.h5\"\n", kQuick);
  for (const auto& [file, unit] : std::vector<std::pair<std::string, std::string>>{
           {"ms.h5", "milliseconds"}, {"mm.h5", "millimetres"}}) {
    ExpectRefused(Run({"fit", "study.toml", "--tracks", file}), {file, unit, "convert"}, Files());
    const Outcome compared = Run({"correlate", file, "truth.h5"});
    EXPECT_EQ(compared.code, 1);
    EXPECT_THAT(compared.out, HasSubstr(unit));
  }
}

// One sample in twenty is off by centimetres.
TEST_F(FitKnownTest, GrossErrorsAreNamed) {
  const nlohmann::json clean = Fitted("");
  EXPECT_FALSE(clean.contains("gross"));
  std::size_t planted = 0;
  data::Tracks tracks = data::ReadTracks((folder_ / "tracks.h5").string());
  for (std::size_t i = 7; i < tracks.t.size() && tracks.t[i] < 0.8; i += 20, ++planted) {
    tracks.p.col(static_cast<Eigen::Index>(i)) +=
        Eigen::Vector3d(0.03, -0.05, 0.02) * (planted % 2 == 0 ? 1.0 : -0.6);
  }
  data::WriteTracks((folder_ / "tracks.h5").string(), tracks, data::Provenance{});
  const nlohmann::json fit = Fitted("");
  EXPECT_EQ(fit.at("gross").size(), planted);
  EXPECT_THAT(Reasons(fit), HasSubstr("Gross errors, which count for next to nothing"));
  EXPECT_EQ(data::ReadFit((folder_ / "fit.h5").string()).gross.size(), planted);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_NEAR(double(fit.at("parameters")[j].at("value")),
                double(clean.at("parameters")[j].at("value")),
                double(clean.at("parameters")[j].at("sigma_data")));
  }
}

// A program of closed form: a swing whose frequency comes out a thousandth too low unless --fine.
constexpr char kSwing[] = R"(set -e
awk -F, -v f={{frequency}} -v d={{decay}} -v part=$1 'NR == 1 { print "mark,t [s],x [m],y [m]"; next }
{ t = $2 > 0 ? $2 : 0; w = 6.283185307179586 * f * (1 - part)
  q = 1.2 * exp(-d * t) * cos(w * t); r = $1 == "tip" ? 1.6 : 0.8
  printf "%s,%.17g,%.12f,%.12f\n", $1, $2, r * cos(q) + (r > 1 ? 0.1 * q : 0), r * sin(q) }' stamps.csv > tracks.csv
)";

class FitProgramTest : public FitVerbTest {
 protected:
  void SetUp() override {
    FitVerbTest::SetUp();
    Put("swing.sh", kSwing);
    // Data by the finer program's own formula, at f = 0.9 Hz and d = 0.35 1/s, 0.2 mm of noise.
    Rng rng(3);
    data::Tracks tracks;
    tracks.frame = "rig";
    tracks.marks = {"mid", "tip"};
    constexpr int kSteps = 150;
    tracks.p.resize(3, 2 * kSteps);
    tracks.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, 2 * kSteps);
    tracks.shared.resize(3, 0);
    for (int i = 0; i < 2 * kSteps; ++i) {
      const double t = 0.02 * (i / 2), r = i % 2 == 1 ? 1.6 : 0.8;
      const double q = 1.2 * std::exp(-0.35 * t) * std::cos(6.283185307179586 * 0.9 * t);
      tracks.t.push_back(t);
      tracks.mark.push_back(i % 2);
      tracks.status.push_back(data::SampleStatus::kGood);
      tracks.p.col(i) << r * std::cos(q) + (r > 1.0 ? 0.1 * q : 0.0) + 2e-4 * rng.Normal(),
          r * std::sin(q) + 2e-4 * rng.Normal(), 2e-4 * rng.Normal();
      for (int row : {0, 3, 5}) tracks.cov(row, i) = 4e-8;
    }
    data::WriteTracks((folder_ / "tracks.h5").string(), tracks, data::Provenance{});
  }
  nlohmann::json Fitted(const std::string& model, int code = 0) const {
    Put("study.toml",
        "[study]\nname = \"swing\"\n[trial]\ntracks = \"tracks.h5\"\n[model]\n"
        "files = [\"swing.sh\"]\n" +
            model + R"(
[parameter.frequency]
start = 0.93
bounds = [0.5, 2.0]
[parameter.decay]
start = 0.4
bounds = [0.01, 2.0]
)" + kQuick);
    const Outcome fit = Run({"fit", "study.toml", "-o", "fit.h5", "--json", "--allow-programs"});
    EXPECT_EQ(fit.code, code) << fit.err;
    return nlohmann::json::parse(fit.out);
  }
};

TEST_F(FitProgramTest, ItsFinerProgramIsTheUpperRung) {
  const nlohmann::json ladder = Fitted(
      "command = [\"sh\", \"swing.sh\", \"0.001\"]\nfiner = [\"sh\", \"swing.sh\", \"0\"]\n");
  const nlohmann::json direct = Fitted("command = [\"sh\", \"swing.sh\", \"0\"]\n");
  const nlohmann::json coarse = Fitted("command = [\"sh\", \"swing.sh\", \"0.001\"]\n");
  ASSERT_EQ(ladder.at("ladder").at("rungs").size(), 2u);
  EXPECT_EQ(ladder.at("ladder").at("rungs")[1].at("name"), "the finer program");
  EXPECT_LE(int(ladder.at("ladder").at("rungs")[1].at("runs")), 4);
  const double truth[] = {0.9, 0.35};
  for (std::size_t j = 0; j < 2; ++j) {
    const auto &a = ladder.at("parameters")[j], &b = direct.at("parameters")[j];
    EXPECT_NEAR(double(a.at("value")), double(b.at("value")), 0.1 * double(b.at("sigma_data")));
    EXPECT_GT(double(a.at("sigma_model")), 0.0);
    EXPECT_LE(double(a.at("low95")), truth[j]);
    EXPECT_GE(double(a.at("high95")), truth[j]);
  }
  // The coarse program's own error, in closed form, is what the ladder took away.
  EXPECT_NEAR(double(coarse.at("parameters")[0].at("value")) -
                  double(ladder.at("parameters")[0].at("value")),
              0.9 * 0.001 / 0.999, 0.1 * 0.9 * 0.001);
}

TEST_F(FitProgramTest, ThatFailsSaysWhy) {
  const nlohmann::json fit = Fitted(
      "command = [\"sh\", \"-c\", \"echo reading deck >&2; echo no licence for solver >&2; exit "
      "3\"]\n",
      1);
  EXPECT_THAT(Reasons(fit) + std::string(fit.at("verdict")),
              HasSubstr("exit code 3: no licence for solver"));
  // The finer one alone: the lowest rung's values stand, and the reason is told.
  const nlohmann::json finer = Fitted(
      "command = [\"sh\", \"swing.sh\", \"0\"]\nfiner = [\"sh\", \"-c\", \"echo out of memory >&2; "
      "exit 1\"]\n");
  EXPECT_THAT(Reasons(finer), HasSubstr("exit code 1: out of memory"));
}

// Half a period of a swing is that of the next half, turned: the clock that is found asks for more
// than the program's 2 s.
TEST_F(FitKnownTest, AProgramThatEndsTooEarlyIsToldUntilWhen) {
  std::string tracks =
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz [m^2]\n";
  for (int i = 1; i < 80; ++i) {
    const double error = 1e-4 * std::sin(1e3 * i * i);
    tracks += fmt::format("{},m,{},{},0,1e-8,0,0,1e-8,0,1e-8\n", 0.02 * i,
                          0.7 * std::sin(0.06 * i) + error, error);
  }
  Put("swing.csv", tracks);
  Put("swing.awk",
      "{ gsub(/[^0-9.e+-]/, \" \"); a += $1 }\n"
      "END { print \"mark,t [s],x [m],y [m]\" > \"swing.csv\"\n"
      "for (i = 0; i <= 200; ++i) printf \"m,%.17g,%.17g,0\\n\", i / 100, a * sin(i * 0.03) > "
      "\"swing.csv\" }\n");
  const auto study = [](const char* clock) {
    return fmt::format(
        "[study]\nname = 'swing'\n[trial]\ntracks = 'swing.csv'\n{}[model]\n"
        "command = ['env', 'LC_ALL=C', 'awk', '-f', '{{study}}/swing.awk', 'parameters.json']\n"
        "tracks = 'swing.csv'\n[parameter.a]\nstart = 0.6\nbounds = [0.2, 2.0]\n",
        clock);
  };
  Put("study.toml", study(""));
  const Outcome lost = Run({"fit", "study.toml", "--allow-programs", "-o", "fit.h5"});
  EXPECT_EQ(lost.code, 1);
  EXPECT_THAT(lost.out, HasSubstr("the model's motion of m is not known at 2.0"));
  EXPECT_THAT(lost.out, HasSubstr("answer for longer, or state trial.offset"));
  Put("study.toml", study("offset = 0.0\nframe = 'known'\n"));
  Good({"fit", "study.toml", "--allow-programs", "-o", "fit.h5", "--json"});
}

}  // namespace
}  // namespace unfurl::cli::fit_known_test
