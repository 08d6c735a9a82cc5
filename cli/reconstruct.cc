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
#include <tuple>

#include "base/count.h"
#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/table.h"
#include "base/text.h"
#include "calib/verdict.h"
#include "cli/live.h"
#include "cli/reconstruct_events.h"
#include "cli/reconstruct_health.h"
#include "cli/reconstruct_page.h"
#include "cli/start_places.h"
#include "cli/verb.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/rig.h"
#include "data/tracks.h"
#include "measure/sigma_summary.h"
#include "measure/smooth.h"
#include "measure/streak_picture.h"
#include "measure/trial_record.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct ReconstructSettings {
  std::string trial, rig, output, picture, report, start, events;
  bool smooth = false;
  bool correct = false;
  std::vector<std::string> rigid;     // as typed
  double camera_shift = 0.0;          // [px]
  std::optional<double> event_sigma;  // [s]; none: the interval between samples of a mark
  double max_speed = 0.0;             // [m/s]; 0: derived
  std::size_t workers = 0;
  LiveSettings live;
};

// Checks what belongs together, and gives the options with every file that enters.
measure::ReconstructOptions OptionsOf(const ReconstructSettings& s, data::Provenance* provenance) {
  provenance->AddInput(s.trial);
  provenance->AddInput(s.rig);
  measure::ReconstructOptions options;
  options.workers = s.workers;
  options.max_speed = s.max_speed;
  if (!s.start.empty()) {
    options.start = ReadStart(s.start);
    provenance->AddInput(s.start);
  }
  if (s.smooth && data::FormatOf(s.events) == data::FileFormat::kHdf5)
    provenance->AddInput(s.events);
  if (!s.smooth && !s.events.empty()) {
    throw Error("events matter to smoothing only", "--events", "add --smooth");
  }
  for (const std::string& pair : s.rigid) {
    options.health.distances.push_back(measure::ParseKeptDistance(pair, "--rigid"));
  }
  if (s.event_sigma && !(*s.event_sigma >= 0.0)) {
    throw Error("must not be negative", "--event-sigma", "give seconds, as in 0.005");
  }
  return options;
}

// The tracks of the whole record, smoothed.
data::Tracks SmoothAll(const ReconstructSettings& s, data::Tracks all,
                       measure::SmoothReport* report) {
  measure::TrimTracks(&all);
  measure::SmoothOptions smooth;
  smooth.events = EventTimes(s.events, all);
  smooth.event_sigma = s.event_sigma.value_or(measure::IntervalOf(all));
  all = measure::Smooth(all, smooth, report);
  ThrowIfInterrupted();
  return all;
}

