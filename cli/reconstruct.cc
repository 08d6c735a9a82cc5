#include "measure/reconstruct.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/progress.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/reconstruct_page.h"
#include "cli/verb.h"
#include "correlate/align/align.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "measure/smooth.h"
#include "measure/streak_picture.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Settings {
  std::string trial, rig, output, picture, report, start, events;
  bool smooth = false;
  double event_sigma = 0.005;  // [s]
  std::size_t workers = 0;
};

// Columns mark, x, y, z.
std::map<std::string, Eigen::Vector3d> ReadStart(const std::string& path) {
  const data::CsvTable table = data::CsvTable::Load(path);
  const int mark = table.Require("mark", "");
  const int at[] = {table.Require("x", "m"), table.Require("y", "m"), table.Require("z", "m")};
  std::map<std::string, Eigen::Vector3d> start;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    start[table.Text(i, mark)] = {table.Number(i, at[0]), table.Number(i, at[1]),
                                  table.Number(i, at[2])};
  }
  return start;
}

// Times on the record's clock: listed, or a run's latches, by way of the run's alignment with the
// record.
std::vector<double> EventTimes(const Settings& s, const data::Tracks& tracks) {
  std::vector<double> times;
  if (s.events.empty()) return times;
  if (!s.events.ends_with(".h5")) {
    for (const std::string& word : Split(s.events, ',')) {
      double t = 0.0;
      if (!ParseDouble(Trim(word), &t) || !std::isfinite(t)) {
        throw Error(fmt::format("'{}' is no time", word), "--events",
                    "list seconds on the record's clock, as in 0.92,1.13, or name a run (.h5)");
      }
      times.push_back(t);
    }
  } else {
    const data::Run run = data::ReadRun(s.events);
    std::vector<std::string> common;
    for (const std::string& mark : run.marks) {
      if (tracks.FindMark(mark) >= 0) common.push_back(mark);
    }
    if (common.empty()) {
      throw Error("has no mark of the trial's", s.events,
                  fmt::format("the trial's marks are {}", JoinWords(tracks.marks)));
    }
    const correlate::Alignment alignment = correlate::Align(correlate::FromTracks(tracks, common),
                                                            correlate::SampledModel(run, common));
    if (!alignment.Usable()) {
      throw Error("cannot be aligned with the trial: " + alignment.message, s.events,
                  "give the times of the events themselves, as in --events 0.92,1.13");
    }
    for (const data::RunEvent& event : run.events) {
      if (event.kind == "latch") times.push_back(event.t + alignment.at.offset);
    }
  }
  std::sort(times.begin(), times.end());
  return times;
}

void Append(const data::Tracks& block, data::Tracks* all) {
  const auto n = static_cast<Eigen::Index>(all->size());
  const auto more = static_cast<Eigen::Index>(block.size());
  const Eigen::Index rank = block.shared_rank;
  const auto add = [](const auto& from, auto* to) {
    to->insert(to->end(), from.begin(), from.end());
  };
  add(block.t, &all->t);
  add(block.mark, &all->mark);
  add(block.status, &all->status);
  add(block.used, &all->used);
  add(block.left_out, &all->left_out);
  add(block.reason, &all->reason);
  // Doubling keeps what is copied in proportion.
  if (all->p.cols() < n + more) {
    const Eigen::Index room = std::max(n + more, 2 * n);
    all->p.conservativeResize(3, room);
    all->cov.conservativeResize(6, room);
    all->shared.conservativeResize(3, room * rank);
  }
  all->p.middleCols(n, more) = block.p;
  all->cov.middleCols(n, more) = block.cov;
  all->shared.middleCols(n * rank, more * rank) = block.shared;
}

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

// Checks what belongs together, and gives the options with every file that enters.
measure::ReconstructOptions OptionsOf(const Settings& s, data::Provenance* provenance) {
  provenance->AddInput(s.trial);
  provenance->AddInput(s.rig);
  measure::ReconstructOptions options;
  options.workers = s.workers;
  if (!s.start.empty()) {
    options.start = ReadStart(s.start);
    provenance->AddInput(s.start);
  }
  if (s.smooth && s.events.ends_with(".h5")) provenance->AddInput(s.events);
  if (!s.smooth && !s.events.empty()) {
    throw Error("events matter to smoothing only", "--events", "add --smooth");
  }
  if (!(s.event_sigma >= 0.0)) {
    throw Error("must not be negative", "--event-sigma", "give seconds, as in 0.005");
  }
  return options;
}

