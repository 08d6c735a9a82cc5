#include "study/model_warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "study/scene_model.h"

namespace unfurl::study {

namespace {

constexpr std::size_t kMost = 3;  // of each trial: of many beams alike nobody reads each

std::vector<std::string> WarningsOf(const correlate::FitTrial& trial,
                                    const std::vector<double>& theta) {
  std::vector<const correlate::Model*> models = {trial.model};
  for (const correlate::Rung& rung : trial.rungs) models.push_back(rung.model);
  for (auto model = models.rbegin(); model != models.rend(); ++model) {
    const auto* scene = dynamic_cast<const SceneModel*>(*model);
    if (scene == nullptr) continue;
    if (auto warnings = scene->WarningsNear(theta)) return *std::move(warnings);
  }
  return {};
}

}  // namespace

void AddModelWarnings(const correlate::FitProblem& problem, const correlate::FitResult& result,
                      data::FitRecord* record) {
  if (!result.Usable()) return;
  std::vector<double> theta;
  for (const correlate::ParameterEstimate& p : result.parameters) theta.push_back(p.value);
  std::vector<std::string> told;
  for (const correlate::FitTrial& trial : problem.trials) {
    std::size_t count = 0;
    for (const std::string& warning : WarningsOf(trial, theta)) {
      if (std::find(told.begin(), told.end(), warning) != told.end()) continue;
      if (count++ == kMost) break;
      told.push_back(warning);
      record->reasons.push_back(
          fmt::format("The simulation{} warns: {}.",
                      problem.trials.size() > 1 ? " of " + trial.name : std::string(), warning));
    }
  }
}

}  // namespace unfurl::study
