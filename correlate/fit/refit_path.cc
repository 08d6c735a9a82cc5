#include "correlate/fit/refit_path.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "correlate/fit/bounded_step.h"
#include "correlate/fit/fit_run.h"
#include "correlate/fit/screening.h"
#include "correlate/fit/slopes.h"

namespace unfurl::correlate {

namespace {

// Of a sum of squares: 4 is two standard errors of one parameter, below which no verdict rests on a
// difference.
constexpr double kTells = 4.0;
// Of a sum of squares that a step may leave: half a standard error of one parameter.
constexpr double kLittle = 0.25;

Eigen::VectorXd Point(const std::vector<double>& u) {
  return Eigen::Map<const Eigen::VectorXd>(u.data(), static_cast<Eigen::Index>(u.size()));
}

double Scale(const ReducedProblem::Point& point) {
  double rows = 0.0;
  for (const RegistrationFit& r : point.registration) rows += static_cast<double>(r.data_rows);
  return std::max(1.0, 2.0 * point.cost / std::max(1.0, rows));
}

}  // namespace

RefitPath::RefitPath(const FitProblem& version, const FitOptions& options, const RefitOptions& how,
                     RefitStart start)
    : version_(version),
      options_(options),
      how_(how),
      workers_(LocalWorkers(how.workers)),
      evaluator_(version, *workers_),
      has_top_(!version.trials.front().rungs.empty()),
      start_(std::move(start)),
      u_(start_.u),
      at_(start_.at),
      change_(start_.change),
      budget_(how.runs * version.trials.size()) {}

void RefitPath::Place() {
  std::vector<ReducedProblem::Part> parts;
  std::vector<Stamps> stamps;
  for (std::size_t t = 0; t < version_.trials.size(); ++t) {
    const Observations& o = *start_.observations[t];
    parts.push_back({t, &o, at_[t].clock(), at_[t], start_.whitening[t]});
    stamps.push_back(o.StampsAt(at_[t].clock()));
  }
  evaluator_.SetCorrection(nullptr);
  correction_.reset();
  evaluator_.SetStamps(std::move(stamps), 0);
  reduced_ =
      std::make_unique<ReducedProblem>(std::move(parts), options_.align.registration, evaluator_);
}

// Until the clocks hold: each time nearer.
bool RefitPath::Begin() {
  constexpr int kMost = 3;  // of Newton's steps, each of which squares what is left
  for (int k = 0; k < kMost; ++k) {
    Place();
    runs_ += version_.trials.size();
    if (!reduced_->At(u_, &point_, "trial")) {
      message_ = point_.failure;
      return false;
    }
    for (std::size_t t = 0; t < at_.size(); ++t) at_[t] = point_.registration[t].at;
    if (reduced_->ClocksHold(point_, at_)) break;
  }
  return true;
}

// A clock that is nearer at these parameters, by turns of a swing at times, may have no way down
// that leads as low as the fit's own: both ways are gone, and the lower end stands. False: the
// version and the data share nothing.
bool RefitPath::DescendFar() {
  const std::size_t all = budget_;
  budget_ = runs_ + (all - std::min(all, runs_)) / 2;
  Descend();
  budget_ = all;
  if (!FarFromData()) return true;
  const std::vector<double> u = u_;
  const std::vector<Registration> at = at_;
  const ReducedProblem::Changes change = change_;
  const double cost = point_.cost;
  u_ = start_.u;
  at_ = start_.at;
  change_ = start_.change;
  fresh_ = false;
  if (!Begin()) return false;
  const Laid laid = LayBeside();
  if (laid == Laid::kNowhere) return false;
  if (laid == Laid::kAnew) Descend();
  if (point_.cost <= cost) return true;
  u_ = u;
  at_ = at;
  change_ = change;
  fresh_ = false;
  return Begin();
}

RefitPath::Laid RefitPath::LayBeside() {
  FitOptions options = options_;
  options.stages.clear();  // over the whole record
  options.stages_by_impacts = false;
  runs_ += version_.trials.size();
  const std::vector<Candidate> found = Screen(
      version_, options, {Values(version_.parameters, u_.data())}, evaluator_, {}, {}, nullptr);
  if (!found.front().usable) {
    message_ = found.front().message;
    return Laid::kNowhere;
  }
  const std::vector<Registration> before = at_;
  for (std::size_t t = 0; t < at_.size(); ++t) {
    const Alignment& a = found.front().alignment[t];
    at_[t].X_WM = a.at.X_WM;
    at_[t].offset = a.at.offset;
  }
  const double cost = point_.cost;
  if (Begin() && point_.cost < cost) return Laid::kAnew;
  at_ = before;  // where the fit lay is nearer
  return Begin() ? Laid::kAsBefore : Laid::kNowhere;
}

Eigen::VectorXd RefitPath::Sigma(const ReducedProblem::Point& point) const {
  return StepAndSigma(reduced_->Project(point, reduced_->RowsOf(u_, point, change_)),
                      point.residual)
      .sigma;
}

RefitPath::Step RefitPath::StepFrom(const ReducedProblem::Point& point, double damping) const {
  if (u_.empty()) return {};
  const Eigen::MatrixXd P = reduced_->Project(point, reduced_->RowsOf(u_, point, change_));
  const Eigen::MatrixXd normal = P.transpose() * P;
  const Eigen::VectorXd slope = P.transpose() * point.residual;
  Eigen::MatrixXd H = normal;
  H.diagonal() *= 1.0 + damping;
  Eigen::VectorXd low(P.cols()), high(P.cols());
  for (Eigen::Index j = 0; j < P.cols(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    const Parameter& q = version_.parameters[i];
    low(j) = StepToLowest(q, u_[i]);
    high(j) = StepToHighest(q, u_[i]);
  }
  Step out;
  out.by = BoundedStep(H, slope, low, high);
  out.gain = -(2.0 * slope.dot(out.by) + out.by.dot(normal * out.by));
  const Eigen::VectorXd sigma = StepAndSigma(P, point.residual).sigma;
  for (Eigen::Index j = 0; j < P.cols(); ++j) {
    if (sigma(j) > 0.0) out.sigmas = std::max(out.sigmas, std::abs(out.by(j)) / sigma(j));
  }
  return out;
}

// Of two parameters that do the same each has a wide standard error, of which a step of one of them
// is a little part, while all of the misfit goes with it: both have to be little.
bool RefitPath::Within(const Step& step, double sigmas, double gain) const {
  return !(step.gain > 0.0) || (step.sigmas <= sigmas && step.gain <= gain * Scale(point_));
}

double RefitPath::LeftToGain() const {
  return optimism_ * std::max(0.0, StepFrom(point_, 0.0).gain);
}

bool RefitPath::Try(const Step& step) {
  // Logarithms go by the value, and the step is shortened as a whole where one would fall by more
  // than a decade, as the solver's are.
  constexpr double kFall = 0.9;
  double part = 1.0;
  for (std::size_t j = 0; j < u_.size(); ++j) {
    const double by = step.by(static_cast<Eigen::Index>(j));
    if (version_.parameters[j].log && part * by < -kFall) part = -kFall / by;
  }
  std::vector<double> to = u_;
  for (std::size_t j = 0; j < to.size(); ++j) {
    to[j] =
        StepByValue(version_.parameters[j], u_[j], part * step.by(static_cast<Eigen::Index>(j)));
  }
  const Eigen::VectorXd by = ValueSteps(version_.parameters, Point(u_), Point(to));
  runs_ += version_.trials.size();
  std::vector<ReducedProblem::Point> points;
  if (!reduced_->AtAll({to}, &points, "trial").front()) return false;
  const double gained = 2.0 * (point_.cost - points[0].cost);
  if (!(gained > 0.0)) return false;
  if (step.gain > 0.0) optimism_ = std::max(optimism_, gained / step.gain);
  LearnStep(*reduced_, point_, points[0], by, Sigma(points[0]), &change_);
  fresh_ = false;
  Carry(to);
  u_ = to;
  point_ = std::move(points[0]);
  reduced_->TakeStarts(point_);
  for (std::size_t t = 0; t < at_.size(); ++t) at_[t] = point_.registration[t].at;
  return true;
}

// What a value's change does stays; per unit of a logarithm it grows with the value.
void RefitPath::Carry(const std::vector<double>& to) {
  for (std::size_t j = 0; j < to.size(); ++j) {
    if (!version_.parameters[j].log || to[j] == u_[j]) continue;
    const double factor = std::exp(to[j] - u_[j]);
    for (std::vector<Change>& of : change_) of[j] = Scaled(of[j], factor);
  }
}

bool RefitPath::TakeSlopesAnew() {
  if (u_.empty()) return fresh_ = true;
  const std::size_t cost = u_.size() * version_.trials.size();
  if (fresh_ || !Affords(cost)) return false;
  runs_ += cost;
  reduced_->SetSteps(u_, reduced_->RowsOf(u_, point_, change_), point_, start_.difference);
  Eigen::MatrixXd J;
  ReducedProblem::Changes change;
  if (!reduced_->Sensitivity(u_, point_, +1, &J, &change)) return false;
  change_ = std::move(change);
  return fresh_ = true;
}

bool RefitPath::SlopesDecide() const {
  return 2.0 * point_.cost - start_.squares > kTells * Scale(point_);
}

// What a step that did not lead down leaves to do; nothing: the model is no smoother than that.
std::optional<double> RefitPath::Damped(const Step& step, double damping, int* rejected) {
  constexpr double kFirst = 1e-3;   // damping after a step that did not lead down
  constexpr double kFactor = 10.0;  // from step to step
  constexpr double kRough = 1.0;    // standard errors, as in the solver
  if (TakeSlopesAnew()) return damping;
  if (++*rejected >= 2 && Within(step, kRough, kTells)) return std::nullopt;
  return std::max(kFirst, kFactor * damping);
}

RefitPath::Way RefitPath::Descend() {
  if (u_.empty()) return Way::kSettled;  // clocks and frames are at their best from the beginning
  constexpr double kPoor = 0.25;         // of a promise: slopes that keep less lead astray
  double damping = 0.0;
  int rejected = 0;
  while (Affords(version_.trials.size())) {
    const Step step = StepFrom(point_, damping);
    if (Within(step, how_.step_tolerance, kLittle)) {
      if (!SlopesDecide()) return Way::kSettled;
      if (TakeSlopesAnew()) continue;
      return fresh_ ? Way::kSettled : Way::kBudget;
    }
    const double before = 2.0 * point_.cost;
    if (!Try(step)) {
      const std::optional<double> next = Damped(step, damping, &rejected);
      if (!next) return Way::kSettled;
      damping = *next;
      continue;
    }
    rejected = 0;
    damping = 0.0;
    if (before - 2.0 * point_.cost < kPoor * step.gain) TakeSlopesAnew();
    if (reduced_->ClocksHold(point_, at_)) continue;
    const bool corrected = correction_ != nullptr;
    if (!Begin()) return Way::kBudget;
    if (corrected) return Way::kSettled;  // the next look says what the finest rung adds here
  }
  return Way::kBudget;
}

bool RefitPath::Look() {
  const std::vector<double> theta = Values(version_.parameters, u_.data());
  std::vector<Evaluator::Request> fine, cheap;
  for (std::size_t t = 0; t < version_.trials.size(); ++t) {
    fine.push_back(
        {t, theta, "finest rung", FidelityOfRung(version_.trials[t].rungs.size()), false});
    cheap.push_back({t, theta, "trial", Fidelity::kMain, false});
  }
  looks_ += version_.trials.size();
  const std::vector<Evaluator::Answer> top = evaluator_.Evaluate(fine);
  const std::vector<Evaluator::Answer> base = evaluator_.Evaluate(cheap);  // it was asked before
  ReducedProblem::Point there;
  if (!reduced_->CostOf(u_, top, &there)) {
    message_ = there.failure;
    return false;
  }
  Correction::Difference difference;
  for (std::size_t t = 0; t < top.size(); ++t) {
    difference.push_back(Correction::DifferenceOf(*start_.observations[t], *base[t], *top[t]));
  }
  if (correction_ == nullptr) {
    correction_ = std::make_shared<Correction>(version_.parameters, start_.observations, Point(u_),
                                               difference);
  } else {
    auto next = std::make_shared<Correction>(*correction_);
    next->Learn(Point(u_), difference, Sigma(there));
    next->MoveTo(Point(u_), std::move(difference));
    correction_ = next;
  }
  evaluator_.SetCorrection(correction_);
  point_ = std::move(there);
  for (std::size_t t = 0; t < at_.size(); ++t) at_[t] = point_.registration[t].at;
  return true;
}

double RefitPath::Scatter() {
  if (std::abs(2.0 * point_.cost - start_.squares) <= kTells * Scale(point_)) return 0.0;
  const std::vector<double> theta = Values(version_.parameters, u_.data());
  double changed = 0.0;
  for (std::size_t t = 0; t < version_.trials.size(); ++t) {
    if (version_.trials[t].tighter == nullptr) continue;
    ++runs_;
    const std::vector<Evaluator::Answer> both =
        evaluator_.Evaluate({{t, theta, "noise", Fidelity::kTighter, false},
                             {t, theta, "noise", Fidelity::kMain, false}});
    if (both[0]->status != ModelStatus::kGood || both[1]->status != ModelStatus::kGood) continue;
    const ReducedProblem::Part& part = reduced_->parts()[t];
    const RegistrationFit& r = point_.registration[t];
    Eigen::MatrixXd d =
        WhitenedSensitivity(*part.observations, *point_.prediction[t], part.reference, r.at,
                            {Difference(*part.observations, *both[1], *both[0])});
    if (part.whitening != nullptr) part.whitening->Apply(d);
    changed += std::abs(2.0 * r.residual.dot(d.col(0)) + d.squaredNorm());
  }
  return changed;
}

// The best look stands; false: this one is it.
bool RefitPath::GoBackToBest() {
  if (best_cost_ < 0.0 || point_.cost <= best_cost_) {
    best_cost_ = point_.cost;
    best_u_ = u_;
    best_ = point_;
    return false;
  }
  return true;
}

// Whether a look ends the search, and how.
std::optional<RefitStatus> RefitPath::AfterLook(Way way) {
  if (GoBackToBest()) {
    // A step that did not lower the finest rung's cost: its roughness, or the way is lost.
    constexpr double kRough = 1.0;
    Carry(best_u_);
    u_ = best_u_;
    point_ = best_;
    for (std::size_t t = 0; t < at_.size(); ++t) at_[t] = point_.registration[t].at;
    return Within(StepFrom(point_, 0.0), kRough, kTells) ? RefitStatus::kSettled
                                                         : RefitStatus::kBudget;
  }
  if (Within(StepFrom(point_, 0.0), how_.step_tolerance, kLittle)) {
    const bool told = !SlopesDecide() || fresh_ || TakeSlopesAnew();
    return told && way == Way::kSettled ? RefitStatus::kSettled : RefitStatus::kBudget;
  }
  const bool enough = looks_ >= how_.looks * version_.trials.size();
  if (enough || way == Way::kBudget) return RefitStatus::kBudget;
  return std::nullopt;
}

bool RefitPath::FarFromData() const {
  double rows = 0.0;
  for (const RegistrationFit& r : point_.registration) rows += static_cast<double>(r.data_rows);
  return 2.0 * point_.cost > kNotNoise * std::max(rows, start_.squares);
}

RefitStatus RefitPath::Run() {
  if (!Begin()) return RefitStatus::kFailed;
  if (FarFromData() && !DescendFar()) return RefitStatus::kNotAligned;
  if (has_top_ && how_.look_first && !Look()) return RefitStatus::kFailed;
  for (;;) {
    const Way way = Descend();
    if (!has_top_) return way == Way::kSettled ? RefitStatus::kSettled : RefitStatus::kBudget;
    if (!Look()) return RefitStatus::kFailed;
    const std::optional<RefitStatus> end = AfterLook(way);
    if (end) return *end;
  }
}

}  // namespace unfurl::correlate