// Counts by mark and camera, for --json.
ordered_json Summarize(const ReconstructSettings& s, const data::Rig& rig,
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
  for (const auto& [reason, count] : done.Unsolved()) summary["unsolved"][reason] = count;
  for (std::size_t c = 0; c < done.left_out.size(); ++c) {
    summary["readings"][layout.cameras[c]] = {{"used", done.readings[c]},
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
std::string DescribeSamples(const measure::ReconstructSummary& done, const data::Tracks& layout) {
  std::vector<std::vector<std::string>> rows = {
      {"mark", "good", "three cameras", "rejected reading", "unsolvable"}};
  for (std::size_t m = 0; m < done.marks.size(); ++m) {
    rows.push_back({done.marks[m]});
    for (std::size_t k = 0; k < 4; ++k) rows.back().push_back(std::to_string(done.status[m][k]));
  }
  std::string text = AlignedTable(rows);
  for (const auto& [reason, count] : done.Unsolved()) {
    text += fmt::format("unsolvable: {} x {}\n", count, reason);
  }
  for (std::size_t c = 0; c < done.left_out.size(); ++c) {
    if (done.left_out[c] == 0) continue;
    text += fmt::format("{}: {} left out\n", layout.cameras[c], Counted(done.left_out[c], "spot"));
  }
  if (!done.named_by_place.empty()) {
    text += fmt::format(
        "{}: lit together and named in order of x, for their starting places are not known; give "
        "them with --start\n",
        JoinWords(done.named_by_place));
  }
  return text;
}

std::string DescribeSigmas(const measure::SigmaSummary& sigmas, ordered_json* summary) {
  const char* axes[] = {"x", "y", "z"};
  std::string text = "median standard deviation";
  for (std::size_t k = 0; k < 3; ++k) {
    const double readings = sigmas.readings(k), calibration = sigmas.calibration(k);
    (*summary)["median_sigma_m"][axes[k]] = {{"readings", readings}, {"calibration", calibration}};
    text += fmt::format("{} {} {} (readings), {} (calibration)", k == 0 ? ":" : ";", axes[k],
                        LengthText(readings), LengthText(calibration));
  }
  return text + "\n";
}

ReconstructPageInput PageOf(const ReconstructSettings& s, const data::Rig& rig,
                            const measure::Reconstructor& reconstructor, const TracksDigest& digest,
                            const measure::SigmaSummary& sigmas) {
  ReconstructPageInput page;
  page.trial = s.trial;
  page.rig_path = s.rig;
  page.rig = &rig;
  page.summary = &reconstructor.summary();
  page.digest = &digest;
  page.shared_rank = reconstructor.layout().shared_rank;
  for (std::size_t k = 0; k < 3; ++k) {
    page.sigma_readings[k] = sigmas.readings(k);
    page.sigma_calibration[k] = sigmas.calibration(k);
  }
  return page;
}

// Says what came out of it; the exit code.
int Conclude(const Common& common, const ReconstructSettings& s, const data::Rig& rig,
             const measure::Reconstructor& reconstructor, const measure::SigmaSummary& sigmas,
             const measure::SmoothReport& smoothing, const data::TrialHealth& health,
             double seconds) {
  const measure::ReconstructSummary& done = reconstructor.summary();
  ordered_json summary = Summarize(s, rig, reconstructor.layout(), done, smoothing);
  const std::vector<std::string> lost = done.LostMarks();
  std::vector<std::string> not_usable = lost;
  if (!lost.empty()) summary["lost_marks"] = lost;
  const std::string exchanged = Describe(done.exchanged, done.marks);
  if (!exchanged.empty()) summary["exchanged_marks"] = not_usable.emplace_back(exchanged);
  if (!health.distances_kept) not_usable.push_back(health.distances);
  for (std::size_t k = 0; k < health.words.size(); ++k) {
    if (health.certain[k] == 0) not_usable.push_back(health.words[k]);
  }
  const std::string misfit = MisfitTooLarge(health, rig);
  if (!misfit.empty()) not_usable.push_back(misfit);
  if (rig.verdict == calib::kDoNotUse) {
    not_usable.push_back(fmt::format("the verdict of the rig {} is \"{}\"{}", s.rig, rig.verdict,
                                     rig.reasons.empty() ? "" : ": " + rig.reasons.front()));
  }
  std::string text;
  for (const std::string& reason : not_usable) text += "not usable: " + reason + "\n";
  const std::vector<std::string> dark = done.DarkMarks();
  if (!dark.empty()) summary["dark_marks"] = dark;
  for (const std::string& mark : dark) text += mark + "\n";
  const std::vector<std::string> lit = done.LitDarkLines();
  if (!lit.empty()) summary["lit_dark_lines"] = lit;
  for (const std::string& words : lit) text += words + "\n";
  text += HealthText(health, &summary);
  text += fmt::format("{}: {} from {} in {:.1f} s ({:.0f} lines/s)\n", s.output,
                      Counted(done.samples(), "sample"), Counted(done.lines, "line"), seconds,
                      static_cast<double>(done.lines) / seconds);
  text += DescribeSamples(done, reconstructor.layout());
  if (s.smooth) {
    text += fmt::format("smoothed in {} sections, {} events; use unsmoothed tracks for a fit\n",
                        smoothing.sections.size(), smoothing.events.size());
  }
  if (done.usable() > 0) text += DescribeSigmas(sigmas, &summary);
  summary["seconds"] = seconds;
  if (rig.verdict == calib::kWithCare) {
    text += fmt::format("the rig's verdict: {}\n", rig.verdict);
  }
  if (done.usable() == 0) text += "no sample is usable\n";
  Finish(common, summary, text);
  if (done.usable() == 0) return NotUsable(s.trial, "no sample is usable");
  return not_usable.empty() ? kExitGood : NotUsable(s.trial, not_usable.front());
}

// One reading of the record, with what is known of its cameras by then.
struct Pass {
  std::unique_ptr<measure::Reconstructor> reconstructor;
  std::optional<TracksDigest> digest;
  measure::SigmaSummary sigmas;
  data::Tracks all;  // only to be smoothed: otherwise nothing is kept
  std::optional<data::TracksWriter> writer;
};

// `picture`, when not null, is drawn.
void RunPass(const Common& common, const ReconstructSettings& s, const measure::TrialRecord& trial,
             const data::Provenance& provenance, measure::StreakPicture* picture, Pass* pass) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  measure::Reconstructor& reconstructor = *pass->reconstructor;
  pass->all = reconstructor.layout();
  pass->digest.emplace(reconstructor.layout(), trial.start(), trial.duration(), trial.size());
  if (!s.smooth) pass->writer.emplace(s.output, reconstructor.layout(), provenance);
  Progress progress("reconstruct", !common.quiet && !common.json);
  data::TrialBlock block;
  data::Tracks tracks;
  for (std::size_t first = 0; first < trial.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, trial.size() - first);
    trial.Process(first, count, &reconstructor, &block, &tracks);
    if (s.smooth) measure::AppendTracks(tracks, &pass->all);
    if (!s.smooth) {
      pass->writer->Append(tracks);
      pass->sigmas.Add(tracks);
      if (!s.report.empty()) pass->digest->Add(tracks, reconstructor.residuals());
    }
    if (picture != nullptr) picture->Add(block);
    progress.Update(static_cast<double>(first + count) / static_cast<double>(trial.size()));
  }
}

int WholeRecord(const Common& common, const ReconstructSettings& s) {
  const auto start = std::chrono::steady_clock::now();
  const measure::TrialRecord trial(s.trial);
  if (!s.picture.empty() && trial.lines() == nullptr) {
    throw Error("holds readings, and a picture is made of lines", s.trial, "leave --picture out");
  }
  data::Rig rig = data::ReadRig(s.rig);
  if (s.camera_shift > 0.0) measure::AllowForShifts(s.camera_shift, &rig);
  data::Provenance provenance = StartProvenance(common);
  measure::ReconstructOptions options = OptionsOf(s, &provenance);
  std::optional<measure::StreakPicture> picture;
  measure::HealthLoop loop(s.correct);
  Pass pass;
  do {
    pass.writer.reset();
    pass.sigmas = {};
    pass.reconstructor = trial.Open(rig, s.rig, options);
    measure::RequireMarks(options.health.distances, pass.reconstructor->layout().marks, s.trial);
    const bool draw = !s.picture.empty() && !picture;  // the lines as they were recorded
    if (draw) picture.emplace(trial.lines()->header(), trial.size());
    RunPass(common, s, trial, provenance, draw ? &*picture : nullptr, &pass);
  } while (loop.Again(*pass.reconstructor, &options));
  const data::TrialHealth health = measure::RecordOf(
      loop.report(), pass.all.cameras, pass.all.marks, s.correct, options.health.distances);
  measure::SmoothReport smoothing;
  if (s.smooth) {
    pass.all = SmoothAll(s, std::move(pass.all), &smoothing);
    pass.sigmas.Add(pass.all);
    pass.digest->Add(pass.all, {});
    pass.writer.emplace(s.output, pass.all, provenance);
    pass.writer->Append(pass.all);
  }
  pass.writer->Add(health);
  if (picture) picture->Write(s.picture);  // first: if it cannot be written, nothing is left
  if (!s.report.empty()) {
    ReconstructPageInput page = PageOf(s, rig, *pass.reconstructor, *pass.digest, pass.sigmas);
    page.health = &health;
    if (s.smooth) page.smoothing = &smoothing;
    WriteReconstructPage(s.report, page, provenance);
  }
  pass.writer->Commit();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return Conclude(common, s, rig, *pass.reconstructor, pass.sigmas, smoothing, health, seconds);
}

// Follows a stream, with what of the verb's options makes sense there.
int LiveVerb(const Common& common, ReconstructSettings* s) {
  RefuseWithLive({{"--output", !s->output.empty()},
                  {"--picture", !s->picture.empty()},
                  {"--smooth", s->smooth},
                  {"--events", !s->events.empty()},
                  {"--correct", s->correct},
                  {"--event-sigma", s->event_sigma.has_value()}});
  LiveSettings& live = s->live;
  std::tie(live.trial, live.rig, live.report) = std::tie(s->trial, s->rig, s->report);
  live.camera_shift = s->camera_shift;
  for (const std::string& pair : s->rigid) {
    live.options.reconstruct.health.distances.push_back(
        measure::ParseKeptDistance(pair, "--rigid"));
  }
  live.options.reconstruct.max_speed = s->max_speed;
  live.options.reconstruct.workers = std::max<std::size_t>(1, s->workers);
  if (!s->start.empty()) live.options.reconstruct.start = ReadStart(s->start);
  return RunLive(common, live);
}

int ReconstructVerb(const Common& common, ReconstructSettings* s) {
  if (s->live.live) return LiveVerb(common, s);
  CheckNotLive(s->live);
  if (s->trial.empty()) {
    throw Error("TRIAL is required", "command line", "see `unfurl reconstruct --help`");
  }
  return WholeRecord(common, *s);
}

}  // namespace

