// Whether the model lies beside the record where a fit has led.
#include <string>
#include <vector>

#include "correlate/fit/fit_run.h"

namespace unfurl::correlate {

bool FitRun::LiesBesideRecord(std::string* why) {
  FitOptions whole = options_;
  whole.stages.clear();
  whole.stages_by_impacts = false;
  // What was found by no correlation is held against what is explained alone.
  for (std::size_t t = 0; t < whole.search.places.size(); ++t) {
    whole.search.places[t] = best_->point().registration[t].at.offset;
  }
  Evaluator evaluator(problem_, workers_);
  const std::vector<double> theta = Values(problem_.parameters, best_->u().data());
  const std::vector<Candidate> end =
      correlate::Screen(way_, whole, {theta}, evaluator, {}, {}, nullptr);
  const auto& records = evaluator.records();
  result_.evaluations.insert(result_.evaluations.end(), records.begin(), records.end());
  if (why != nullptr) *why = end.front().message;
  return end.front().usable;
}

void FitRun::JudgeEnd() {
  std::string why;
  if (result_.status != FitStatus::kConverged || !Unexplained() || LiesBesideRecord(&why)) return;
  result_.status = FitStatus::kNotAligned;
  result_.message = "where the fit ended the model does not lie beside the record: " + why;
}

}  // namespace unfurl::correlate