// The tracks of the whole record, smoothed.
data::Tracks SmoothAll(const Settings& s, data::Tracks all, measure::SmoothReport* report) {
  const auto n = static_cast<Eigen::Index>(all.size());
  all.p.conservativeResize(3, n);
  all.cov.conservativeResize(6, n);
  all.shared.conservativeResize(3, n * all.shared_rank);
  measure::SmoothOptions smooth;
  smooth.events = EventTimes(s, all);
  smooth.event_sigma = s.event_sigma;
  all = measure::Smooth(all, smooth, report);
  ThrowIfInterrupted();
  return all;
}

// Counts by mark and camera, for --json.
ordered_json Summarize(const Settings& s, const data::Rig& rig, const data::TrialHeader& header,
                       const data::Tracks& layout, const measure::ReconstructSummary& done,
                       const measure::SmoothReport& smoothing) {
  ordered_json summary = {{"output", s.output},
                          {"verdict_of_rig", rig.verdict},
                          {"lines", done.lines},
                          {"samples", done.samples()},
                          {"usable", done.usable()}};
  for (std::size_t m = 0; m < done.marks.size(); ++m) {
    for (std::size_t k = 0; k < 4; ++k) {
      summary["status"][done.marks[m]][data::Name(static_cast<data::SampleStatus>(k))] =
          done.status[m][k];
    }
  }
  for (const auto& [reason, count] : done.unsolved) summary["unsolved"][reason] = count;
  for (std::size_t c = 0; c < done.left_out.size(); ++c) {
    summary["readings"][header.cameras[c]] = {{"used", done.readings[c]},
                                              {"not_taken", done.left_out[c]}};
  }
  summary["shared_rank"] = layout.shared_rank;
  summary["unshared"] = done.unshared;
  summary["smoothed"] = s.smooth;
  for (const measure::SmoothSection& section : smoothing.sections) {
    summary["sections"].push_back({{"mark", done.marks[static_cast<std::size_t>(section.mark)]},
                                   {"from", section.from},
                                   {"to", section.to},
                                   {"samples", section.samples},
                                   {"jerk", section.jerk},
                                   {"chi_square_per_dof", section.chi_square}});
  }
  if (s.smooth) summary["events"] = smoothing.events;
  if (!done.named_by_place.empty()) summary["named_by_place"] = done.named_by_place;
  return summary;
}

// The same for a person: samples by mark and status, and what was left out.
std::string DescribeSamples(const measure::ReconstructSummary& done,
                            const data::TrialHeader& header) {
  std::vector<std::vector<std::string>> rows = {
      {"mark", "good", "three cameras", "rejected reading", "unsolvable"}};
  for (std::size_t m = 0; m < done.marks.size(); ++m) {
    rows.push_back({done.marks[m]});
    for (std::size_t k = 0; k < 4; ++k) rows.back().push_back(std::to_string(done.status[m][k]));
  }
  std::string text = AlignedTable(rows);
  for (const auto& [reason, count] : done.unsolved) {
    text += fmt::format("unsolvable: {} x {}\n", count, reason);
  }
  for (std::size_t c = 0; c < done.left_out.size(); ++c) {
    if (done.left_out[c] == 0) continue;
    text += fmt::format("{}: {} spots left out\n", header.cameras[c], done.left_out[c]);
  }
  if (!done.named_by_place.empty()) {
    text += fmt::format("{}: lit together, named in order of x; --start says which is which\n",
                        JoinWords(done.named_by_place));
  }
  return text;
}

std::string DescribeSigmas(const Sigmas& sigmas, ordered_json* summary) {
  const char* axes[] = {"x", "y", "z"};
  std::string text = "median sigma [mm]";
  for (std::size_t k = 0; k < 3; ++k) {
    const double readings = sigmas.readings[k].Get();
    const double calibration = sigmas.calibration[k].Get();
    (*summary)["median_sigma_m"][axes[k]] = {{"readings", readings}, {"calibration", calibration}};
    text += fmt::format("{} {} {:.3f} (readings) {:.3f} (calibration)", k == 0 ? ":" : ",", axes[k],
                        1e3 * readings, 1e3 * calibration);
  }
  return text + "\n";
}

