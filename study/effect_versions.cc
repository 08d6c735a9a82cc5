#include "study/effect_versions.h"

#include <algorithm>

#include "base/error.h"
#include "correlate/residual/change.h"
#include "correlate/shifted_model.h"
#include "data/scene.h"
#include "data/toml.h"
#include "study/rungs.h"

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

// "key=value" or "key=": whether what it changes is `key` or holds it.
bool Touches(const std::string& assignment, const std::string& key) {
  const std::string changed = assignment.substr(0, assignment.find('='));
  return key == changed || key.starts_with(changed + ".") || key.starts_with(changed + "[");
}

bool ChangesMesh(const std::vector<std::string>& set) {
  return std::any_of(set.begin(), set.end(), [](const std::string& assignment) {
    const std::string key = assignment.substr(0, assignment.find('='));
    return key.starts_with("beam.") &&
           (key.ends_with(".segments") || key.ends_with(".order") || key.ends_with(".model"));
  });
}

// Takes the keys that a switch sets from the parameters, and what is then without any.
std::vector<std::string> Release(const std::vector<std::string>& set, data::Study* study) {
  std::vector<std::string> released;
  for (data::StudyParameter& p : study->parameters) {
    std::erase_if(p.keys, [&](const std::string& key) {
      return std::any_of(set.begin(), set.end(),
                         [&](const std::string& s) { return Touches(s, key); });
    });
    if (p.keys.empty()) released.push_back(p.name);
  }
  std::erase_if(study->parameters, [](const data::StudyParameter& p) { return p.keys.empty(); });
  for (std::vector<std::string>& stage : study->free) {
    std::erase_if(stage, [&](const std::string& name) {
      return std::find(released.begin(), released.end(), name) != released.end();
    });
  }
  return released;
}

// Overrides of the finest rung that the study means.
std::vector<std::string> FinestRung(const data::Study& study, const data::Scene& scene) {
  const std::vector<SceneRung> rungs = RungsOf(study.fidelity, scene.beams);
  return rungs.empty() ? std::vector<std::string>{} : rungs.back().set;
}

void Append(const std::vector<std::string>& more, std::vector<std::string>* to) {
  to->insert(to->end(), more.begin(), more.end());
}

}  // namespace

EffectVersions::EffectVersions(const data::Study& study, const StudyFit& as_is)
    : study_(study), as_is_(as_is) {
  for (data::StudyParameter& p : study_.parameters) {
    for (const auto& found : as_is.record.parameters) {
      if (found.name == p.name) p.start = std::clamp(found.value, p.low, p.high);
    }
  }
  for (const auto& chosen : as_is.binding->tolerance) {
    study_.rtol = study_.rtol > 0.0 ? std::min(study_.rtol, chosen.rtol) : chosen.rtol;
  }
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
    if (!both.coarse->good() || !both.fine->good()) return;
    motions_.push_back(std::move(both));
  }
}

std::vector<EffectSwitch> EffectVersions::Effects(bool each) const {
  std::vector<std::string> set = study_.set;
  const data::Scene coarse = data::ReadScene(data::LoadToml(study_.scene, set), study_.scene);
  if (MeansFinest()) Append(FinestRung(study_, coarse), &set);
  const data::TomlTable document = data::LoadToml(study_.scene, set);
  return EffectsOf(data::ReadScene(document, study_.scene), document, each);
}

std::vector<SizedEffect> EffectVersions::Sized(bool each) const {
  return SizedEffectsOf(data::ReadScene(data::LoadToml(study_.scene, study_.set), study_.scene),
                        study_, each);
}

// Of a version whose mesh is another: an effect that is there leaves the cheaper model, which is
// then searched with; one that is not, a dearer one, and the study's lowest rung leads the way.
void EffectVersions::OnOneRung(EffectVersion* out) const {
  correlate::FitProblem& problem = out->binding.problem;
  out->look_first = true;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    correlate::FitTrial& trial = problem.trials[t];
    trial.rungs = {{trial.model, "the version itself", 0.0}};
    trial.model = as_is_.problem().trials[t].model;
    trial.tighter = nullptr;
  }
}

EffectVersion EffectVersions::Switched(const std::vector<std::string>& set, bool there) const {
  data::Study study = study_;
  EffectVersion out;
  out.released = Release(set, &study);
  const bool mesh = ChangesMesh(set);
  if (mesh) {
    const data::Scene coarse = data::ReadScene(data::LoadToml(study.scene, study.set), study.scene);
    if (MeansFinest()) Append(FinestRung(study, coarse), &study.set);
    study.fidelity = {};
    study.fidelity.wanted = false;
  }
  for (data::StudyTrial& trial : study.trials) Append(set, &trial.set);
  out.binding = Bind(study, {}, BindFor::kVersion);
  if (mesh) {
    if (!there && out.released.empty()) OnOneRung(&out);
    return out;
  }
  for (std::size_t t = 0; t < out.binding.problem.trials.size(); ++t) {
    correlate::FitTrial& trial = out.binding.problem.trials[t];
    if (trial.rungs.empty() || !HasLadder()) continue;
    trial.rungs.erase(trial.rungs.begin(), trial.rungs.end() - 1);
    for (const correlate::Model** model : {&trial.model, &trial.tighter}) {
      if (*model == nullptr) continue;
      out.binding.models.push_back(
          std::make_unique<correlate::ShiftedModel>(**model, motions_[t].coarse, motions_[t].fine));
      *model = out.binding.models.back().get();
    }
  }
  return out;
}

}  // namespace unfurl::study
