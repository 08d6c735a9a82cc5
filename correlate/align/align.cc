#include "correlate/align/align.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace unfurl::correlate {

namespace {

constexpr std::size_t kFewest = 20;  // samples for six frame numbers, an offset and a check

struct Refined {
  RegistrationFit fit;
  Prediction reference;
  double drift = 0.0;  // already out of the stamps that the fit was made with
  bool converged = false;
};

// Of the median steps of all marks, the largest [s].
double LargestStep(const Observations& a) {
  double step = 0.0;
  for (const MarkSeries& m : a.marks) step = std::max(step, MedianStep(m.t));
  return step;
}

// Frame and offset together, the reference asked anew at each offset; with a drift also the record
// is given its stamps anew.
Refined Refine(const Observations& record, const SampledModel& b, double offset, double drift,
               const AlignOptions& options) {
  // Rounds end at a thousandth of a standard error. Where samples cross a jump of the reference as
  // the offset moves, they may go to and fro for ever by more; a tenth adds half a per cent to the
  // error and is let pass.
  constexpr int kMaxRounds = 30;
  constexpr double kSettled = 1e-3, kLetPass = 0.1;
  const bool drifts = options.registration.fit_drift;
  const double pivot = options.registration.drift_pivot;
  Refined out;
  out.drift = drift;
  Observations restamped;
  if (drifts) restamped = WithoutDrift(record, drift, pivot);
  const Observations& a = drifts ? restamped : record;
  out.reference = b.Evaluate({}, a.StampsAt(offset));
  Registration start = StartingFrame(a, out.reference, offset);
  RegistrationOptions one = options.registration;
  for (int round = 0; round < kMaxRounds; ++round) {
    // The linear step in time holds near the reference's stamps only: one step, then ask again.
    one.max_iterations = 1;
    out.fit = FitRegistration(a, out.reference, offset, start, one);
    start = out.fit.at;
    if (out.fit.known < kFewest) return out;
    double turned = 0.0;  // standard errors by which the drift still moved
    if (drifts) {
      const double sigma = out.fit.sigma(options.registration.fit_frame ? 7 : 1);
      turned = sigma > 0.0 ? std::abs(start.drift) / sigma : 0.0;  // 0: not determined, not moved
      out.drift = (1.0 + out.drift) / (1.0 - start.drift) - 1.0;
      restamped = WithoutDrift(record, out.drift, pivot);
      start.drift = 0.0;
    }
    const Eigen::Index time = options.registration.fit_frame ? 6 : 0;
    const double sigma = options.registration.fit_offset ? out.fit.sigma(time) : 1.0;
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
  if (drifts) {  // a thousandth of a standard error, which the stamps need not follow
    out.drift = (1.0 + out.drift) / (1.0 - out.fit.at.drift) - 1.0;
    out.fit.at.drift = 0.0;
  }
  return out;
}

// Sum of squares of the residuals and of the marks' motion about their own means [m^2].
std::pair<double, double> Squares(const Observations& a, const Refined& r) {
  const auto residuals = ResidualsInModelFrame(a, r.reference, r.fit.at.offset, r.fit.at);
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

// The same marks with a variance added to each coordinate of each sample [m^2].
Observations Loosened(Observations a, double variance) {
  for (MarkSeries& m : a.marks) {
    for (int diagonal : {0, 3, 5}) m.cov.row(diagonal).array() += variance;
  }
  return a;
}

// A reference that does not fit must not be followed at the price of the calibration's draw, and it
// is its misfit, not the marks' sigma, that limits the alignment: the variance that the residuals
// show is added to the marks' own until it changes no more. Gives that variance [m^2].
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
    variance =
        Squares(WithoutDrift(a, best->drift, options.registration.drift_pivot), *best).first /
        samples;
    if (round > 0 && std::abs(variance - before) < 0.01 * variance) break;
    *best = Refine(Loosened(a, variance), b, best->fit.at.offset, best->drift, options);
  }
  return variance;
}

void FillCovariance(const Observations& a, Alignment* out) {
  const Eigen::MatrixXd& J = out->fit.jacobian;
  out->unknowns.resize(static_cast<std::size_t>(J.cols()));
  const Eigen::MatrixXd normal = J.transpose() * J;
  const Eigen::MatrixXd inverse =
      normal.ldlt().solve(Eigen::MatrixXd::Identity(J.cols(), J.cols()));
  // Without sigmas the residuals themselves set the scale.
  out->noise = EstimateResidualNoise(a, out->fit.residual, a.has_sigma ? 1.0 : 0.0);
  const Eigen::Index k = a.shared_rank;
  Eigen::MatrixXd middle = out->noise.Middle(J);
  if (k > 0) middle += J.bottomRows(k).transpose() * J.bottomRows(k);
  out->covariance = inverse * middle * inverse;
  const double unit = a.has_sigma ? 1.0 : out->noise.variance;
  out->white_sigma = (unit * inverse.diagonal()).cwiseMax(0.0).cwiseSqrt();
}

}  // namespace

const char* Name(AlignStatus status) {
  switch (status) {
    case AlignStatus::kGood:
      return "good";
    case AlignStatus::kNothingShared:
      return "nothing shared";
    case AlignStatus::kTooLittle:
      return "too little in common";
    case AlignStatus::kNotConverged:
      return "not converged";
  }
  return "";
}

double Alignment::Sigma(const std::string& unknown) const {
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    if (unknowns[i] == unknown) return std::sqrt(std::max(0.0, covariance(j, j)));
  }
  return 0.0;
}

