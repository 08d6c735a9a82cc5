#include "correlate/fit/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/number.h"
#include "base/text.h"
#include "correlate/fit/fit_stated.h"

namespace unfurl::correlate {

namespace {

// So near to a bound that it was the bound that stopped the solver: an estimate inside comes so
// near by chance in less than one case of a thousand.
constexpr double kAtBoundSigmas = 1e-3;
// Were the others known, the standard error would be less than this part of what it is: then it is
// they that hide the parameter, and not a lack of effect.
constexpr double kHidden = 0.2;
// Of what two parameters could share of the space in which little is known.
constexpr double kTakesPart = 0.1;
constexpr double kImitated = 0.998;  // share of the effect: the error grows twentyfold

// Half of the 95% interval in standard errors, the data's; infinite where the profile was followed
// as far as it matters and never rose. Where it was lost on the way, the standard error stands.
double DataSigma(const ParameterEstimate& e) {
  const Profile& profile = e.profile;
  if (profile.points.empty()) return e.sigma_data;
  const bool low = std::isfinite(profile.low), high = std::isfinite(profile.high);
  if ((!low && !profile.lost_low) || (!high && !profile.lost_high)) {
    return std::numeric_limits<double>::infinity();
  }
  const double below = low ? (e.value - profile.low) / kHalf95 : e.sigma_data;
  const double above = high ? (profile.high - e.value) / kHalf95 : e.sigma_data;
  return std::max(e.sigma_data, 0.5 * (below + above));
}

// What of frame, offset and calibration does most of what parameter j does.
std::vector<std::string> Imitators(const ReducedProblem& reduced,
                                   const ReducedProblem::Point& point, const FitResult& r,
                                   Eigen::Index j) {
  std::vector<std::string> names;
  for (std::size_t t = 0; t < r.trials.size(); ++t) {
    const Eigen::MatrixXd& N = point.registration[t].jacobian;
    if (N.cols() == 0) continue;
    const Eigen::VectorXd column = r.sensitivity.col(j).segment(reduced.first_row(t), N.rows());
    const Eigen::VectorXd scale = N.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    const Eigen::MatrixXd unit = N * scale.asDiagonal();
    const Eigen::VectorXd part = unit.completeOrthogonalDecomposition().solve(column).cwiseAbs();
    const double largest = part.maxCoeff();
    for (Eigen::Index i = 0; i < part.size(); ++i) {
      constexpr double kLarge = 0.5;  // of the largest
      const std::string name = r.trials[t].nuisances[static_cast<std::size_t>(i)].Name();
      if (part(i) >= kLarge * largest &&
          std::find(names.begin(), names.end(), name) == names.end()) {
        names.push_back(name);
      }
    }
  }
  return names;
}

std::string ProfileWords(const ParameterEstimate& e, const Parameter& q) {
  const std::string& unit = q.unit;
  constexpr int kReached = 4;  // digits of a place that a search came to
  const Profile& profile = e.profile;
  if (profile.points.empty()) return "";
  const bool low = std::isfinite(profile.low), high = std::isfinite(profile.high);
  if (low && high) {
    return fmt::format("; 95% interval {}{} (of the data alone, by profile, {})",
                       IntervalText(e.all95.low, e.all95.high), UnitAfter(unit),
                       IntervalText(e.data95.low, e.data95.high));
  }
  if ((!low && profile.lost_low) || (!high && profile.lost_high)) {
    return "; its profile could not be followed (the model is rough there)";
  }
  if (!low && profile.reached_low == q.low && e.all95.high == e.all95.high) {
    return fmt::format("; it lies below {}{} (95%), as far as its bound",
                       IntervalEnd(e.all95.high, kReached), UnitAfter(unit));
  }
  if (!low && !high) {
    return fmt::format("; its profile stays below the 95% level from {}{}",
                       IntervalText(profile.reached_low, profile.reached_high, kReached),
                       UnitAfter(unit));
  }
  // As far as the value, so that the two can be told apart.
  const double reached = low ? profile.reached_high : profile.reached_low;
  const int digits =
      IntervalDigits(std::min(e.value, reached), std::max(e.value, reached), kReached);
  return fmt::format("; its profile stays below the 95% level {} to {}{}", low ? "up" : "down",
                     IntervalEnd(reached, digits), UnitAfter(unit));
}

// The projection onto the space of parameters in which little is known, each scaled to what it
// would show alone. Its eigenvectors mix sets that have nothing to do with one another wherever
// their eigenvalues are alike; the projection onto all of it does not.
Eigen::MatrixXd SpaceOfLittleKnown(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(scale.asDiagonal() * information * scale.asDiagonal()));
  const Eigen::Index p = information.rows();
  Eigen::MatrixXd space = Eigen::MatrixXd::Zero(p, p);
  for (Eigen::Index v = 0; v < p && eigen.eigenvalues()(v) <= kHidden * kHidden; ++v) {
    space += eigen.eigenvectors().col(v) * eigen.eigenvectors().col(v).transpose();
  }
  return space;
}

// The parameters that share much of the space of little information with parameter j.
std::vector<std::string> Partners(const std::vector<Parameter>& parameters,
                                  const Eigen::MatrixXd& space, Eigen::Index j) {
  std::vector<std::string> names;
  for (Eigen::Index l = 0; l < space.cols(); ++l) {
    const double own = std::max(space(j, j), space(l, l));
    if (l != j && std::abs(space(j, l)) > kTakesPart * own) {
      names.push_back(parameters[static_cast<std::size_t>(l)].name);
    }
  }
  return names;
}

// What a verdict is decided by.
struct Knowledge {
  double data = 0.0;          // half of the data's 95% interval, in units of 1.96 [unit]
  double sigma = 0.0;         // with the model's own error [unit]
  double known_within = 0.0;  // beyond which it is not known [unit]
  double size = 0.0;          // what percentages are of [unit]
  bool at_bound = false;
  bool explained = true;             // the model explains every trial
  const Stated* rests_on = nullptr;  // a prior that the data contradict, and that moves it
  double without = 0.0;              // where it would be without that [unit]
};

Knowledge KnowledgeOf(const Parameter& q, const ParameterEstimate& e, bool explained) {
  Knowledge k;
  k.data = DataSigma(e);
  k.sigma = std::hypot(k.data, e.sigma_model);
  k.known_within = KnownWithin(q, e.value);
  k.size = e.value != 0.0 ? std::abs(e.value) : k.known_within;
  k.explained = explained;
  // What the marks do not respond to may stand anywhere, at a bound too.
  const double to_bound = std::min(e.value - q.low, q.high - e.value);
  k.at_bound = e.sigma_alone <= k.known_within &&
               (to_bound <= kAtBoundSigmas * e.sigma || to_bound <= 1e-9 * std::abs(e.value));
  return k;
}

Verdict Decide(const Knowledge& k, const ParameterEstimate& e) {
  if (!e.with.empty() && (!k.at_bound || !std::isfinite(k.data))) return Verdict::kCombination;
  if (k.at_bound) return Verdict::kAtBound;
  if (!(k.sigma <= k.known_within)) return Verdict::kNotDetermined;
  if (!k.explained || k.rests_on != nullptr) return Verdict::kIfModelHolds;
  return e.sigma_model > e.sigma_data ? Verdict::kMeshLimited : Verdict::kDetermined;
}

// The verdict with its numbers.
std::string ReasonOf(const Knowledge& k, const Parameter& q, const ParameterEstimate& e) {
  const std::string profile = ProfileWords(e, q);
  const double percent = 100.0 / k.size;
  switch (e.verdict) {
    case Verdict::kCombination:
      return "determined only in combination with " + JoinWords(e.with) +
             ": the data leave open how much each of them contributes" + profile;
    case Verdict::kAtBound:
      return fmt::format(
          "the best value is the bound {:.4g}: the data want to go beyond it, so its standard "
          "error "
          "means nothing",
          e.value - q.low < q.high - e.value ? q.low : q.high);
    case Verdict::kNotDetermined:
      return e.sigma < 1e3 * k.size ? fmt::format("its standard error is {:.0f}% of its value{}",
                                                  percent * e.sigma, profile)
                                    : "the marks do not respond to it" + profile;
    case Verdict::kIfModelHolds:
      if (k.explained) {
        return fmt::format(
            "would be known to {}% of its value{}, but what was stated of {} and the data "
            "contradict each other: without that it is about {:.4g}",
            Number(percent * e.sigma, 2), profile, k.rests_on->name, k.without);
      }
      return fmt::format(
          "would be known to {}% of its value{}, but the model does not explain the data: it "
          "may be off by more than that",
          Number(percent * e.sigma, 2), profile);
    case Verdict::kMeshLimited:
      return fmt::format(
          "known to {}% of its value; the data alone would give {}%, the model's own error adds "
          "{}%: "
          "a model with less of it would tell more{}",
          Number(percent * e.sigma, 2), Number(percent * e.sigma_data, 2),
          Number(percent * e.sigma_model, 2), profile);
    case Verdict::kDetermined:
      break;
  }
  return fmt::format("known to {}% of its value{}", Number(percent * e.sigma, 2), profile);
}

}  // namespace

