#include "tests/cli/fit_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "base/random.h"
#include "data/run.h"
#include "data/tracks.h"
#include "tests/source_dir.h"

namespace unfurl::cli {

Outcome FitVerbTest::Good(const std::vector<std::string>& arguments) const {
  const Outcome outcome = Run(arguments);
  EXPECT_EQ(outcome.code, 0) << outcome.out << outcome.err;
  return outcome;
}

void FitVerbTest::MakeTracks(const std::string& name, const std::vector<std::string>& settings,
                             std::uint64_t seed, double sigma) const {
  std::vector<std::string> arguments = {
      "simulate", std::string(UNFURL_SOURCE_DIR) + "/data/sets/bouncing_latch/scene.toml",
      "--duration", "1.2", "-o", "truth.h5", "--quiet",
      // Impacts magnify the generator's own error until the fit takes it for clearance.
      "--rtol", "1e-10", "--set", "mark.mid.on=arm", "--set", "mark.mid.point=[0.0, 0.0]"};
  for (const std::string& setting : settings) {
    arguments.push_back("--set");
    arguments.push_back(setting);
  }
  Good(arguments);
  NoisyTracks(name, seed, sigma);
}

void FitVerbTest::NoisyTracks(const std::string& name, std::uint64_t seed, double sigma) const {
  const data::Run run = data::ReadRun((folder_ / "truth.h5").string());
  data::Tracks tracks;
  tracks.frame = "rig";
  tracks.marks = {"mid", "tip"};
  constexpr std::size_t kEvery = 5;  // of the run's milliseconds
  Rng rng(seed);
  std::vector<Eigen::Vector3d> p;
  for (std::size_t i = 0; i < run.t.size(); i += kEvery) {
    for (std::int32_t m = 0; m < 2; ++m) {
      const std::string& mark = tracks.marks[static_cast<std::size_t>(m)];
      tracks.t.push_back(run.t[i]);
      tracks.mark.push_back(m);
      tracks.status.push_back(data::SampleStatus::kGood);
      p.emplace_back(run.Column(mark + ".x")[i] + sigma * rng.Normal(),
                     run.Column(mark + ".y")[i] + sigma * rng.Normal(), sigma * rng.Normal());
    }
  }
  const auto n = static_cast<Eigen::Index>(p.size());
  tracks.p.resize(3, n);
  tracks.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, n);
  tracks.shared.resize(3, 0);
  for (Eigen::Index i = 0; i < n; ++i) {
    tracks.p.col(i) = p[static_cast<std::size_t>(i)];
    for (int row : {0, 3, 5}) tracks.cov(row, i) = sigma * sigma;
  }
  data::WriteTracks((folder_ / name).string(), tracks, data::Provenance{});
}

void FitVerbTest::MakeStudy(const std::string& name, const std::string& trials,
                            const std::string& more) const {
  Put(name, fmt::format(R"([study]
scene = "{}/data/sets/bouncing_latch/scene.toml"
set = ["mark.mid.on=arm", "mark.mid.point=[0.0, 0.0]"]
{}
[parameter.clearance]
keys = ["joint.hinge.latch.theta_a", "joint.hinge.latch.theta_b"]
unit = "rad"
start = 0.0055
bounds = [0.002, 0.02]
transform = "log"
[parameter.stiffness]
keys = ["joint.hinge.spring.stiffness"]
unit = "N m/rad"
start = 0.21
bounds = [0.1, 0.4]
{})",
                        UNFURL_SOURCE_DIR, trials, more));
}

void FitVerbTest::ExpectResumes(int kills, std::uint64_t seed) const {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("study.toml", "[trial]\ntracks = \"tracks.h5\"\n",
            "[solver]\nstages = \"impacts\"\nscreened = 12\nstarts = 2\n");
  ExpectResumesOf("study.toml", kills, seed);
}

void FitVerbTest::ExpectResumesOf(const std::string& study, int kills, std::uint64_t seed) const {
  const std::vector<std::string> fit = {"fit", study, "-o", "fit.h5", "--quiet"};
  const auto start = std::chrono::steady_clock::now();
  Good(fit);
  double ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  const std::string whole = Get("fit.h5");
  std::filesystem::remove(folder_ / "fit.h5");
  Rng rng(seed);
  int stopped = 0;
  for (int k = 0; k < 3 * kills && stopped < kills; ++k) {
    const int after = 1 + static_cast<int>(rng.Uniform(0.0, 1.0) * ms);
    const Outcome killed = RunProgram(fit, folder_, 0, after, SIGKILL);
    if (killed.code != 128 + SIGKILL) {  // it was done before: the machine has become faster
      ms = std::min(ms, static_cast<double>(after));
      std::filesystem::remove(folder_ / "fit.h5");
      continue;
    }
    ++stopped;
    std::vector<std::string> resume = fit;
    resume.push_back("--resume");
    // Another number of workers, too: neither may show.
    if (k % 2 == 0) resume.insert(resume.end(), {"--workers", "1"});
    Good(resume);
    EXPECT_TRUE(Get("fit.h5") == whole) << "killed after " << after << " ms";
    EXPECT_FALSE(std::filesystem::exists(folder_ / "fit.h5.partial"));
    std::filesystem::remove(folder_ / "fit.h5");
  }
  EXPECT_EQ(stopped, kills) << "the kills came too late to tell anything";
}

}  // namespace unfurl::cli
