// `unfurl simulate` as a person uses it: what is kept when a run is stopped, how large files are
// treated, options and the scene's defaults, the page.
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "data/run.h"
#include "tests/cli/program.h"

namespace unfurl::cli::simulate_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Simulate : public ProgramTest {
 protected:
  static std::string Pendulum(const std::string& more = {}) {
    return "[scene]\nname = 'pendulum'\nduration = 2.0\n" + more +
           "[body.bar]\nmass = 2.0\ninertia = 0.1\n"
           "[joint.pivot]\ninner = 'ground'\nouter = 'bar'\nouter_point = [-0.5, 0.0]\ntheta = "
           "0.3\n"
           "[gravity]\nacceleration = [0.0, -9.81]\n"
           "[mark.tip]\non = 'bar'\npoint = [0.5, 0.0]\n";
  }

  // Starts a run that would take hours and sends `signal` once NAME.partial holds samples.
  void Stop(int signal, int* code, std::string* complaint) const {
    const std::string partial = (folder_ / "run.h5.partial").string();
    const std::string words = folder_.string() + ".words";
    const pid_t child = fork();
    if (child == 0) {
      std::freopen(words.c_str(), "w", stderr);
      if (chdir(folder_.c_str()) != 0) _exit(120);
      const std::string scene = Shipped("scene_suspension.toml");
      execl(UNFURL_PROGRAM, UNFURL_PROGRAM, "simulate", scene.c_str(), "--duration", "900", "-o",
            "run.h5", nullptr);
      _exit(121);
    }
    constexpr int kTries = 600;  // of a tenth of a second
    for (int k = 0; k < kTries; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      try {
        if (data::RunReader(partial).samples() > 0) break;
      } catch (const std::exception&) {
        continue;  // not there yet
      }
    }
    kill(child, signal);
    int status = 0;
    waitpid(child, &status, 0);
    *code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    std::ifstream stream(words);
    std::getline(stream, *complaint, '\0');
    std::filesystem::remove(words);
  }

  // The partial is a run that info and convert read.
  void ExpectReadable(const std::string& status) const {
    EXPECT_EQ(Files(), std::vector<std::string>{"run.h5.partial"});
    const data::Run run = data::ReadRun((folder_ / "run.h5.partial").string());
    ASSERT_GT(run.t.size(), 0u);
    EXPECT_EQ(run.text.at("status"), status);
    for (const auto& column : run.columns) EXPECT_EQ(column.size(), run.t.size());
    EXPECT_EQ(Run({"info", "run.h5.partial"}).code, 0);
    EXPECT_EQ(Run({"convert", "run.h5.partial", "run.csv"}).code, 0);
    const std::string csv = Get("run.csv");
    EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), run.t.size() + 1);
  }
};

TEST_F(Simulate, CtrlCKeepsWhatThereIs) {
  int code = 0;
  std::string complaint;
  Stop(SIGINT, &code, &complaint);
  EXPECT_EQ(code, 130);
  EXPECT_THAT(complaint, HasSubstr("interrupted at t ="));
  EXPECT_THAT(complaint, HasSubstr("run.h5.partial"));
  ExpectReadable("interrupted");
}

TEST_F(Simulate, SigtermKeepsWhatThereIs) {
  int code = 0;
  std::string complaint;
  Stop(SIGTERM, &code, &complaint);
  EXPECT_EQ(code, 143);
  ExpectReadable("interrupted");
}

TEST_F(Simulate, KillLeavesAReadablePartial) {
  int code = 0;
  std::string complaint;
  Stop(SIGKILL, &code, &complaint);
  EXPECT_EQ(code, 128 + SIGKILL);
  ExpectReadable(data::kRunning);
  // The same name can be used again.
  Put("scene.toml", Pendulum());
  EXPECT_EQ(Run({"simulate", "scene.toml", "-o", "run.h5", "--quiet"}).code, 0);
  EXPECT_EQ(Files(), (std::vector<std::string>{"run.csv", "run.h5", "scene.toml"}));
}

