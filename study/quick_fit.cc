#include "study/quick_fit.h"

#include <algorithm>

#include "base/error.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/residual/change.h"

namespace unfurl::study {

namespace {

// Samples to one of a mark's: the cubic between them is then off by 1e-4 of what the cubic through
// the mark's own would be.
constexpr double kSamples = 10.0;

// Stamps of a trial's record on the model's clock, marks on an even and denser grid.
correlate::Stamps DenseStamps(const correlate::Observations& o, const correlate::Clock& clock) {
  correlate::Stamps wanted = o.StampsAt(clock);
  double step = o.ShortestStep();
  if (!(step > 0.0)) step = wanted.Last();
  correlate::Stamps out = correlate::EvenStamps(wanted.marks, 0.0, wanted.Last(), step / kSamples);
  out.quantities = std::move(wanted.quantities);
  return out;
}

bool SameRungs(const correlate::FitTrial& a, const correlate::FitTrial& b) {
  return a.model_name == b.model_name &&
         std::equal(a.rungs.begin(), a.rungs.end(), b.rungs.begin(), b.rungs.end(),
                    [](const auto& x, const auto& y) { return x.name == y.name; });
}

}  // namespace

QuickFits::QuickFits(const StudyFit& as_is) : as_is_(as_is) {
  const std::vector<double> theta = as_is.result.Theta();
  for (std::size_t t = 0; t < as_is.problem().trials.size(); ++t) {
    const correlate::FitTrial& trial = as_is.problem().trials[t];
    if (trial.rungs.empty()) return;
    const correlate::Stamps stamps =
        DenseStamps(*trial.observations, as_is.result.trials[t].at.clock());
    auto sampled = [&](const correlate::Model& model) {
      return std::make_shared<const correlate::SampledModel>(
          stamps, correlate::EvaluateChecked(model, theta, stamps));
    };
    Motions both{sampled(*trial.model), sampled(*trial.rungs.back().model)};
    if (!both.coarse->good() || !both.fine->good()) {
      motions_.clear();
      return;
    }
    motions_.push_back(std::move(both));
  }
}

std::optional<QuickFit> QuickFits::Fit(const data::Study& version, std::size_t workers) const {
  if (motions_.empty()) return std::nullopt;
  // 1. The version on its lowest rung, with the finer rungs' difference of the study as it is.
  data::Study study = version;
  for (const auto& chosen : as_is_.binding->tolerance) {
    study.rtol = study.rtol > 0.0 ? std::min(study.rtol, chosen.rtol) : chosen.rtol;
  }
  QuickFit out{Bind(study, {}), {}, {}};
  std::vector<const correlate::Model*> fine;
  for (std::size_t t = 0; t < motions_.size(); ++t) {
    correlate::FitTrial& trial = out.binding.problem.trials[t];
    if (!SameRungs(trial, as_is_.problem().trials[t])) return std::nullopt;
    fine.push_back(trial.rungs.back().model);
    trial.rungs.clear();
    for (const correlate::Model** model : {&trial.model, &trial.tighter}) {
      if (*model == nullptr) continue;
      out.binding.models.push_back(
          std::make_unique<correlate::ShiftedModel>(**model, motions_[t].coarse, motions_[t].fine));
      *model = out.binding.models.back().get();
    }
  }
  correlate::FitOptions& how = out.binding.options;
  how.workers = workers;
  how.whiten = how.robust = how.profile.wanted = false;
  how.stages.clear();  // it starts where the study as it is came out
  how.stages_by_impacts = false;
  how.free.clear();
  out.result = correlate::Fit(out.binding.problem, out.binding.options);
  if (!out.result.Usable()) return out;

  // 2. What the finest rung says where it came out.
  const std::vector<double> theta = out.result.Theta();
  for (std::size_t t = 0; t < motions_.size(); ++t) {
    const correlate::TrialResult& found = out.result.trials[t];
    const correlate::Observations& o = *out.binding.problem.trials[t].observations;
    const correlate::Prediction really =
        correlate::EvaluateChecked(*fine[t], theta, o.StampsAt(found.reference));
    if (really.status != correlate::ModelStatus::kGood) return std::nullopt;
    const correlate::Change lacks = correlate::Difference(o, found.prediction, really);
    out.stale.emplace_back(
        correlate::WhitenedSensitivity(o, found.prediction, found.reference, found.at, {lacks})
            .col(0));
  }
  return out;
}

}  // namespace unfurl::study
