// Motion of the model that the samples do not show, and the other minima that it makes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "correlate/fit/fit_run.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

constexpr double kMostHidden = 0.5;  // of a parameter's information

}  // namespace

void FitRun::LookBetweenSamples() {
  const std::vector<double> theta = Values(problem_.parameters, best_->u().data());
  for (std::size_t t = 0; t < trials_; ++t) {
    TrialResult& trial = result_.trials[t];
    trial.between = {};
    const RowLayout layout(weighed_[t]);
    const bool stated = std::all_of(layout.series.begin(), layout.series.end(),
                                    [](const RowSeries& s) { return s.has_sigma; });
    Prediction own = trial.prediction, between;
    if (!weighed_[t].marks.empty()) {
      // At the samples, too: what a ladder corrected there is not what is foretold from between.
      const Stamps stamps = weighed_[t].StampsAt(trial.reference);
      const auto answers = best_->evaluator().EvaluateAt(
          {{t, theta, "at the samples"}, {t, theta, "between samples"}},
          {stamps, StampsBetween(stamps)});
      if (answers[0]->status != ModelStatus::kGood || answers[1]->status != ModelStatus::kGood) {
        continue;
      }
      own = *answers[0];
      between = *answers[1];
    }
    trial.between =
        LookBetween(weighed_[t], own, between, trial.reference, trial.at, trial.residual);
    if (stated && trial.goodness.p_size >= kGoodnessLevel) {
      trial.between.told = BetweenSamples::Told::kBySize;
    }
  }
  if (!HidesMotion()) return;
  for (TrialResult& trial : result_.trials) {
    GoodnessOfFit& goodness = trial.goodness;
    goodness.hidden = trial.between.samples > 0 && goodness.p_size < kGoodnessLevel;
    if (goodness.hidden && goodness.outcome == Explained::kNoise) goodness.outcome = Explained::kNo;
  }
}

Eigen::VectorXd FitRun::HiddenShare() const {
  const auto p = static_cast<Eigen::Index>(problem_.parameters.size());
  Eigen::VectorXd hidden = Eigen::VectorXd::Zero(p), all = hidden;
  if (std::all_of(result_.trials.begin(), result_.trials.end(),
                  [](const TrialResult& t) { return t.between.samples == 0; })) {
    return hidden;
  }
  const Eigen::MatrixXd J = best_->reduced().Project(best_->point(), result_.sensitivity);
  for (std::size_t t = 0; t < trials_; ++t) {
    const BetweenSamples& between = result_.trials[t].between;
    const RowLayout layout(weighed_[t]);
    for (std::size_t s = 0; s < layout.series.size(); ++s) {
      const RowSeries& series = layout.series[s];
      for (std::size_t i = 0; i < series.size(); ++i) {
        const Eigen::VectorXd squares =
            J.middleRows(best_->reduced().first_row(t) + series.Row(i), series.axes)
                .colwise()
                .squaredNorm();
        all += squares;
        if (!between.hidden.empty() && between.hidden[s][i] != 0) hidden += squares;
      }
    }
  }
  return (all.array() > 0.0).select(hidden.array() / all.array().max(1e-300), 0.0);
}

bool FitRun::MostIsHidden() const { return (HiddenShare().array() > kMostHidden).any(); }

bool FitRun::HidesMotion() const {
  const bool unsized =
      std::any_of(result_.trials.begin(), result_.trials.end(), [](const TrialResult& t) {
        return t.between.samples > 0 && t.between.told == BetweenSamples::Told::kByNothing;
      });
  return unsized && MostIsHidden();
}

void FitRun::OpenWhatIsHidden() {
  // Of a wrong minimum some of the hidden motion is left among the residuals: here a tenth of its
  // square or more. Of eight wrong ones of planted latches it was 13 to 37%; of right ones with
  // little noise, below.
  constexpr double kFewTimes = 3.0;
  const bool may_be_misfit =
      std::any_of(result_.trials.begin(), result_.trials.end(), [](const TrialResult& t) {
        return t.between.samples > 0 && t.between.times < kFewTimes &&
               t.between.told == BetweenSamples::Told::kByNothing;
      });
  if (!may_be_misfit) return;
  constexpr double kOpen = std::numeric_limits<double>::quiet_NaN();
  const Eigen::VectorXd share = HiddenShare();
  for (std::size_t j = 0; j < result_.parameters.size(); ++j) {
    ParameterEstimate& e = result_.parameters[j];
    if (share(static_cast<Eigen::Index>(j)) <= kMostHidden) continue;
    e.all95.low = e.all95.high = e.data95.low = e.data95.high = kOpen;
    if (e.verdict != Verdict::kDetermined && e.verdict != Verdict::kMeshLimited) continue;
    e.verdict = Verdict::kNotDetermined;
    e.reason =
        "not determined: what tells it moves between the samples by what they do not show, and the "
        "residuals may be what is left of it at a wrong minimum";
  }
}

void FitRun::DropTwins() {
  constexpr double kSigmas = 3.0;  // of the less certain: one minimum's ends lie within one or two
  std::vector<std::unique_ptr<StageRunner>> led = std::move(runners_);
  runners_.clear();
  for (std::size_t s = 0; s < led.size(); ++s) {
    if (failed_[s]) retired_.push_back(std::move(led[s]));
  }
  std::erase(led, nullptr);
  std::stable_sort(led.begin(), led.end(),
                   [](const auto& a, const auto& b) { return a->misfit() < b->misfit(); });
  for (auto& runner : led) {
    const bool twin = std::any_of(runners_.begin(), runners_.end(), [&](const auto& better) {
      const Eigen::VectorXd own = runner->sigma(), its = better->sigma();
      bool same = own.size() > 0 && own.size() == its.size();
      for (std::size_t j = 0; j < runner->u().size(); ++j) {
        const auto k = static_cast<Eigen::Index>(j);
        same =
            same && std::abs(runner->u()[j] - better->u()[j]) <= kSigmas * std::max(own(k), its(k));
      }
      return same;
    });
    (twin ? retired_ : runners_).push_back(std::move(runner));
  }
  const bool none = runners_.empty();
  if (none) std::swap(runners_, retired_);
  failed_.assign(runners_.size(), none ? 1 : 0);
}

std::vector<std::vector<double>> FitRun::Ends() const {
  std::vector<const StageRunner*> led;
  for (const auto& runner : runners_) {
    if (runner->result().cost >= 0.0) led.push_back(runner.get());
  }
  std::stable_sort(led.begin(), led.end(), [](const StageRunner* a, const StageRunner* b) {
    return a->result().cost < b->result().cost;
  });
  std::vector<std::vector<double>> out;
  out.reserve(led.size());
  for (const StageRunner* runner : led) {
    out.push_back(Values(problem_.parameters, runner->u().data()));
  }
  return out;
}

Candidate FitRun::PlaceAt(const std::vector<double>& theta) const {
  Candidate place = best_->candidate();
  place.theta = theta;
  for (std::size_t t = 0; t < trials_; ++t) {
    place.alignment[t].at = best_->point().registration[t].at;
    place.alignment[t].drift = place.alignment[t].at.drift;
  }
  return place;
}

void FitRun::LookAtEnds(const std::vector<std::vector<double>>& ends) {
  // They are ends of the mesh that leads, and would be compared with what a ladder has corrected.
  if (ladder_.wanted()) return;
  for (const std::vector<double>& theta : ends) {
    StageRunner* other = LeadAlong(PlaceAt(theta));
    if (other != nullptr) as_good_.push_back({other, DevianceByWay(*other), false});
  }
}

}  // namespace unfurl::correlate