// A four-bar that its drive takes to where the coupler and the rocker are stretched, and further.
TEST_F(Simulate, NumericalFailureKeepsWhatThereIs) {
  constexpr double kStart = 0.3, kBar = 0.5, kGround = 1.2;
  // The loop opens where the crank's tip is two bars from the ground's pin: cos theta = 0.6.
  const double stretched = std::acos(0.6);
  const double tx = std::cos(kStart), ty = std::sin(kStart);
  const double gx = kGround - tx, gy = -ty, d = std::hypot(gx, gy);
  const double up = std::sqrt(kBar * kBar - 0.25 * d * d);
  const double px = 0.5 * gx - up * gy / d, py = 0.5 * gy + up * gx / d;  // from the crank's tip
  const double coupler = std::atan2(py, px), rocker = std::atan2(gy - py, gx - px);
  char text[2000];
  std::snprintf(text, sizeof text,
                "[scene]\nname = 'overdriven'\nduration = 2.0\n"
                "[body.crank]\nmass = 1.0\ninertia = 0.1\n"
                "[body.coupler]\nmass = 1.0\ninertia = 0.1\n"
                "[body.rocker]\nmass = 1.0\ninertia = 0.1\n"
                "[joint.left]\ninner = 'ground'\nouter = 'crank'\nouter_point = [-0.5, 0.0]\n"
                "theta = %.17g\n[joint.left.drive]\nrate = 1.0\n"
                "[joint.elbow]\ninner = 'crank'\ninner_point = [0.5, 0.0]\nouter = 'coupler'\n"
                "outer_point = [-0.25, 0.0]\ntheta = %.17g\n"
                "[joint.wrist]\ninner = 'coupler'\ninner_point = [0.25, 0.0]\nouter = 'rocker'\n"
                "outer_point = [-0.25, 0.0]\ntheta = %.17g\n"
                "[joint.right]\ninner = 'ground'\ninner_point = [1.2, 0.0]\nouter = 'rocker'\n"
                "outer_point = [0.25, 0.0]\ntheta = %.17g\n"
                "[mark.m]\non = 'coupler'\n",
                kStart, coupler - kStart, rocker - coupler, rocker);
  Put("scene.toml", text);
  const Outcome outcome = Run({"simulate", "scene.toml", "-o", "run.h5", "--json"});
  EXPECT_EQ(outcome.code, 1) << outcome.err;
  EXPECT_EQ(Files(), (std::vector<std::string>{"run.h5.partial", "scene.toml"}));
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["run"], "run.h5.partial");
  EXPECT_NE(json["status"], "good");
  constexpr double kEarly = 0.01;  // [s]; the rates run away like a square root
  EXPECT_NEAR(json["t_end"].get<double>(), stretched - kStart, kEarly);
  const data::Run run = data::ReadRun((folder_ / "run.h5.partial").string());
  EXPECT_GT(run.t.size(), 600u);
  EXPECT_EQ(run.text.at("status"), json["status"]);
  EXPECT_FALSE(run.text.at("message").empty());
}

// The angle of a pendulum, in characters: asked for in a pipe, and only then.
TEST_F(Simulate, DrawsInCharacters) {
  Put("scene.toml", Pendulum());
  const Outcome drawn = Run({"simulate", "scene.toml", "--plot", "pivot.theta,tip.x"});
  ASSERT_EQ(drawn.code, 0) << drawn.err;
  EXPECT_THAT(drawn.out, HasSubstr("pivot.theta [deg]"));
  EXPECT_THAT(drawn.out, HasSubstr("17.19\u2524"));  // 0.3 rad, where it begins
  EXPECT_THAT(drawn.out, HasSubstr("tip.x [m]"));
  const Outcome plain = Run({"simulate", "scene.toml"});
  EXPECT_THAT(plain.out, Not(HasSubstr("\u2524")));
  EXPECT_EQ(Run({"simulate", "scene.toml", "--plot", "tip.x", "--json"}).out.find("\u2524"),
            std::string::npos);
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"simulate", "scene.toml", "-o", "other.h5", "--plot", "tip.q"}),
                {"--plot", "tip.q"}, before);
  ExpectRefused(Run({"simulate", "scene.toml", "-o", "other.h5", "--plot", "tip.x", "--quantities",
                     "pivot.*"}),
                {"--plot", "tip.x", "--quantities"}, before);
}

TEST_F(Simulate, TheDiskMustHoldIt) {
  Put("scene.toml", Pendulum());
  ExpectRefused(Run({"simulate", "scene.toml", "--duration", "1e7", "--rate", "1e6"}),
                {"scene.h5", "would take", "TB", "--rate", "--quantities"}, {"scene.toml"}, 4);
}

TEST_F(Simulate, LargeFilesAreToldBefore) {
  // 1.6 GB; stopped at once.
  const Outcome told = RunProgram({"simulate", Shipped("scene_suspension.toml"), "--duration",
                                   "1000", "--shape-rate", "0", "-o", "run.h5"},
                                  folder_, 0, 1500);
  EXPECT_EQ(told.code, 130);
  EXPECT_THAT(told.err, HasSubstr("run.h5 will take about 1."));
  EXPECT_THAT(told.err, HasSubstr(" GB"));
}

