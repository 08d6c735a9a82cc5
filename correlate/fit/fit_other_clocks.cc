// Other time offsets than the one that a fit was led along.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "correlate/fit/fit_run.h"
#include "correlate/fit/other_clocks.h"
#include "correlate/fit/places.h"

namespace unfurl::correlate {

namespace {

double RowsOf(const StageRunner& runner) {
  double rows = 0.0;
  for (const RegistrationFit& r : runner.point().registration) {
    rows += static_cast<double>(r.data_rows);
  }
  return std::max(1.0, rows);
}

// Twice the difference of two costs of which each row contributes `square`; what only one of them
// has a model for would have contributed as much.
double DevianceOf(double cost, double rows, double best_cost, double best_rows, double square) {
  return 2.0 * (cost - best_cost) / square + best_rows - rows;
}

std::vector<double> OffsetsOf(const StageRunner& runner) {
  std::vector<double> out;
  for (const RegistrationFit& r : runner.point().registration) out.push_back(r.at.offset);
  return out;
}

// Whether a place is the one that was left for this: nearer to it than half the way from there.
bool LiesBack(const Candidate& place, const std::vector<double>& here,
              const std::vector<double>& from) {
  if (from.empty()) return false;
  for (std::size_t t = 0; t < from.size(); ++t) {
    const double way = std::abs(here[t] - from[t]);
    if (std::abs(place.alignment[t].at.offset - from[t]) > 0.5 * way) return false;
  }
  return true;
}

}  // namespace

StageRunner* FitRun::LeadAlong(Candidate place) {
  // Steps after which a way that leads to the data is near them: the second and third correct what
  // the first, linear one leaves.
  constexpr int kFirstSteps = 3;
  other_places_.push_back(std::make_unique<Candidate>(std::move(place)));
  const std::size_t start = runners_.size() + retired_.size() + other_clocks_.size();
  other_clocks_.push_back(std::make_unique<StageRunner>(way_, options_, *other_places_.back(),
                                                        workers_, static_cast<int>(start)));
  StageRunner& runner = *other_clocks_.back();
  runner.SetModelNoise(noise_sigmas_);
  const std::size_t last = runner.stages() - 1;
  const double most = kNotNoise * std::max(1.0, 2.0 * best_->result().cost / RowsOf(*best_));
  const bool near = runner.Lead(last, kFirstSteps) && runner.misfit() <= most;
  return near && runner.Lead(last) ? &runner : nullptr;
}

double FitRun::DevianceByWay(StageRunner& other) {
  const double cost = CostOfWay(), rows = RowsOf(*best_);
  const double square = std::max(1.0, 2.0 * cost / rows);
  return DevianceOf(other.result().cost, RowsOf(other), cost, rows, square);
}

void FitRun::LookAtOtherClocks() {
  // Each round goes over to a place that explains the data better beyond the 95% level, or ends: an
  // alignment at the start's values may be wrong by any number of swings. The mean square falls
  // with each (once it is below 1, the squares do), so that no place is come to twice.
  std::vector<double> from;  // offsets of the last place
  for (;;) {
    Evaluator evaluator(way_, workers_);
    std::vector<Candidate> places = OtherPlaces(way_, options_, best_->candidate(),
                                                best_->result().to, best_->point(), evaluator);
    const auto& records = evaluator.records();
    result_.evaluations.insert(result_.evaluations.end(), records.begin(), records.end());
    const std::vector<double> here = OffsetsOf(*best_);
    StageRunner* lowest = nullptr;
    double least = -kDeviance95;
    for (Candidate& place : places) {
      if (LiesBack(place, here, from)) continue;
      StageRunner* other = LeadAlong(std::move(place));
      if (other == nullptr) continue;
      const double deviance = DevianceByWay(*other);
      as_good_.push_back({other, deviance, true});
      if (deviance < least) lowest = other, least = deviance;
    }
    if (lowest == nullptr) return;
    StageRunner* left = best_;
    const double cost = CostOfWay();
    for (auto& runner : runners_) {
      if (runner.get() != best_) continue;
      for (auto& other : other_clocks_) {
        if (other.get() == lowest) std::swap(runner, other);
      }
      break;
    }
    best_ = lowest;
    way_cost_.reset();
    const double rows = RowsOf(*best_), square = std::max(1.0, 2.0 * CostOfWay() / rows);
    as_good_.clear();
    as_good_.push_back({left, DevianceOf(cost, RowsOf(*left), CostOfWay(), rows, square), true});
    from = here;
  }
}

std::vector<FitOptions> FitRun::OtherBeginnings(const FitOptions& options) {
  Evaluator evaluator(problem_, workers_);
  std::vector<FitOptions> out = correlate::OtherBeginnings(way_, options, evaluator);
  const auto& records = evaluator.records();
  result_.evaluations.insert(result_.evaluations.end(), records.begin(), records.end());
  return out;
}

bool FitRun::WayExplains() const {
  return 2.0 * best_->result().cost <= kNotNoise * RowsOf(*best_);
}

bool FitRun::ExplainsBetterThan(FitRun& other) {
  return best_ != nullptr && other.DevianceByWay(*best_) < -kDeviance95;
}

void FitRun::WeighOtherClocks() {
  double dispersion = 1.0;
  for (const ParameterEstimate& e : result_.parameters) {
    dispersion = std::max(dispersion, e.profile.dispersion);
  }
  for (const AsGood& good : as_good_) {
    StageRunner* other = good.runner;
    double deviance = good.deviance;
    // The corrections of a ladder belong to the estimate's stamps.
    if (!ladder_.wanted()) {
      if (!other->Sharpen(data_, whiteners_, "at another time offset")) continue;
      deviance =
          DevianceOf(other->point().cost, RowsOf(*other), best_->point().cost, RowsOf(*best_), 1.0);
    }
    if (deviance > kDeviance95 * dispersion) continue;
    OtherClock found;
    for (const RegistrationFit& r : other->point().registration) {
      found.offset.push_back(r.at.offset);
    }
    found.theta = other->result().to;
    found.deviance = deviance;
    found.elsewhere = good.elsewhere;
    result_.other_clocks.push_back(std::move(found));
  }
}

}  // namespace unfurl::correlate
