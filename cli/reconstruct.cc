#include "measure/reconstruct.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/progress.h"
#include "cli/verb.h"
#include "data/rig.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "measure/streak_picture.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Settings {
  std::string trial, rig, output = "tracks.h5", picture;
  std::size_t workers = 0;
};

// The median of a stream of positive lengths, to 1%, in constant memory.
class StreamMedian {
 public:
  void Add(double value) {
    const double bin = std::log(std::max(value, kLow) / kLow) / kStep;
    ++counts_[static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0))];
    ++total_;
  }
  double Get() const {
    std::size_t below = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      below += counts_[i];
      if (2 * below >= total_) return kLow * std::exp(kStep * (static_cast<double>(i) + 0.5));
    }
    return 0.0;
  }

 private:
  static constexpr double kLow = 1e-9;   // [m]
  static constexpr double kStep = 0.01;  // of the logarithm
  static constexpr double kBins = 2400;  // up to 26 m
  std::vector<std::size_t> counts_ = std::vector<std::size_t>(static_cast<std::size_t>(kBins), 0);
  std::size_t total_ = 0;
};

struct Sigmas {
  std::array<StreamMedian, 3> readings, calibration;

  void Add(const data::Tracks& block) {
    constexpr std::array<Eigen::Index, 3> kDiagonal = {0, 3, 5};
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (!data::Usable(block.status[i])) continue;
      const auto col = static_cast<Eigen::Index>(i);
      const auto F = block.shared.middleCols(col * block.shared_rank, block.shared_rank);
      for (std::size_t k = 0; k < 3; ++k) {
        readings[k].Add(std::sqrt(block.cov(kDiagonal[k], col)));
        calibration[k].Add(F.row(static_cast<Eigen::Index>(k)).norm());
      }
    }
  }
};

int ReconstructVerb(const Common& common, const Settings& s) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  const auto start = std::chrono::steady_clock::now();
  const data::TrialReader trial(s.trial);
  const data::Rig rig = data::ReadRig(s.rig);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(s.trial);
  provenance.AddInput(s.rig);

  measure::Reconstructor reconstructor(trial, rig, s.rig, {.workers = s.workers});
  std::optional<measure::StreakPicture> picture;
  if (!s.picture.empty()) picture.emplace(trial.header(), trial.size());
  Sigmas sigmas;
  {
    data::TracksWriter writer(s.output, reconstructor.layout(), provenance);
    Progress progress("reconstruct", !common.quiet && !common.json);
    data::TrialBlock block;
    data::Tracks tracks;
    for (std::size_t first = 0; first < trial.size(); first += kBlock) {
      trial.Read(first, std::min(kBlock, trial.size() - first), &block);
      reconstructor.Process(block, &tracks);
      writer.Append(tracks);
      sigmas.Add(tracks);
      if (picture) picture->Add(block);
      progress.Update(static_cast<double>(first + block.size()) /
                      static_cast<double>(trial.size()));
    }
    if (picture) picture->Write(s.picture);  // first: if it cannot be written, nothing is left
    writer.Commit();
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const measure::ReconstructSummary& done = reconstructor.summary();
  ordered_json summary = {{"output", s.output},
                          {"verdict_of_rig", rig.verdict},
                          {"lines", done.lines},
                          {"samples", done.samples()},
                          {"usable", done.usable()}};
  std::vector<std::vector<std::string>> rows = {
      {"mark", "good", "three cameras", "rejected reading", "unsolvable"}};
  for (std::size_t m = 0; m < done.marks.size(); ++m) {
    rows.push_back({done.marks[m]});
    for (std::size_t k = 0; k < 4; ++k) {
      rows.back().push_back(std::to_string(done.status[m][k]));
      summary["status"][done.marks[m]][data::Name(static_cast<data::SampleStatus>(k))] =
          done.status[m][k];
    }
  }
  for (const auto& [reason, count] : done.unsolved) summary["unsolved"][reason] = count;
  summary["shared_rank"] = reconstructor.layout().shared_rank;
  std::string text =
      fmt::format("{}: {} samples from {} lines in {:.1f} s ({:.0f} lines/s)\n", s.output,
                  done.samples(), done.lines, seconds, static_cast<double>(done.lines) / seconds);
  text += AlignedTable(rows);
  for (const auto& [reason, count] : done.unsolved) {
    text += fmt::format("unsolvable: {} x {}\n", count, reason);
  }
  if (done.usable() > 0) {
    const char* axes[] = {"x", "y", "z"};
    text += "median sigma [mm]";
    for (std::size_t k = 0; k < 3; ++k) {
      const double readings = sigmas.readings[k].Get();
      const double calibration = sigmas.calibration[k].Get();
      summary["median_sigma_m"][axes[k]] = {{"readings", readings}, {"calibration", calibration}};
      text += fmt::format("{} {} {:.3f} (readings) {:.3f} (calibration)", k == 0 ? ":" : ",",
                          axes[k], 1e3 * readings, 1e3 * calibration);
    }
    text += "\n";
  }
  summary["seconds"] = seconds;
  if (!rig.verdict.empty() && rig.verdict != "good") {
    text += fmt::format("the rig's verdict: {}\n", rig.verdict);
  }
  if (done.usable() == 0) text += "no sample is usable\n";
  Finish(common, summary, text);
  return done.usable() == 0 ? kExitNotUsable : kExitGood;
}

}  // namespace

Verb AddReconstruct(CLI::App& program, Common& common) {
  CLI::App* app =
      DeclareVerb(program, common, "reconstruct", "From a trial's raw lines to marks in time",
                  "unfurl reconstruct trial.h5 --rig rig.h5 -o tracks.h5 --picture streaks.png");
  auto s = std::make_shared<Settings>();
  app->add_option("TRIAL", s->trial, "The recorded lines [HDF5]")->required();
  app->add_option("--rig", s->rig, "The calibrated cameras [HDF5]")->required();
  app->add_option("-o,--output", s->output, "Output [HDF5]; default tracks.h5");
  app->add_option("--picture", s->picture, "Also draw the cameras' streak images [PNG]");
  app->add_option("--workers", s->workers, "Threads; 0: all cores");
  return {app, [&common, s] { return ReconstructVerb(common, *s); }};
}

}  // namespace unfurl::cli