TEST_F(Simulate, MemoryDoesNotGrowWithTheRun) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer keeps what was freed";
#endif
  Put("scene.toml", Pendulum());
  const auto peak = [&](const char* rate) {
    const pid_t child = fork();
    if (child == 0) {
      if (chdir(folder_.c_str()) != 0) _exit(120);
      execl(UNFURL_PROGRAM, UNFURL_PROGRAM, "simulate", "scene.toml", "-o", "run.h5", "--rate",
            rate, "--quiet", nullptr);
      _exit(121);
    }
    int status = 0;
    rusage usage = {};
    wait4(child, &status, 0, &usage);
    EXPECT_EQ(status, 0);
    return usage.ru_maxrss;  // [kB]
  };
  // HDF5's own caches are full after some 20 MB; from there on nothing grows.
  const long short_run = peak("1e5"), long_run = peak("3e5");
  EXPECT_GT(std::filesystem::file_size(folder_ / "run.h5"), 100'000'000u);
  constexpr long kSlack = 5'000;  // [kB]; the samples between the two are 80 MB
  EXPECT_LT(long_run, short_run + kSlack);
}

TEST_F(Simulate, ADiskThatFillsOnTheWayKeepsWhatGotThere) {
  constexpr long kRoom = 3'000'000;  // bytes; the run needs twice that
  const Outcome full =
      RunProgram({"simulate", Shipped("scene_suspension.toml"), "-o", "run.h5"}, folder_, kRoom);
  EXPECT_EQ(full.code, 4);
  EXPECT_THAT(full.err, HasSubstr("cannot write: File too large"));
  EXPECT_THAT(full.err, HasSubstr("is in run.h5.partial"));
  EXPECT_EQ(std::count(full.err.begin(), full.err.end(), '\n'), 1) << full.err;
  EXPECT_EQ(Files(), std::vector<std::string>{"run.h5.partial"});
  const data::Run run = data::ReadRun((folder_ / "run.h5.partial").string());
  EXPECT_GE(run.t.size(), 1024u);
}

TEST_F(Simulate, ColumnsCanBeChosen) {
  Put("scene.toml", Pendulum());
  ASSERT_EQ(
      Run({"simulate", "scene.toml", "--quantities", "tip.?", "energy.total", "-o", "run.h5"}).code,
      0);
  const data::Run run = data::ReadRun((folder_ / "run.h5").string());
  ASSERT_EQ(run.quantities.size(), 3u);
  EXPECT_EQ(run.quantities[2].name, "energy.total");
  EXPECT_EQ(run.marks, std::vector<std::string>{"tip"});
  ExpectRefused(Run({"simulate", "scene.toml", "--quantities", "tip.z", "-o", "other.h5"}),
                {"tip.z", "--quantities: ", "did you mean"}, {"run.h5", "scene.toml"});
}

TEST_F(Simulate, TheScenesDefaultsAndTheCommandLine) {
  Put("scene.toml", Pendulum() + "[solver]\nrtol = 1e-5\nrate = 100.0\n");
  const auto steps = [&](const std::vector<std::string>& more) {
    std::vector<std::string> command = {"simulate", "scene.toml", "-o", "run.h5", "--json"};
    command.insert(command.end(), more.begin(), more.end());
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out);
  };
  const auto loose = steps({});
  EXPECT_EQ(loose["samples"], 201);
  const auto tight = steps({"--rtol", "1e-12", "--rate", "50"});
  EXPECT_EQ(tight["samples"], 101);
  const auto option = [&](const char* name) {
    const auto info = nlohmann::json::parse(Run({"info", "run.h5", "--json"}).out);
    return info["options"][name].get<std::string>();
  };
  EXPECT_EQ(option("rtol"), "1e-12");
  EXPECT_EQ(option("method"), "auto");
  EXPECT_EQ(steps({"--duration", "0.5"})["t_end"], 0.5);
  ExpectRefused(Run({"simulate", "scene.toml", "--method", "projecte", "-o", "other.h5"}),
                {"projecte", "did you mean \"projected\"?"}, {"run.h5", "scene.toml"});
}

