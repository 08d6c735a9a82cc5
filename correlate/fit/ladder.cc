#include "correlate/fit/ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/fixed_number.h"
#include "correlate/fit/ladder_error.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// On one rung. Steps that shrink by kSlow each are below 1e-6 of the first by then; what has not
// settled goes up a rung.
constexpr int kMostRounds = 12;
// Of a step by the one before it: slower than this, the difference's slope is wanted.
constexpr double kSlow = 0.3;
// Rounds in a row whose fine cost did not fall, after which the ladder goes up.
constexpr int kMostUnsuccessful = 2;
// Standard errors: a step below it that does not lead down is the model's own roughness, as in the
// solver.
constexpr double kRoughStep = 1.0;
// Of what the corrected rung itself changes by over a step below kRoughStep: as much may be the
// finest rung's roughness, and a slope made of that, across the data as it is, shortens a standard
// error by 1 - 1 / sqrt(1 + 0.5^2), a tenth; all of it, by a third, and the next step then looks
// longer.
constexpr double kTold = 0.5;

Eigen::VectorXd Point(const StageRunner& runner) {
  return Eigen::Map<const Eigen::VectorXd>(runner.u().data(),
                                           static_cast<Eigen::Index>(runner.u().size()));
}

// The largest part of a step, in standard errors; what the data do not determine has none.
double InSigmas(const Eigen::VectorXd& step, const Eigen::VectorXd& sigma) {
  double largest = 0.0;
  for (Eigen::Index j = 0; j < std::min(step.size(), sigma.size()); ++j) {
    if (sigma(j) > 0.0) largest = std::max(largest, std::abs(step(j)) / sigma(j));
  }
  return largest;
}

// Times of the latches by joint and count.
std::map<std::pair<std::string, int>, double> LatchTimes(const Prediction& prediction) {
  std::map<std::pair<std::string, int>, double> out;
  std::map<std::string, int> count;
  for (const ModelEvent& e : prediction.events) {
    if (e.kind == "latch") out[{e.where, ++count[e.where]}] = e.t;
  }
  return out;
}

}  // namespace

std::string LatchesDiffer(const Prediction& coarse, const Prediction& fine, double resolution) {
  const auto a = LatchTimes(coarse), b = LatchTimes(fine);
  for (const auto* lists : {&a, &b}) {
    for (const auto& [latch, t] : *lists) {
      const bool both = a.count(latch) > 0 && b.count(latch) > 0;
      if (!both) {
        return fmt::format("{} latches at {} s on one rung and not on the other", latch.first,
                           FixedNumber(t));
      }
    }
  }
  for (auto i = a.begin(); i != a.end(); ++i) {
    for (auto j = std::next(i); j != a.end(); ++j) {
      const double before = j->second - i->second;
      const double after = b.at(j->first) - b.at(i->first);
      if (before * after >= 0.0) continue;
      if (std::min(std::abs(before), std::abs(after)) <= resolution) continue;
      return fmt::format("{} latches before {} on one rung and after it on the other",
                         i->first.first, j->first.first);
    }
  }
  return {};
}

Ladder::Ladder(const FitProblem& problem, const FitOptions& options)
    : problem_(problem), options_(options), top_(problem.trials.front().rungs.size()) {
  result_.used = wanted();
  if (!wanted()) return;
  result_.names.push_back(problem.trials.front().model_name);
  for (const Rung& rung : problem.trials.front().rungs) result_.names.push_back(rung.name);
}

void Ladder::Note(const std::string& words) {
  if (std::find(result_.notes.begin(), result_.notes.end(), words) == result_.notes.end()) {
    result_.notes.push_back(words);
  }
}

LadderRound& Ladder::AddRound(const StageRunner& runner) {
  LadderRound round;
  round.base = result_.base;
  round.theta = Values(problem_.parameters, runner.u().data());
  result_.rounds.push_back(std::move(round));
  return result_.rounds.back();
}

Correction::Difference Ladder::DifferenceOf(const Answers& coarse, const Answers& fine) const {
  Correction::Difference out;
  for (std::size_t t = 0; t < fine.size(); ++t) {
    out.push_back(Correction::DifferenceOf(*data_[t], *coarse[t], *fine[t]));
  }
  return out;
}

std::vector<Evaluator::Request> Ladder::FirstRequests(const StageRunner& runner) const {
  std::vector<Evaluator::Request> out;
  if (!wanted() || correction_ != nullptr || !failure_.empty() || result_.base == top_) return out;
  const std::vector<double> theta = Values(problem_.parameters, runner.u().data());
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
    out.push_back({t, theta, "finest rung", FidelityOfRung(top_), false});
  }
  return out;
}