void Judge(const FitProblem& problem, const ReducedProblem& reduced,
           const ReducedProblem::Point& point, FitResult* r) {
  const Eigen::MatrixXd projected = reduced.Project(point, r->sensitivity);
  const Eigen::MatrixXd space = SpaceOfLittleKnown(projected.transpose() * projected);
  const bool explained = std::none_of(r->trials.begin(), r->trials.end(), [](const TrialResult& t) {
    return t.goodness.outcome == Explained::kNo;
  });
  for (std::size_t j = 0; j < r->parameters.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    const Parameter& q = problem.parameters[j];
    ParameterEstimate& e = r->parameters[j];
    // 1. What it shows: alone, and beyond what frame, offset and calibration imitate.
    const double effect = r->sensitivity.col(c).norm(), own = projected.col(c).norm();
    e.imitated = effect > 0.0 ? 1.0 - own * own / (effect * effect) : 0.0;
    e.sigma_alone = own > 0.0 ? 1.0 / own : std::numeric_limits<double>::infinity();
    e.data95 = IntervalOfData(q, e);
    e.all95 = IntervalOfAllParts(q, e, r->ladder.one_sided);
    Knowledge k = KnowledgeOf(q, e, explained);
    k.rests_on = RestsOn(*r, j);
    if (k.rests_on != nullptr) k.without = e.value + k.rests_on->shift(c);
    // 2. What hides it, where it is not known: other parameters, or what is fitted beside them.
    e.with.clear();
    if (k.sigma > k.known_within) {
      if (e.sigma_alone < kHidden * k.data) e.with = Partners(problem.parameters, space, c);
      if (e.with.empty() && e.imitated > kImitated) e.with = Imitators(reduced, point, *r, c);
    }
    // 3. The verdict.
    e.verdict = Decide(k, e);
    e.reason = ReasonOf(k, q, e);
    if (e.kink > kKink) {
      e.reason += fmt::format(
          "; differences to either side disagree by {:.0f}% (an impact comes or goes), so the "
          "flatter side was taken",
          100.0 * e.kink);
    }
  }
}

const char* Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kDetermined:
      return "determined";
    case Verdict::kMeshLimited:
      return "limited by the model's own error";
    case Verdict::kCombination:
      return "determined only in combination";
    case Verdict::kAtBound:
      return "at its bound";
    case Verdict::kNotDetermined:
      return "not determined";
    case Verdict::kIfModelHolds:
      return "known only if the model holds";
  }
  return "";
}

}  // namespace unfurl::correlate