TEST_F(Simulate, CostFindsTheCheapestSetting) {
  Put("scene.toml",
      "[scene]\nname = 'cantilever'\nduration = 0.5\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 4\n"
      "[weld.root]\ninner = 'ground'\nouter = 'rod.start'\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = 'rod.end'\n");
  const Outcome outcome = Run({"cost", "scene.toml", "--segments", "2,4,8", "--rtol", "1e-4,1e-6",
                               "--methods", "projected", "--json", "--report", "page.html"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(json["settings"].size(), 6u);
  double rms[3];  // at the tight tolerance, by mesh
  for (int k = 0; k < 3; ++k) {
    rms[k] = json["settings"][2 * k + 1]["errors"]["tip"]["rms"].get<double>();
  }
  // The mesh's error falls as n^-2, of the finest one too.
  EXPECT_NEAR(rms[0] / rms[1], 4.0, 1.0);
  EXPECT_NEAR(rms[1] / rms[2], 4.0, 1.0);
  EXPECT_FALSE(json["advice"].empty());
  EXPECT_THAT(Get("page.html"), HasSubstr("Error of tip against CPU time"));
  EXPECT_EQ(Files(), (std::vector<std::string>{"page.html", "scene.toml"}));
  // What is advised can be run as it is written.
  const auto best = json["lines"][0]["cheapest"][0]["setting"].get<std::size_t>();
  std::vector<std::string> simulate = {"simulate", "scene.toml", "-o", "run.h5", "--quiet"};
  for (const auto& set : json["settings"][best]["set"]) {
    simulate.insert(simulate.end(), {"--set", set.get<std::string>()});
  }
  EXPECT_EQ(Run(simulate).code, 0);
  std::filesystem::remove(folder_ / "run.h5");
  const Outcome text = Run({"cost", "scene.toml", "--quantity", "tip.y,frequency.1", "--segments",
                            "4", "--methods", "auto", "--within", "20s"});
  ASSERT_EQ(text.code, 0) << text.err;
  for (const char* words : {"tip.y", "frequency.1", "--set solver.method=auto", "extrapolated"}) {
    EXPECT_THAT(text.out, HasSubstr(words));
  }
  ExpectRefused(Run({"cost", "scene.toml", "--quantity", "tip.z"}),
                {"no quantity 'tip.z'", "did you mean"}, {"page.html", "scene.toml"});
  ExpectRefused(Run({"cost", "scene.toml", "--within", "soon"}), {"--within", "no time"},
                {"page.html", "scene.toml"});
  ExpectRefused(Run({"cost", "scene.toml", "--segments", "0"}), {"--segments"},
                {"page.html", "scene.toml"});
  ExpectRefused(Run({"cost", "scene.toml", "--rtol", "0.5"}), {"rtol"},
                {"page.html", "scene.toml"});
}

TEST_F(Simulate, SaysFirstWhatAnEngineerAsksFirst) {
  const Outcome outcome =
      Run({"simulate", Shipped("scene_clearance.toml"), "-o", "run.h5", "--report", "page.html"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::size_t latched = outcome.out.find("all 4 latches closed");
  ASSERT_NE(latched, std::string::npos) << outcome.out;
  for (const char* later : {"torque margin", "peak contact", "peak pin force", "largest residual",
                            "drifted", "calls for", "steps limited by"}) {
    const std::size_t at = outcome.out.find(later);
    ASSERT_NE(at, std::string::npos) << later;
    EXPECT_GT(at, latched) << later;
  }
  const std::string page = Get("page.html");
  for (const char* words : {"All 4 latches closed", "peak contact moment", "Paths of the marks",
                            "The beams in time", "Pin forces", "Energies"}) {
    EXPECT_THAT(page, HasSubstr(words));
  }
  // Nothing is fetched: the name of SVG is no address.
  const std::string svg = "http://www.w3.org/2000/svg";
  for (std::size_t at = page.find("http://"); at != std::string::npos;
       at = page.find("http://", at + 1)) {
    EXPECT_EQ(page.substr(at, svg.size()), svg);
  }
  const data::Run run = data::ReadRun((folder_ / "run.h5").string());
  for (const char* name : {"joint1.peak_moment", "joint1.peak_pin_force", "joint1.latch_time",
                           "joint1.least_driving_moment", "limit.error", "steps"}) {
    EXPECT_EQ(run.summary.count(name), 1u) << name;
  }
  // Every latch and impact is in the file.
  long impacts = 0;
  for (const data::RunEvent& event : run.events) impacts += event.kind == "contact_start" ? 1 : 0;
  EXPECT_EQ(static_cast<double>(impacts), run.summary.at("impacts"));
}

}  // namespace
}  // namespace unfurl::cli::simulate_test
