#include "study/fit_study.h"

#include <algorithm>

#include "base/error.h"
#include "correlate/fit/evaluation_store.h"
#include "study/fit_record.h"
#include "study/instruments_apart.h"
#include "study/model_warnings.h"
#include "study/scene_model.h"

namespace unfurl::study {

namespace {

// Samples of the model to one of a mark, in a comparison: the cubic through four of them is then
// off by 1e-4 of what the cubic through the mark's own samples is.
constexpr double kModelSamples = 10.0;

// Of the model's samples over `duration`, by the mark that is sampled most often [s].
double ComparisonStep(const correlate::Observations& observations, double duration) {
  double interval = duration > 0.0 ? duration : 1.0;  // of marks with one sample each
  for (const correlate::MarkSeries& mark : observations.marks) {
    const double median = correlate::MedianStep(mark.t);
    if (median > 0.0) interval = std::min(interval, median);
  }
  return interval / kModelSamples;
}

// The fit on `workers`, recorded; the journal, where there is one, outlives an interruption.
void Run(const data::Study& study, const FitStudyOptions& options, correlate::Workers* workers,
         StudyFit* fit) {
  correlate::FitOptions& how = fit->binding->options;
  how.workers = options.workers;
  how.where = workers;
  how.progress = options.progress;
  fit->result = correlate::Fit(fit->binding->problem, how);
  how.where = nullptr;
  TrialsApart apart = FindTrialsApart(fit->binding->problem, how, fit->result);
  if (apart.verdict.empty()) apart = FindInstrumentsApart(fit->binding->problem, how, fit->result);
  if (!fit->Usable()) apart.reasons = WhyNotAligned(fit->binding->problem, how, fit->result);
  fit->record = RecordOf(study, fit->binding->problem, fit->result, apart);
  AddTolerances(fit->binding->tolerance, &fit->record);
  AddModelWarnings(fit->binding->problem, fit->result, &fit->record);
}

// What the fit means: of the finest rung, where there are several.
const correlate::Model& ModelMeant(const correlate::FitTrial& trial) {
  return trial.rungs.empty() ? *trial.model : *trial.rungs.back().model;
}

std::vector<double> EstimateOf(const data::FitRecord& record) {
  std::vector<double> theta;
  for (const auto& p : record.parameters) theta.push_back(p.value);
  return theta;
}

// The scene at the estimate, for as long as the trial is.
std::optional<data::Run> MotionAtEstimate(const correlate::FitTrial& trial,
                                          const data::FitRecord& record) {
  const auto* scene = dynamic_cast<const SceneModel*>(&ModelMeant(trial));
  const double lasts = trial.observations->End() - trial.observations->Start();
  if (scene == nullptr || !(lasts > 0.0)) return std::nullopt;
  data::Run run = scene->RunAt(EstimateOf(record), lasts);
  if (run.text["status"] != "good") return std::nullopt;
  return run;
}

}  // namespace

correlate::Comparison CompareAtEstimate(const correlate::FitTrial& trial,
                                        const data::FitRecord& record) {
  correlate::Comparison c;
  if (trial.observations->marks.empty()) return c;
  c.record = trial.name;
  c.reference = "the model at the estimate";
  c.reference_is_run = true;
  c.observations = *trial.observations;
  for (const correlate::MarkSeries& m : c.observations.marks) c.marks.push_back(m.name);
  const bool drifts =
      std::any_of(record.nuisances.begin(), record.nuisances.end(),
                  [](const data::FitRecord::Nuisance& n) { return n.name == "clock drift"; });
  if (drifts && !c.observations.placement.drift.Told()) {
    c.observations.placement.drift = correlate::Prior::Free();
  }
  const std::vector<double> theta = EstimateOf(record);
  const double end = c.observations.End() - c.observations.Start();
  const correlate::SampledModel sampled(ModelMeant(trial), theta, c.marks, 0.0, end,
                                        ComparisonStep(c.observations, end));
  if (!sampled.good()) return c;
  for (const correlate::ModelEvent& e : sampled.events()) {
    if (e.kind == "latch") c.latches.push_back(e);
  }
  correlate::CompareWith(sampled, {}, &c);
  return c;
}

StudyFit Prepare(const data::Study& study, const FitStudyOptions& options) {
  if (study.command && !options.allow_programs) {
    throw Error("this study runs a program: " + study.command->words.front(), study.command->where,
                "read it, and if you trust it give --allow-programs, or set "
                "UNFURL_ALLOW_PROGRAMS=1");
  }
  StudyFit fit;
  fit.binding = std::make_unique<BoundStudy>(Bind(study, options.tracks, BindFor::kFit));
  fit.provenance = options.provenance;
  if (fit.provenance.program.empty()) fit.provenance.program = data::ProgramVersion();
  for (const std::string& input : fit.binding->inputs) fit.provenance.AddInput(input);
  return fit;
}

void RunPrepared(const data::Study& study, const FitStudyOptions& options, data::Journal* journal,
                 correlate::Workers* where, StudyFit* fit) {
  if (journal == nullptr) {
    Run(study, options, where, fit);
    return;
  }
  if (journal->found() > 0 && options.on_resume) {
    options.on_resume(journal->found(), journal->path());
  }
  const auto local = where == nullptr ? correlate::LocalWorkers(options.workers) : nullptr;
  correlate::JournaledWorkers workers(where == nullptr ? *local : *where, *journal);
  try {
    Run(study, options, &workers, fit);
  } catch (const Interrupted&) {
    if (journal->size() == 0) throw;
    throw FitInterrupted(journal->size(), journal->path());
  }
}

StudyFit Fit(const data::Study& study, const FitStudyOptions& options) {
  StudyFit fit = Prepare(study, options);
  const std::string identity = IdentityOf(fit.provenance);
  correlate::Workers* where = options.where ? options.where({&fit.problem()}, identity) : nullptr;
  if (options.output.empty()) {
    RunPrepared(study, options, nullptr, where, &fit);
  } else {
    data::Journal journal(options.output, identity, options.resume);
    RunPrepared(study, options, &journal, where, &fit);
    data::WriteFit(options.output, fit.record, fit.provenance);
    journal.Remove();
  }
  if (!fit.Usable()) return fit;
  const correlate::FitTrial& first = fit.problem().trials.front();
  if (options.compare) fit.comparison = CompareAtEstimate(first, fit.record);
  if (options.keep_motion) fit.motion = MotionAtEstimate(first, fit.record);
  return fit;
}

}  // namespace unfurl::study