Verb AddReconstruct(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(
      program, common, "reconstruct",
      "Positions of the marks over time, from a trial's raw sensor lines or readings",
      "unfurl reconstruct trial.h5 --rig rig.h5 -o tracks.h5 --report reconstruct.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto s = std::make_shared<ReconstructSettings>();
  files.Read("TRIAL", &s->trial,
             "The recorded lines [HDF5], or readings [CSV, HDF5]; needed unless --live is given");
  files.Read("--rig", &s->rig, "The calibrated cameras [HDF5]")->required();
  files.WriteOr(
      "-o,--output", &s->output, [s] { return s->live.live ? "" : "tracks.h5"; },
      "Output [HDF5]; default tracks.h5");
  files.WriteForm("--picture", &s->picture, ".png", "Also draw the cameras' streak images [PNG]");
  files.Page(&s->report, "Also write a page with pictures (HTML)");
  files.Read("--start", &s->start,
             "Initial positions of marks that are lit together: mark, x, y, z [CSV]");
  app->add_option(
         "--max-speed", s->max_speed,
         "Upper bound of a mark's speed [m/s]; default: five times the largest found in a first "
         "pass over the record, and no less than the volume's size in 40 samples of a mark")
      ->check(CLI::PositiveNumber);
  app->add_flag("--smooth", s->smooth,
                "Smooth the tracks (Rauch-Tung-Striebel); for display, not for fitting. Holds the "
                "whole record's tracks in memory, up to 1 kB a sample; without it memory does not "
                "grow with the record");
  files.Read("--events", &s->events,
             "Times of impacts and latches, which smoothing must not round off: seconds on the "
             "record's clock, with commas, or a run whose latch events are taken [HDF5]");
  app->add_option(
      "--event-sigma", s->event_sigma,
      "Standard deviation of these times [s]; default: the interval between samples of a mark");
  app->add_flag(
      "--correct", s->correct,
      "Put the readings of cameras right that moved, drifted or are late, as far as three "
      "others vouch for it, instead of leaving those cameras out while they are wrong");
  app->add_option("--rigid", s->rigid,
                  "Two marks on one rigid body, and if it is known their distance, as tip,tip_b or "
                  "tip,tip_b=0.32m+-0.1mm: whether they keep it shows cameras that moved, are late "
                  "or exchanged, with three cameras alone (repeatable)")
      ->type_name("A,B[=LENGTH]")
      ->expected(1);
  app->add_option("--camera-shift", s->camera_shift,
                  "Standard deviation by which each camera may have shifted along its row since "
                  "the calibration: error bars then hold it [px]")
      ->check(CLI::NonNegativeNumber);
  app->add_option("--workers", s->workers, "Threads; 0: all cores");
  AddLiveOptions(&verb, &s->live);
  verb.run = [&common, s] { return ReconstructVerb(common, s.get()); };
  return verb;
}

}  // namespace unfurl::cli