// Both rungs where the runner stands, and beside them the differences that the next solution starts
// from. False: one failed, and failure_ says why.
bool Ladder::Ask(StageRunner& runner, bool buy, Answers* coarse, Answers* fine) {
  const std::vector<double> theta = Values(problem_.parameters, runner.u().data());
  std::vector<Evaluator::Request> finest, base;
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
    finest.push_back({t, theta, "finest rung", FidelityOfRung(top_), false});
    base.push_back({t, theta, "trial", FidelityOfRung(result_.base), false});
  }
  ReducedProblem::Point point;
  bool sloped = runner.reduced().At(runner.u(), &point, "trial");
  // On with the slopes that led here. What is bought takes the other cores beside the finest rung.
  Slopes& slopes = runner.slopes();
  if (sloped && (buy || !slopes.known()) && !slopes.fresh()) {
    sloped = slopes.Buy(runner.reduced(), runner.u(), point, finest);
  } else if (sloped) {
    slopes.StartAt(runner.reduced(), runner.u(), point);
    sloped = slopes.known();
  }
  *fine = runner.evaluator().Evaluate(finest);
  *coarse = runner.evaluator().Evaluate(base);
  for (const Answers* answers : {fine, coarse}) {
    for (const Evaluator::Answer& answer : *answers) {
      if (answer->status == ModelStatus::kGood) continue;
      failure_ = answer->message;
      return false;
    }
  }
  if (sloped) {
    runner.SetFloor(FloorOf(problem_, result_.base, top_, runner.reduced(), point,
                            slopes.Rows(runner.reduced()), *coarse, *fine));
  }
  return true;
}

bool Ladder::EventsAgree(const Answers& coarse, const Answers& fine) {
  for (std::size_t t = 0; t < fine.size(); ++t) {
    // Nearer than its samples no record tells which was first.
    const double step = data_[t]->ShortestStep();
    const std::string difference = LatchesDiffer(*coarse[t], *fine[t], step);
    if (difference.empty()) continue;
    Note(fmt::format("{} and {} are different motions: {}", result_.names[result_.base],
                     result_.names[top_], difference));
    return false;
  }
  return true;
}

bool Ladder::FirstLook(StageRunner& runner, const std::vector<const Observations*>& data,
                       double step) {
  Answers coarse;
  LadderRound& round = AddRound(runner);
  if (std::isfinite(step)) round.step = step;
  if (!Ask(runner, step < kRoughStep, &coarse, &fine_)) return false;
  ReducedProblem::Point point;
  runner.reduced().CostOf(runner.u(), fine_, &point);
  round.fine_cost = point.cost;
  correction_ = std::make_shared<Correction>(problem_.parameters, data, Point(runner),
                                             DifferenceOf(coarse, fine_));
  runner.evaluator().SetCorrection(correction_);
  return EventsAgree(coarse, fine_);
}

// Whether what the finest rung does otherwise than the corrected one is little beside what that
// does from `before`, where the two agreed, to where the runner stands and the finest is `here`.
bool Ladder::Told(StageRunner& runner, const ReducedProblem::Point& before,
                  const ReducedProblem::Point& here) const {
  ReducedProblem::Point corrected;
  if (!runner.reduced().At(runner.u(), &corrected, "trial")) return false;
  return (here.residual - corrected.residual).norm() <=
         kTold * (corrected.residual - before.residual).norm();
}

