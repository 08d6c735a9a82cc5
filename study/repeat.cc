#include "study/repeat.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "base/error.h"
#include "study/repeat_record.h"

namespace unfurl::study {

namespace {

// Fewest trials that tell scatter from one that is unlike the others.
constexpr std::size_t kFewest = 3;

void Check(const data::Study& study, const FitStudyOptions& options) {
  const std::string where = study.repeat.where.empty() ? study.path : study.repeat.where;
  if (study.trials.size() < kFewest) {
    throw Error(fmt::format("the scatter of {} trial{}", study.trials.size(),
                            study.trials.size() == 1 ? "" : "s"),
                where, "give at least three as [[trial]], or leave [repeat] and --repeat out");
  }
  if (!options.tracks.empty()) {
    throw Error("tracks for a study of several trials", where, "name them in its [[trial]] tables");
  }
}

std::vector<data::Study> OneByOne(const data::Study& study) {
  std::vector<data::Study> out;
  for (const data::StudyTrial& trial : study.trials) {
    out.push_back(study);
    out.back().trials = {trial};
  }
  return out;
}

// Inputs of all trials. The scene is one: should it have changed from one reading to the next, the
// trials were not fitted with one model.
data::Provenance JoinInputs(const std::vector<StudyFit>& trials) {
  data::Provenance out = trials.front().provenance;
  for (const StudyFit& trial : trials) {
    for (const data::InputFile& input : trial.provenance.inputs) {
      const auto same =
          std::find_if(out.inputs.begin(), out.inputs.end(),
                       [&](const data::InputFile& i) { return i.path == input.path; });
      if (same == out.inputs.end()) {
        out.inputs.push_back(input);
      } else if (same->sha256 != input.sha256) {
        throw Error("it changed while the trials were read", input.path, "start again");
      }
    }
  }
  return out;
}

std::vector<bool> Scatters(const data::Study& study) {
  const std::vector<std::string>& named = study.repeat.parameters;
  std::vector<bool> out;
  for (const data::StudyParameter& p : study.parameters) {
    out.push_back(named.empty() || std::find(named.begin(), named.end(), p.name) != named.end());
  }
  return out;
}

std::vector<const correlate::FitProblem*> PointersTo(const std::vector<StudyFit>& fits) {
  std::vector<const correlate::FitProblem*> out;
  out.reserve(fits.size());
  for (const StudyFit& fit : fits) out.push_back(&fit.problem());
  return out;
}

// Each trial fitted; the journals stay until the whole is written.
void FitTrials(const std::vector<data::Study>& studies, const FitStudyOptions& options,
               correlate::Workers* where, std::vector<std::unique_ptr<data::Journal>>* journals,
               std::vector<StudyFit>* trials) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < trials->size(); ++i) {
    FitStudyOptions one = options;
    if (options.progress) {
      one.progress = [&options, i, count = trials->size()](correlate::FitProgress at) {
        at.phase = fmt::format("trial {} of {}, {}", i + 1, count, at.phase);
        options.progress(at);
      };
    }
    StudyFit& fit = (*trials)[i];
    data::Journal* journal = nullptr;
    if (!options.output.empty()) {
      journals->push_back(
          std::make_unique<data::Journal>(fmt::format("{}.trial-{}", options.output, i + 1),
                                          IdentityOf(fit.provenance), options.resume));
      journal = journals->back().get();
    }
    try {
      RunPrepared(studies[i], one, journal, where, &fit);
    } catch (const Interrupted&) {
      for (const auto& j : *journals) kept += j->size();
      if (kept == 0) throw;
      throw FitInterrupted(kept, options.output + ".trial-*.partial");
    }
  }
}

// Of a mark, over the trial's time: smooth at a page's width.
constexpr std::size_t kStamps = 201;