int ReconstructVerb(const Common& common, const Settings& s) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  const auto start = std::chrono::steady_clock::now();
  const data::TrialReader trial(s.trial);
  const data::Rig rig = data::ReadRig(s.rig);
  data::Provenance provenance = StartProvenance(common);
  const measure::ReconstructOptions options = OptionsOf(s, &provenance);
  measure::Reconstructor reconstructor(trial, rig, s.rig, options);
  std::optional<measure::StreakPicture> picture;
  if (!s.picture.empty()) picture.emplace(trial.header(), trial.size());
  Sigmas sigmas;
  measure::SmoothReport smoothing;
  TracksDigest digest(reconstructor.layout(), 0.0,
                      static_cast<double>(trial.size()) / trial.header().line_rate, trial.size());
  {
    std::optional<data::TracksWriter> writer;
    data::Tracks all = reconstructor.layout();  // only to be smoothed: otherwise nothing is kept
    if (!s.smooth) writer.emplace(s.output, reconstructor.layout(), provenance);
    Progress progress("reconstruct", !common.quiet && !common.json);
    data::TrialBlock block;
    data::Tracks tracks;
    for (std::size_t first = 0; first < trial.size(); first += kBlock) {
      trial.Read(first, std::min(kBlock, trial.size() - first), &block);
      reconstructor.Process(block, &tracks);
      if (writer) writer->Append(tracks);
      if (s.smooth) Append(tracks, &all);
      if (!s.smooth) sigmas.Add(tracks);
      if (!s.smooth && !s.report.empty()) digest.Add(tracks, reconstructor.residuals());
      if (picture) picture->Add(block);
      progress.Update(static_cast<double>(first + block.size()) /
                      static_cast<double>(trial.size()));
    }
    if (s.smooth) {
      all = SmoothAll(s, std::move(all), &smoothing);
      sigmas.Add(all);
      digest.Add(all, {});
      writer.emplace(s.output, all, provenance);
      writer->Append(all);
    }
    if (picture) picture->Write(s.picture);  // first: if it cannot be written, nothing is left
    if (!s.report.empty()) {
      ReconstructPageInput page;
      page.trial = s.trial;
      page.rig_path = s.rig;
      page.rig = &rig;
      page.summary = &reconstructor.summary();
      page.digest = &digest;
      page.smoothing = s.smooth ? &smoothing : nullptr;
      page.shared_rank = reconstructor.layout().shared_rank;
      for (std::size_t k = 0; k < 3; ++k) {
        page.sigma_readings[k] = sigmas.readings[k].Get();
        page.sigma_calibration[k] = sigmas.calibration[k].Get();
      }
      WriteReconstructPage(s.report, page, provenance);
    }
    writer->Commit();
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const measure::ReconstructSummary& done = reconstructor.summary();
  ordered_json summary = Summarize(s, rig, trial.header(), reconstructor.layout(), done, smoothing);
  std::string text =
      fmt::format("{}: {} samples from {} lines in {:.1f} s ({:.0f} lines/s)\n", s.output,
                  done.samples(), done.lines, seconds, static_cast<double>(done.lines) / seconds);
  text += DescribeSamples(done, trial.header());
  if (s.smooth) {
    text += fmt::format("smoothed in {} sections, {} events; a fit wants them unsmoothed\n",
                        smoothing.sections.size(), smoothing.events.size());
  }
  if (done.usable() > 0) text += DescribeSigmas(sigmas, &summary);
  summary["seconds"] = seconds;
  if (!rig.verdict.empty() && rig.verdict != "good") {
    text += fmt::format("the rig's verdict: {}\n", rig.verdict);
  }
  if (done.usable() == 0) text += "no sample is usable\n";
  Finish(common, summary, text);
  return done.usable() == 0 ? NotUsable(s.trial, "no sample is usable") : kExitGood;
}

}  // namespace

Verb AddReconstruct(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(
      program, common, "reconstruct", "From a trial's raw lines to marks in time",
      "unfurl reconstruct trial.h5 --rig rig.h5 -o tracks.h5 --report reconstruct.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto s = std::make_shared<Settings>();
  files.Read("TRIAL", &s->trial, "The recorded lines [HDF5]")->required();
  files.Read("--rig", &s->rig, "The calibrated cameras [HDF5]")->required();
  files.WriteOr(
      "-o,--output", &s->output, [] { return "tracks.h5"; }, "Output [HDF5]; default tracks.h5");
  files.Write("--picture", &s->picture, "Also draw the cameras' streak images [PNG]");
  files.Write("--report", &s->report, "A page to look at (HTML)");
  files.Read("--start", &s->start,
             "Initial positions of marks that are lit together: mark, x, y, z [CSV]");
  app->add_flag(
      "--smooth", s->smooth,
      "Smooth the tracks (Rauch-Tung-Striebel); for looking at, not for fitting. Holds the "
      "whole record's tracks in memory, up to 1 kB a sample; without it memory does not "
      "grow with the record");
  files.Read("--events", &s->events,
             "When latches kick, so that smoothing does not round it off: seconds on the "
             "record's clock, with commas, or a run whose latches count [HDF5]");
  app->add_option("--event-sigma", s->event_sigma,
                  "How well these times are known [s]; default 0.005");
  app->add_option("--workers", s->workers, "Threads; 0: all cores");
  verb.run = [&common, s] { return ReconstructVerb(common, *s); };
  return verb;
}

}  // namespace unfurl::cli