// The finest rung where the corrected one has led.
Ladder::Way Ladder::Advance(StageRunner& runner, double step, double contraction,
                            int* unsuccessful) {
  LadderRound& round = AddRound(runner);
  round.step = step;
  round.contraction = contraction;
  Answers coarse, fine;
  if (!Ask(runner, step < kRoughStep, &coarse, &fine)) {
    round.counted = false;
    Note(fmt::format("{} failed on the way: {}", result_.names[top_], failure_));
    return Way::kFineFailed;
  }
  // 1. Did it get better? Both costs with the weights that stand now.
  const Eigen::VectorXd centre = correction_->centre();
  ReducedProblem::Point here, before;
  runner.reduced().CostOf(runner.u(), fine, &here);
  runner.reduced().CostOf({centre.data(), centre.data() + centre.size()}, fine_, &before);
  round.fine_cost = here.cost;
  round.counted = here.cost < before.cost;
  // 2. The slope where the way is slow, or the step was wrong.
  const Correction::Difference difference = DifferenceOf(coarse, fine);
  round.slope = (!round.counted || correction_->has_slope() || contraction > kSlow) &&
                (step >= kRoughStep || Told(runner, before, here));
  auto next = std::make_shared<Correction>(*correction_);
  if (round.slope) next->Learn(Point(runner), difference, runner.sigma());
  if (round.counted) {
    next->MoveTo(Point(runner), difference);
    fine_ = fine;
    *unsuccessful = 0;
  } else {
    runner.GoTo({centre.data(), centre.data() + centre.size()});
    // With nothing learnt the next round would be this one.
    *unsuccessful = round.slope ? *unsuccessful + 1 : kMostUnsuccessful;
  }
  correction_ = next;
  runner.evaluator().SetCorrection(correction_);
  if (round.slope) runner.slopes().Age();
  if (round.counted && !EventsAgree(coarse, fine)) return Way::kUp;
  if (*unsuccessful < kMostUnsuccessful) return Way::kOn;
  if (step < kRoughStep) {
    Note(
        fmt::format("settled to {:.2g} standard errors: what is smaller does not lower the cost "
                    "of {}, whose own roughness it is",
                    step, result_.names[top_]));
    return Way::kSettled;
  }
  Note(fmt::format("{} led nowhere: {} rounds in a row did not lower the cost of {}",
                   result_.names[result_.base], *unsuccessful, result_.names[top_]));
  return Way::kUp;
}

Ladder::Way Ladder::Rounds(StageRunner& runner, const std::vector<const Observations*>& data,
                           const std::vector<const RowWhitening*>& whitening,
                           const std::string& what) {
  data_ = data;
  int unsuccessful = 0;
  double last = std::numeric_limits<double>::quiet_NaN();
  double step = std::numeric_limits<double>::infinity();
  bool place = true;
  for (int round = 0; round < kMostRounds; ++round) {
    if (place && (!runner.Place(data, whitening) || correction_ == nullptr)) {
      // New stamps: the difference is wanted there.
      runner.evaluator().SetCorrection(nullptr);
      if (!FirstLook(runner, data, step)) return failure_.empty() ? Way::kUp : Way::kFineFailed;
    }
    // Rounds that lead on may do so on carried slopes, and those that lead far end when they are
    // near; the last may not.
    struct Ending {
      double tolerance, far;  // of a standard error
      bool verify;
    };
    const double within = options_.step_tolerance;
    for (const Ending& end : {Ending{std::max(within, kLeadingTolerance), kRoughStep, false},
                              Ending{within, within, false}, Ending{within, within, true}}) {
      if (end.verify && runner.slopes().fresh()) break;
      if (!runner.SolveHere(what, end.tolerance, end.verify)) return Way::kModelFailed;
      // From here back, where the errors are those of.
      step = InSigmas(ValueSteps(problem_.parameters, Point(runner), correction_->centre()),
                      runner.sigma());
      place = !runner.Settled();
      if (step > end.far || place) break;
    }
    if (step <= options_.step_tolerance && !place) return Way::kSettled;
    if (place) continue;
    const Way way = Advance(runner, step, step / last, &unsuccessful);
    if (way != Way::kOn) return way;
    last = unsuccessful == 0 ? step : std::numeric_limits<double>::quiet_NaN();
  }
  Note(fmt::format("not settled after {} rounds", kMostRounds));
  return Way::kUp;
}

bool Ladder::Climb(StageRunner& runner, const std::vector<const Observations*>& data,
                   const std::vector<const RowWhitening*>& whitening, const std::string& what) {
  result_.settled = false;
  while (failure_.empty() && result_.base < top_) {
    const Way way = Rounds(runner, data, whitening, what);
    if (way == Way::kModelFailed) return false;
    result_.settled = way == Way::kSettled;
    if (way != Way::kUp) break;
    ++result_.base;
    correction_.reset();
    runner.evaluator().SetCorrection(nullptr);
    runner.evaluator().SetBase(result_.base);
    Note(fmt::format("gone up to {}", result_.names[result_.base]));
  }
  const bool itself = result_.base == top_;
  if (itself) result_.settled = true;
  // A finest rung that could not be evaluated at all leaves the fit to the lowest.
  if (itself || correction_ == nullptr) return runner.Sharpen(data, whitening, what);
  return true;
}

}  // namespace unfurl::correlate
