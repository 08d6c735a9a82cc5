#include "correlate/fit/verdict.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace unfurl::correlate {

namespace {

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
      const std::string& name = r.trials[t].nuisances[static_cast<std::size_t>(i)];
      if (part(i) >= kLarge * largest &&
          std::find(names.begin(), names.end(), name) == names.end()) {
        names.push_back(name);
      }
    }
  }
  return names;
}

std::string ProfileWords(const ParameterEstimate& e, const std::string& unit) {
  const Profile& profile = e.profile;
  if (profile.points.empty()) return "";
  const bool low = std::isfinite(profile.low), high = std::isfinite(profile.high);
  if (low && high) {
    return fmt::format(
        "; 95% interval {:.5g} to {:.5g} {} (of the data alone, by profile, "
        "{:.5g} to {:.5g})",
        e.all95.low, e.all95.high, unit, e.data95.low, e.data95.high);
  }
  if ((!low && profile.lost_low) || (!high && profile.lost_high)) {
    return "; its profile could not be followed (the model is rough there)";
  }
  if (!low && !high) {
    return fmt::format("; its profile stays below the 95% level from {:.4g} to {:.4g} {}",
                       profile.reached_low, profile.reached_high, unit);
  }
  return low ? fmt::format("; its profile stays below the 95% level up to {:.4g} {}",
                           profile.reached_high, unit)
             : fmt::format("; its profile stays below the 95% level down to {:.4g} {}",
                           profile.reached_low, unit);
}

}  // namespace

void Judge(const FitProblem& problem, const ReducedProblem& reduced,
           const ReducedProblem::Point& point, FitResult* r) {
  const auto p = static_cast<Eigen::Index>(r->parameters.size());
  const Eigen::MatrixXd projected = reduced.Project(point, r->sensitivity);
  const Eigen::MatrixXd information = projected.transpose() * projected;

  // Directions in which little is known, parameters scaled to what each would show alone.
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(scale.asDiagonal() * information * scale.asDiagonal()));
  // Onto the space in which little is known. Its eigenvectors mix sets that have nothing to do with
  // one another wherever their eigenvalues are alike; the projection onto all of it does not.
  Eigen::MatrixXd together = Eigen::MatrixXd::Zero(p, p);
  for (Eigen::Index v = 0; v < p && eigen.eigenvalues()(v) <= kHidden * kHidden; ++v) {
    together += eigen.eigenvectors().col(v) * eigen.eigenvectors().col(v).transpose();
  }

  const bool explained = std::none_of(r->trials.begin(), r->trials.end(), [](const TrialResult& t) {
    return t.goodness.outcome == Explained::kNo;
  });
  for (std::size_t j = 0; j < r->parameters.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    const Parameter& q = problem.parameters[j];
    ParameterEstimate& e = r->parameters[j];
    const double effect = r->sensitivity.col(c).norm();
    e.imitated = effect > 0.0 ? 1.0 - projected.col(c).squaredNorm() / (effect * effect) : 0.0;
    e.sigma_alone = projected.col(c).norm() > 0.0 ? 1.0 / projected.col(c).norm()
                                                  : std::numeric_limits<double>::infinity();

    const double data = DataSigma(e);
    const double sigma = std::hypot(data, e.sigma_model);
    const double known_within = KnownWithin(q, e.value);
    const double size = e.value != 0.0 ? std::abs(e.value) : known_within;
    const double to_bound = std::min(e.value - q.low, q.high - e.value);
    e.data95 = IntervalOfData(q, e);
    e.all95 = IntervalOfAllParts(q, e);
    const std::string profile = ProfileWords(e, q.unit);
    e.with.clear();
    if (sigma > known_within) {
      for (Eigen::Index l = 0; l < p; ++l) {
        const double own = std::max(together(c, c), together(l, l));
        if (l != c && std::abs(together(c, l)) > kTakesPart * own) {
          e.with.push_back(problem.parameters[static_cast<std::size_t>(l)].name);
        }
      }
      const bool hidden = e.sigma_alone < kHidden * data;
      if (!hidden) e.with.clear();
      if (e.with.empty() && e.imitated > kImitated) e.with = Imitators(reduced, point, *r, c);
    }
    // What the marks do not answer to may stand anywhere, at a bound too.
    const bool at_bound = e.sigma_alone <= known_within && (to_bound <= kAtBoundSigmas * e.sigma ||
                                                            to_bound <= 1e-9 * std::abs(e.value));
    if (!e.with.empty() && (!at_bound || !std::isfinite(data))) {
      e.verdict = Verdict::kCombination;
      e.reason = "determined only in combination with " + JoinWords(e.with) +
                 ": the data leave open how much each of them has of it" + profile;
    } else if (at_bound) {
      e.verdict = Verdict::kAtBound;
      e.reason = fmt::format(
          "the best value is the bound {:.4g}: the data want to go beyond it, "
          "so its standard error means nothing",
          e.value - q.low < q.high - e.value ? q.low : q.high);
    } else if (!(sigma <= known_within)) {
      e.verdict = Verdict::kNotDetermined;
      e.reason = e.sigma < 1e3 * size ? fmt::format("its standard error is {:.0f}% of its value{}",
                                                    100.0 * e.sigma / size, profile)
                                      : "the marks do not answer to it" + profile;
    } else if (!explained) {
      e.verdict = Verdict::kIfModelHolds;
      e.reason = fmt::format(
          "would be known to {:.2g}% of its value{}, but the model does not explain the data: it "
          "may be off by more than that",
          100.0 * e.sigma / size, profile);
    } else if (e.sigma_model > e.sigma_data) {
      e.verdict = Verdict::kMeshLimited;
      e.reason = fmt::format(
          "known to {:.2g}% of its value; the data alone would give {:.2g}%, the model's own error "
          "adds {:.2g}%: a model with less of it would tell more{}",
          100.0 * e.sigma / size, 100.0 * e.sigma_data / size, 100.0 * e.sigma_model / size,
          profile);
    } else {
      e.verdict = Verdict::kDetermined;
      e.reason = fmt::format("known to {:.2g}% of its value{}", 100.0 * e.sigma / size, profile);
    }
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