correlate::Stamps EvenStamps(const correlate::Observations& o, double end) {
  correlate::Stamps stamps;
  for (const correlate::MarkSeries& mark : o.marks) {
    stamps.marks.push_back(mark.name);
    stamps.t.emplace_back();
    for (std::size_t k = 0; k < kStamps; ++k) {
      stamps.t.back().push_back(end * static_cast<double>(k) / static_cast<double>(kStamps - 1));
    }
  }
  return stamps;
}

// The band of the next trial's marks, deployed as the first trial was.
correlate::NextTrial PredictAs(const StudyFit& first, const correlate::Hierarchy& hierarchy,
                               data::FitRecord* record) {
  const correlate::FitTrial& trial = first.problem().trials.front();
  if (trial.observations->marks.empty()) return {};
  const double end = trial.observations->StampsAt(first.result.trials.front().reference).Last();
  const correlate::Stamps stamps = EvenStamps(*trial.observations, end);
  const correlate::Model& model =
      trial.rungs.empty() ? *trial.model : *trial.rungs.back().model;  // what the fit means
  correlate::NextTrial next =
      correlate::PredictNext(model, first.problem().parameters, hierarchy, stamps);
  if (next.failure.empty()) AddNextTrial(stamps, next, record);
  return next;
}

// Values of a model that does not explain a trial are no measurement of the structure.
void AddUnexplained(const std::vector<StudyFit>& trials, data::FitRecord* record) {
  for (const StudyFit& fit : trials) {
    if (fit.result.trials.empty() ||
        fit.result.trials.front().goodness.outcome != correlate::Explained::kNo) {
      continue;
    }
    record->reasons.push_back(fit.problem().trials.front().name +
                              ": the model does not explain its data; its values hold only if the "
                              "model does.");
  }
}

}  // namespace

StudyProblems ProblemsOf(const data::Study& study, const FitStudyOptions& options) {
  StudyProblems out;
  if (study.repeat.wanted) {
    Check(study, options);
    for (const data::Study& one : OneByOne(study)) out.fits.push_back(Prepare(one, options));
    out.identity = IdentityOf(JoinInputs(out.fits));
  } else {
    out.fits.push_back(Prepare(study, options));
    out.identity = IdentityOf(out.fits.front().provenance);
  }
  out.problems = PointersTo(out.fits);
  return out;
}

RepeatFit FitRepeat(const data::Study& study, const FitStudyOptions& options) {
  Check(study, options);
  const std::vector<data::Study> studies = OneByOne(study);
  RepeatFit out;
  for (const data::Study& one : studies) out.trials.push_back(Prepare(one, options));
  out.provenance = JoinInputs(out.trials);
  correlate::Workers* where =
      options.where ? options.where(PointersTo(out.trials), IdentityOf(out.provenance)) : nullptr;
  std::vector<std::unique_ptr<data::Journal>> journals;
  FitTrials(studies, options, where, &journals, &out.trials);
  std::vector<correlate::FittedTrial> fits;
  for (const StudyFit& fit : out.trials) {
    fits.push_back({&fit.problem().trials.front(), &fit.result});
  }
  const std::vector<correlate::Parameter>& parameters = out.trials.front().problem().parameters;
  const correlate::FittedTrials fitted = correlate::FromFits(parameters, fits, Scatters(study));
  out.record = JoinRecords(study, out.trials);
  correlate::NextTrial next;
  if (fitted.used.size() >= kFewest) {
    out.hierarchy.emplace(fitted.problem);
    AddHierarchy(parameters, fitted, *out.hierarchy, &out.record);
    next = PredictAs(out.trials[fitted.used.front()], *out.hierarchy, &out.record);
  }
  JudgeRepeat(fitted, next, &out.record);
  AddUnexplained(out.trials, &out.record);
  if (!options.output.empty()) {
    data::WriteFit(options.output, out.record, out.provenance);
    for (const auto& journal : journals) journal->Remove();
  }
  return out;
}

}  // namespace unfurl::study
