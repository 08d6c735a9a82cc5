#include "correlate/align/refine.h"

#include <algorithm>
#include <cmath>

namespace unfurl::correlate {

namespace {

// Of the median steps of all marks, the largest [s].
double LargestStep(const Observations& a) {
  double step = 0.0;
  for (const MarkSeries& m : a.marks) step = std::max(step, MedianStep(m.t));
  return step;
}

}  // namespace

std::size_t FewestAligned(const Observations& record, const RegistrationOptions& options) {
  // 20: of three coordinates each, some sixty for eight unknowns and a check; 1: there is
  // something.
  constexpr std::size_t kSought = 20, kKnown = 1;  // samples
  const RegistrationOptions fitted = WithPlacement(options, record);
  const Placement& known = record.placement;
  // An offset that nothing is said of is sought before it is fitted, or not fitted. A drift follows
  // from its prior where the samples say nothing.
  const bool clock = known.offset.kind == Foreknowledge::kKnown &&
                     (!fitted.fit_drift || known.drift.kind == Foreknowledge::kNormal);
  return clock && !fitted.fit_frame ? kKnown : kSought;
}

Refined Refine(const Observations& record, const SampledModel& b, double offset, double drift,
               const AlignOptions& options) {
  // Rounds end at a thousandth of a standard error. Where samples cross a jump of the reference as
  // the offset moves, they may go to and fro for ever by more; a tenth adds half a per cent to the
  // error and is let pass.
  constexpr int kMaxRounds = 30;
  constexpr double kSettled = 1e-3, kLetPass = 0.1;
  const RegistrationOptions fitted = WithPlacement(options.registration, record);
  const double pivot = record.Pivot();
  const Eigen::Index time = fitted.fit_frame ? 6 : 0, rate = time + (fitted.fit_offset ? 1 : 0);
  const std::size_t fewest = FewestAligned(record, options.registration);
  Refined out;
  out.drift = drift;
  Observations restamped;
  const bool moves_stamps = fitted.fit_drift || drift != 0.0;
  if (moves_stamps) restamped = WithoutDrift(record, drift, pivot);
  const Observations& a = moves_stamps ? restamped : record;
  out.reference = b.Evaluate({}, a.StampsAt(offset));
  Registration start = StartingFrame(a, out.reference, offset);
  RegistrationOptions one = options.registration;
  for (int round = 0; round < kMaxRounds; ++round) {
    // The linear step in time holds near the reference's stamps only: one step, then ask again.
    one.max_iterations = 1;
    out.fit = FitRegistration(a, out.reference, offset, start, one);
    start = out.fit.at;
    if (out.fit.known < fewest) return out;
    double turned = 0.0;  // standard errors by which the drift still moved
    if (fitted.fit_drift) {
      const double sigma = out.fit.sigma(rate);
      turned = sigma > 0.0 ? std::abs(start.drift) / sigma : 0.0;  // 0: not determined, not moved
      out.drift = (1.0 + out.drift) * (1.0 + start.drift) - 1.0;
      restamped = WithoutDrift(record, out.drift, pivot);
      start.drift = 0.0;
    }
    const double sigma = fitted.fit_offset ? out.fit.sigma(time) : 1.0;
    const double moved = std::abs(out.fit.at.offset - offset);
    offset = out.fit.at.offset;
    out.reference = b.Evaluate({}, a.StampsAt(offset));
    // Without sigmas the unit weight is 1 m and no standard error tells: then a hundred-thousandth
    // of the samples' step settles it.
    constexpr double kNoSigma = 1e-2;
    const double moves = a.has_sigma ? std::max(sigma > 0.0 ? moved / sigma : 0.0, turned)
                                     : moved / (kNoSigma * LargestStep(a));
    out.converged = round > 0 && moves <= (round + 1 < kMaxRounds ? kSettled : kLetPass);
    if (out.converged) break;
  }
  one.max_iterations = options.registration.max_iterations;
  out.fit = FitRegistration(a, out.reference, offset, start, one);
  if (fitted.fit_drift) {  // a thousandth of a standard error, which the stamps need not follow
    out.drift = (1.0 + out.drift) * (1.0 + out.fit.at.drift) - 1.0;
    out.fit.at.drift = 0.0;
  }
  return out;
}

std::pair<double, double> Squares(const Observations& a, const Refined& r) {
  const auto residuals = ResidualsInModelFrame(a, r.reference, r.fit.at.clock(), r.fit.at);
  double left = 0.0, motion = 0.0;
  for (std::size_t m = 0; m < a.marks.size(); ++m) {
    const auto& known = r.reference.marks[m].known;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double n = 0.0;
    for (Eigen::Index i = 0; i < a.marks[m].p.cols(); ++i) {
      if (known.empty() || known[static_cast<std::size_t>(i)]) mean += a.marks[m].p.col(i), n += 1;
    }
    if (n == 0.0) continue;
    mean /= n;
    for (Eigen::Index i = 0; i < a.marks[m].p.cols(); ++i) {
      if (!known.empty() && !known[static_cast<std::size_t>(i)]) continue;
      left += residuals[m].col(i).squaredNorm();
      motion += (a.marks[m].p.col(i) - mean).squaredNorm();
    }
  }
  return {left, motion};
}

Observations Loosened(Observations a, double variance) {
  for (MarkSeries& m : a.marks) {
    for (int diagonal : {0, 3, 5}) m.cov.row(diagonal).array() += variance;
  }
  return a;
}

double RefineWithMisfit(const Observations& a, const SampledModel& b, const AlignOptions& options,
                        Refined* best) {
  // Residuals of twice their sigma. With a right model the mean square of thousands of them is 1
  // within a few hundredths, so this is no chance; but covariances may be wrong by some tens of per
  // cent without the reference being to blame, and then the weights they give are still the best.
  constexpr double kFits = 4.0;
  constexpr int kRounds = 6;
  double variance = 0.0;
  if (!a.has_sigma) return variance;
  for (int round = 0; round < kRounds; ++round) {
    const double samples = 3.0 * static_cast<double>(best->fit.known);
    if (round == 0 && best->fit.SumOfSquares() < kFits * samples) break;
    const double before = variance;
    variance = Squares(WithoutDrift(a, best->drift, a.Pivot()), *best).first / samples;
    if (round > 0 && std::abs(variance - before) < 0.01 * variance) break;
    *best = Refine(Loosened(a, variance), b, best->fit.at.offset, best->drift, options);
  }
  return variance;
}

}  // namespace unfurl::correlate
