#include "measure/expose.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/verb.h"
#include "data/lab.h"
#include "data/run.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct ExposeSettings {
  std::string run, points, lab, output, truth;
  std::vector<std::string> overrides;
  std::size_t workers = 0;
};

double ExposeSeconds(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

data::Provenance ProvenanceOf(const Common& common, const ExposeSettings& s, const data::Lab& lab) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(s.points.empty() ? s.run : s.points);
  provenance.AddInput(s.lab);
  provenance.seed = lab.seed;
  for (const std::string& setting : s.overrides) {
    const std::size_t equals = setting.find('=');
    if (equals != std::string::npos) {
      provenance.options[setting.substr(0, equals)] = setting.substr(equals + 1);
    }
  }
  return provenance;
}

// Where the surveyed LED truly stood, one sample per point.
data::Tracks TrueTracks(const data::Survey& points) {
  data::Tracks truth;
  truth.frame = "rig";
  truth.marks = points.id;
  for (std::size_t i = 0; i < points.size(); ++i) {
    truth.t.push_back(0.0);
    truth.mark.push_back(static_cast<std::int32_t>(i));
    truth.status.push_back(data::SampleStatus::kGood);
  }
  truth.p = points.p;
  truth.cov.setZero(6, points.p.cols());
  return truth;
}

std::size_t Outside(const Eigen::Matrix3Xd& p, const data::Lab& lab) {
  std::size_t outside = 0;
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    outside += !((p.col(i).array() >= lab.volume_low.array()).all() &&
                 (p.col(i).array() <= lab.volume_high.array()).all());
  }
  return outside;
}

void CheckMarks(const data::Run& run, const ExposeSettings& s, const data::Lab& lab) {
  for (const std::string& slot : lab.strobe.slots) {
    for (const std::string& mark : data::MarksOfSlot(slot)) {
      if (run.Find(mark + ".x") >= 0) continue;
      throw Error(
          fmt::format("holds no mark '{}', which a slot of {} lights", mark, s.lab), s.run,
          fmt::format("its marks are {}; list those in strobe.slots", JoinWords(run.marks)));
    }
  }
}

int ExposeSurveyVerb(const Common& common, const ExposeSettings& s) {
  const auto start = std::chrono::steady_clock::now();
  const data::Lab lab = data::ReadLab(s.lab, s.overrides);
  const data::Survey points = data::ReadPointsCsv(s.points);
  const data::Provenance provenance = ProvenanceOf(common, s, lab);
  Progress progress("expose", !common.quiet && !common.json);
  measure::ExposeOptions options{.workers = s.workers,
                                 .progress = [&](double done) { progress.Update(done); }};
  const data::Survey survey = measure::ExposeSurvey(lab, points, options);
  if (!s.truth.empty()) data::WriteTracks(s.truth, TrueTracks(points), provenance);
  data::WriteSurvey(s.output, survey, provenance);

  const std::size_t outside = Outside(points.p, lab);
  const ordered_json summary = {{"output", s.output},
                                {"points", survey.size()},
                                {"cameras", survey.cameras},
                                {"points_outside_volume", outside},
                                {"seconds", ExposeSeconds(start)}};
  std::string text = fmt::format("{}: {}, lit and dark lines of {}, {:.1f} s\n", s.output,
                                 Counted(survey.size(), "point"),
                                 Counted(survey.cameras.size(), "camera"), ExposeSeconds(start));
  if (outside > 0) text += fmt::format("{} of the points lie outside the lab's volume\n", outside);
  Finish(common, summary, text);
  return kExitGood;
}

int ExposeTrialVerb(const Common& common, const ExposeSettings& s) {
  const auto start = std::chrono::steady_clock::now();
  const data::Lab lab = data::ReadLab(s.lab, s.overrides);
  const data::Run run = data::ReadRun(s.run);
  CheckMarks(run, s, lab);
  const data::Provenance provenance = ProvenanceOf(common, s, lab);
  const data::TrialHeader header = measure::HeaderOf(lab);
  Progress progress("expose", !common.quiet && !common.json);
  measure::ExposeOptions options{.workers = s.workers,
                                 .progress = [&](double done) { progress.Update(done); }};
  data::Tracks truth;
  data::TrialWriter trial(s.output, header, provenance);
  measure::ExposeTrial(lab, run, trial, options, &truth);
  if (!s.truth.empty()) data::WriteTracks(s.truth, truth, provenance);
  trial.Commit();

  const std::size_t outside = Outside(truth.p, lab);
  const double duration = truth.t.empty() ? 0.0 : truth.t.back();
  const ordered_json summary = {{"output", s.output},
                                {"cameras", header.cameras},
                                {"marks", truth.marks},
                                {"flashes", truth.size()},
                                {"flashes_outside_volume", outside},
                                {"duration_s", duration},
                                {"seconds", ExposeSeconds(start)}};
  std::string text =
      fmt::format("{}: {:.2f} s of {} at {:g} lines/s, {} of {}, {:.1f} s\n", s.output, duration,
                  Counted(header.cameras.size(), "camera"), header.line_rate,
                  truth.size() == 1 ? "1 flash" : fmt::format("{} flashes", truth.size()),
                  Counted(truth.marks.size(), "mark"), ExposeSeconds(start));
  if (outside > 0) {
    text += fmt::format(
        "{} flashes lie outside the lab's volume: the rig is not calibrated there\n", outside);
  }
  Finish(common, summary, text);
  return kExitGood;
}

}  // namespace

Verb AddExpose(CLI::App& program, Common& common) {
  Verb verb =
      DeclareVerb(program, common, "expose",
                  "A virtual experiment: the sensor lines that a laboratory's cameras would record",
                  "unfurl expose run.h5 --lab lab.toml -o trial.h5\n"
                  "  unfurl expose --survey points.csv --lab lab.toml -o survey.h5");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto s = std::make_shared<ExposeSettings>();
  auto* run = files.Read("RUN", &s->run, "The run whose marks are recorded [HDF5]");
  auto* survey = files.Read("--survey", &s->points, "Record a survey of these points [CSV]");
  run->excludes(survey);
  files.Read("--lab", &s->lab, "The laboratory [TOML]")->required();
  files.WriteOr(
      "-o,--output", &s->output, [s] { return s->points.empty() ? "trial.h5" : "survey.h5"; },
      "Output [HDF5]; default trial.h5 or survey.h5");
  files.Write("--truth", &s->truth, "Also write the true positions of the marks [HDF5 tracks]");
  files.Overrides(&s->overrides, "Overrides a key of the lab (repeatable)");
  app->add_option("--workers", s->workers, "Threads; 0: all cores");
  verb.run = [&common, s] {
    if (s->run.empty() == s->points.empty()) {
      throw Error("names neither a run nor a survey", "command line",
                  "give RUN.h5, or --survey POINTS.csv");
    }
    return s->points.empty() ? ExposeTrialVerb(common, *s) : ExposeSurveyVerb(common, *s);
  };
  return verb;
}

}  // namespace unfurl::cli