namespace {

// The candidate offset that leaves the least squares per sample once refined; false: none has
// enough samples with a counterpart.
bool FindBest(const Observations& record, const SampledModel& b, const OffsetSearch& search,
              double min_correlation, const AlignOptions& options, Refined* best,
              double* correlation) {
  const auto per_sample = [](const Refined& r) {
    return r.fit.SumOfSquares() / static_cast<double>(r.fit.known);
  };
  bool found = false;
  for (const OffsetCandidate& candidate : search.candidates) {
    if (candidate.correlation < min_correlation) continue;
    Refined refined = Refine(record, b, candidate.offset, 0.0, options);
    if (refined.fit.known < kFewest) continue;
    if (found && !(per_sample(refined) < per_sample(*best))) continue;
    *best = std::move(refined);
    *correlation = candidate.correlation;
    found = true;
  }
  return found;
}

// Status and message of an alignment that was found.
void Judge(bool converged, double min_r2, Alignment* out) {
  if (out->r2 < min_r2) {
    out->status = AlignStatus::kNothingShared;
    out->message = fmt::format(
        "the records share nothing: with the best frame and time offset ({:.4f} s) the reference "
        "explains {:.0f}% of the marks' motion ({:.0f}% is asked)",
        out->at.offset, 100.0 * std::max(0.0, out->r2), 100.0 * min_r2);
    return;
  }
  if (!converged) {
    out->status = AlignStatus::kNotConverged;
    out->message = "frame and time offset did not settle";
    return;
  }
  out->status = AlignStatus::kGood;
  out->message = fmt::format("aligned on {} samples; the reference explains {:.3f}% of the motion",
                             out->fit.known, 100.0 * out->r2);
  if (!out->fit.weak.empty()) {
    out->message += "; not determined by these marks: " + JoinWords(out->fit.weak);
  }
}

// The first and last stamp with a counterpart in the reference.
void FillOverlap(const Observations& a, Alignment* out) {
  double first = std::numeric_limits<double>::infinity(), last = -first;
  for (std::size_t m = 0; m < a.marks.size(); ++m) {
    const auto& known = out->reference.marks[m].known;
    for (std::size_t i = 0; i < a.marks[m].size(); ++i) {
      if (!known.empty() && !known[i]) continue;
      first = std::min(first, a.marks[m].t[i]);
      last = std::max(last, a.marks[m].t[i]);
    }
  }
  out->overlap_start = first;
  out->overlap_end = last;
}

}  // namespace

// Offset by correlation, frame and offset by least squares from the best candidates, then the
// covariance and how much of the motion the reference explains.
Alignment Align(const Observations& record, const SampledModel& b, const AlignOptions& asked) {
  Alignment out;
  AlignOptions options = asked;
  if (record.size() > 0) options.registration.drift_pivot = 0.5 * (record.Start() + record.End());
  if (record.size() < kFewest) {
    out.message =
        fmt::format("the record has {} samples; {} are the fewest", record.size(), kFewest);
    return out;
  }
  std::vector<std::string> marks;
  for (const MarkSeries& m : record.marks) marks.push_back(m.name);
  const OffsetSearch search = FindOffset(SampledModel(record), b, marks, options.search);
  out.signal = search.signal;
  const double min_correlation =
      search.independent > 1 ? options.min_correlation : options.min_correlation_of_one;
  const double min_r2 = search.independent > 1 ? options.min_r2 : options.min_r2_of_one;
  if (search.candidates.empty()) {
    out.message = fmt::format(
        "no time offset leaves enough in common: {} samples against {}, at least {:.0f}% of the "
        "shorter record must overlap and move",
        record.size(), b.samples().size(), 100.0 * options.search.min_overlap);
    return out;
  }
  out.correlation = search.candidates.front().correlation;
  if (out.correlation < min_correlation) {
    out.status = AlignStatus::kNothingShared;
    out.message = fmt::format(
        "the records share nothing: over all time offsets the {} correlate by {:.2f} at most "
        "({:.2f} is asked)",
        out.signal, out.correlation, min_correlation);
    return out;
  }

  Refined best;
  const bool found = FindBest(record, b, search, min_correlation, options, &best, &out.correlation);
  if (!found) {
    out.message = fmt::format("fewer than {} samples have a counterpart in the reference", kFewest);
    return out;
  }
  const double variance = RefineWithMisfit(record, b, options, &best);
  out.drift = best.drift;
  out.drift_pivot = options.registration.drift_pivot;
  const Observations a = WithoutDrift(record, out.drift, out.drift_pivot);
  out.misfit = std::sqrt(variance);
  const auto [left, motion] = Squares(a, best);
  out.fit = std::move(best.fit);
  out.reference = std::move(best.reference);
  out.at = out.fit.at;
  out.r2 = motion > 0.0 ? 1.0 - left / motion : 0.0;
  FillCovariance(variance > 0.0 ? Loosened(a, variance) : a, &out);
  out.unknowns = NuisanceNames(options.registration, a.shared_rank);
  if (variance > 0.0) {  // what was weighed less is still told in the marks' own sigmas
    RegistrationOptions none = options.registration;
    none.max_iterations = 0;
    out.fit.residual = FitRegistration(a, out.reference, out.at.offset, out.at, none).residual;
  }
  const double dof =
      std::max(1.0, 3.0 * static_cast<double>(out.fit.known) -
                        static_cast<double>(out.fit.jacobian.cols() - a.shared_rank));
  out.chi2_per_dof = a.has_sigma ? out.fit.SumOfSquares() / dof : 0.0;
  FillOverlap(a, &out);
  Judge(best.converged, min_r2, &out);
  return out;
}

}  // namespace unfurl::correlate
