#include "tests/cli/main_job.h"

#include <fmt/format.h>

#include <cmath>

#include "data/atomic_file.h"
#include "data/tracks.h"

namespace unfurl::cli {

namespace {

void AddSegments(int segments, std::vector<std::string>* arguments) {
  for (int beam = 1; beam <= 4; ++beam) {
    arguments->push_back("--set");
    arguments->push_back(fmt::format("beam.beam{}.segments={}", beam, segments));
  }
}

}  // namespace

std::pair<double, double> JobResult::Estimate(const std::string& parameter) const {
  for (const auto& p : fit.at("parameters")) {
    if (p.at("name") == parameter) return {p.at("value"), p.at("sigma")};
  }
  ADD_FAILURE() << "the fit tells nothing of " << parameter;
  return {std::nan(""), std::nan("")};
}

std::string MainJobTest::StudyOnFourSegments(const std::string& more) const {
  std::string text = data::ReadTextFile(Shipped("study.toml"));
  const std::string scene = "scene_suspension.toml";
  text.replace(text.find(scene), scene.size(), Shipped("scene_suspension_4.toml"));
  const std::string path = (folder_ / "four.toml").string();
  data::WriteTextFile(path, text + more);
  return path;
}

Outcome MainJobTest::Good(const std::vector<std::string>& arguments) const {
  const Outcome outcome = Run(arguments);
  std::string line;
  for (const std::string& argument : arguments) line += " " + argument;
  EXPECT_EQ(outcome.code, 0) << "unfurl" << line << "\n" << outcome.out << outcome.err;
  EXPECT_EQ(outcome.err, "") << line;
  return outcome;
}

void MainJobTest::RunJob(const JobSettings& settings, JobResult* result) const {
  std::vector<std::string> simulate = {
      "simulate",   Shipped("scene_suspension.toml"),    "-o", "truth_run.h5", "--quiet",
      "--duration", fmt::format("{}", settings.duration)};
  AddSegments(settings.segments, &simulate);
  for (int i = 1; i <= 4; ++i) {
    for (const char* angle : {"theta_a", "theta_b"}) {
      simulate.push_back("--set");
      simulate.push_back(fmt::format("joint.joint{}.latch.{}={}", i, angle, settings.clearance));
    }
    simulate.push_back("--set");
    simulate.push_back(fmt::format("beam.beam{}.damping={}", i, settings.damping));
  }
  Good(simulate);
  const std::string lab = Shipped("lab.toml"), seed = fmt::format("seed={}", settings.seed);
  Good({"expose", "--survey", Shipped("points.csv"), "--lab", lab, "--set", seed, "-o", "survey.h5",
        "--quiet"});
  Good({"expose", "truth_run.h5", "--lab", lab, "--set", seed, "-o", "trial.h5", "--truth",
        "truth.h5", "--quiet"});
  Good({"calibrate", "survey.h5", "-o", "rig.h5", "--quiet"});
  Good({"reconstruct", "trial.h5", "--rig", "rig.h5", "-o", "tracks.h5", "--quiet"});
  if (HasFailure()) return;
  CompareTracks((folder_ / "tracks.h5").string(), (folder_ / "truth.h5").string(),
                &result->marks_rms, &result->largest);
  const Outcome fit =
      Good({"fit", settings.study.empty() ? Shipped("study.toml") : settings.study, "--tracks",
            "tracks.h5", "-o", "fit.h5", "--report", "fit.html", "--json"});
  result->fit = nlohmann::json::parse(fit.out, nullptr, false);
  EXPECT_FALSE(result->fit.is_discarded()) << fit.out;
}

void CompareTracks(const std::string& path, const std::string& truth, double* rms,
                   double* largest) {
  const data::Tracks a = data::ReadTracks(path), b = data::ReadTracks(truth);
  ASSERT_EQ(a.size(), b.size());
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a.marks[static_cast<std::size_t>(a.mark[i])],
              b.marks[static_cast<std::size_t>(b.mark[i])]);
    if (!data::Usable(a.status[i])) continue;
    const auto column = static_cast<Eigen::Index>(i);
    const double distance = (a.p.col(column) - b.p.col(column)).norm();
    sum += distance * distance;
    *largest = std::max(*largest, distance);
    ++count;
  }
  ASSERT_GT(count, a.size() * 9 / 10);
  *rms = std::sqrt(sum / static_cast<double>(count));
}

}  // namespace unfurl::cli
