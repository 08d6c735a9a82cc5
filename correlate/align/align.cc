#include "correlate/align/align.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/fixed_number.h"
#include "base/text.h"
#include "correlate/align/channel_align.h"
#include "correlate/align/far_samples.h"
#include "correlate/align/refine.h"
#include "correlate/align/unit_doubt.h"

namespace unfurl::correlate {

namespace {

void FillCovariance(const Observations& a, Alignment* out) {
  const Eigen::MatrixXd& J = out->fit.jacobian;
  if (J.cols() == 0) {  // all is known
    out->noise = EstimateResidualNoise(a, out->fit.residual, a.has_sigma ? 1.0 : 0.0);
    return;
  }
  out->unknowns.resize(static_cast<std::size_t>(J.cols()));
  const Eigen::MatrixXd normal = J.transpose() * J;
  const Eigen::MatrixXd inverse =
      normal.ldlt().solve(Eigen::MatrixXd::Identity(J.cols(), J.cols()));
  // Without sigmas the residuals themselves set the scale.
  out->noise = EstimateResidualNoise(a, out->fit.residual, a.has_sigma ? 1.0 : 0.0);
  // What is known beforehand of clock, frame and calibration.
  const Eigen::Index known = a.PriorRows() + a.shared_rank;
  Eigen::MatrixXd middle = out->noise.Middle(J);
  if (known > 0) middle += J.bottomRows(known).transpose() * J.bottomRows(known);
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
    if (unknowns[i] == unknown) return std::sqrt(std::max(covariance(j, j), 0.0));
  }
  return 0.0;
}

namespace {

double StartingDrift(const Observations& record) {
  return record.placement.drift.Told() ? record.placement.drift.mean : 0.0;
}

// Whether what is known of the clock alone places the reference as well as an alignment is asked to
// be: an offset that is wrong by its sigma leaves at least this share of the motion explained. Then
// there is nothing for the search to be misled by, and two records that differ are two records that
// differ.
bool PlacedBeforehand(const Observations& record, const SampledModel& b, double min_r2) {
  const Prior& known = record.placement.offset;
  if (!known.Told()) return false;
  if (known.kind == Foreknowledge::kKnown) return true;
  const Prediction at = b.Evaluate({}, record.StampsAt(known.mean));
  double speeds = 0.0, motion = 0.0;
  for (const MarkMotion& mark : at.marks) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double n = 0.0, squares = 0.0;
    for (Eigen::Index i = 0; i < mark.p.cols(); ++i) {
      if (!mark.known.empty() && !mark.known[static_cast<std::size_t>(i)]) continue;
      sum += mark.p.col(i);
      squares += mark.p.col(i).squaredNorm();
      speeds += mark.v.col(i).squaredNorm();
      n += 1.0;
    }
    if (n > 0.0) motion += std::max(0.0, squares - sum.squaredNorm() / n);
  }
  return known.sigma * known.sigma * speeds <= (1.0 - min_r2) * motion;
}

// Offsets to begin with: the peaks of a correlation, within what is known of the offset, and what
// is known itself.
OffsetSearch Search(const Observations& record, const SampledModel& b,
                    const std::vector<std::string>& marks, const AlignOptions& options) {
  const Prior& known = record.placement.offset;
  OffsetSearch placed;
  for (const double at : options.at) placed.candidates.push_back({at, 1.0, 1.0});
  if (!options.at.empty()) return placed;
  if (known.kind == Foreknowledge::kKnown) {
    OffsetSearch out;
    out.candidates = {{known.mean, 1.0, 1.0}};
    return out;
  }
  OffsetOptions search = options.search;
  constexpr double kWithin = 4.0;  // standard deviations of the prior: one in 16 000 lies beyond
  if (known.kind == Foreknowledge::kNormal) {
    search.low = std::max(search.low, known.mean - kWithin * known.sigma);
    search.high = std::min(search.high, known.mean + kWithin * known.sigma);
  }
  return FindOffset(SampledModel(record), b, marks, search);
}

// Mean square of the samples' distance from their mark's mean, in their sigmas: what a model that
// knows nothing of a sample leaves unexplained. One that starts in motion would else fit best where
// it is compared with least.
double MotionOf(const Observations& record) {
  double sum = 0.0;
  for (const MarkSeries& m : record.marks) {
    if (m.size() == 0) continue;
    const Eigen::Vector3d mean = m.p.rowwise().mean();
    const auto trace = m.cov.row(0) + m.cov.row(3) + m.cov.row(5);
    sum += 3.0 * (m.p.colwise() - mean).colwise().squaredNorm().cwiseQuotient(trace).sum();
  }
  return sum / std::max(1.0, static_cast<double>(record.size()));
}

// The candidate offset that leaves the least squares per sample once refined; false: none has
// enough samples with a counterpart. The calibration's draw, dozens of unknowns, waits for the
// best: it takes microns away, and from every candidate alike.
bool FindBest(const Observations& record, const SampledModel& b, const OffsetSearch& search,
              double min_correlation, const AlignOptions& options, Refined* best,
              double* correlation) {
  const double hidden = b.samples().held_before || b.samples().has_sigma ? 0.0 : MotionOf(record);
  const auto per_sample = [&](const Refined& r) {
    const double known = static_cast<double>(r.fit.known);
    if (hidden == 0.0) return r.fit.SumOfSquares() / known;
    const double all = static_cast<double>(record.size());
    return (r.fit.SumOfSquares() + hidden * (all - known)) / all;
  };
  const std::size_t fewest = FewestAligned(record, options.registration);
  const bool draws = record.shared_rank > 0;
  const Observations plain = draws ? WithoutDraw(record) : Observations();
  const Observations& used = draws ? plain : record;
  bool found = false;
  for (const OffsetCandidate& candidate : search.candidates) {
    if (candidate.correlation < min_correlation) continue;
    Refined refined = Refine(used, b, candidate.offset, StartingDrift(record), options);
    if (refined.fit.known < fewest) continue;
    if (options.search.IsKnown(refined.fit.at.offset)) continue;
    if (found && !(per_sample(refined) < per_sample(*best))) continue;
    *best = std::move(refined);
    *correlation = candidate.correlation;
    found = true;
  }
  if (found && draws) *best = Refine(record, b, best->fit.at.offset, best->drift, options);
  return found;
}

// Status and message of an alignment that was found.
void JudgeAlignment(bool converged, double min_r2, Alignment* out) {
  if (out->r2 < min_r2) {
    out->status = AlignStatus::kNothingShared;
    out->message = fmt::format(
        "the records share nothing: with the best frame and time offset ({} s) the reference "
        "explains {:.0f}% of the marks' motion ({:.0f}% is asked)",
        FixedNumber(out->at.offset), 100.0 * std::max(0.0, out->r2), 100.0 * min_r2);
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

namespace {

Alignment AlignAsIs(const Observations& record, const SampledModel& b, const AlignOptions& asked) {
  Alignment out;
  const AlignOptions& options = asked;
  const std::size_t fewest = FewestAligned(record, options.registration);
  if (record.size() < fewest) {
    out.message =
        fmt::format("the record has {} samples; {} are the fewest{}", record.size(), fewest,
                    fewest > 1 ? " where frame, offset or drift is to be found" : "");
    return out;
  }
  std::vector<std::string> marks;
  for (const MarkSeries& m : record.marks) marks.push_back(m.name);
  OffsetSearch search = Search(record, b, marks, options);
  out.signal = search.signal;
  double min_correlation =
      search.independent > 1 ? options.min_correlation : options.min_correlation_of_one;
  double min_r2 = search.independent > 1 ? options.min_r2 : options.min_r2_of_one;
  if (PlacedBeforehand(record, b, min_r2)) {
    constexpr double kNothingAsked = -std::numeric_limits<double>::infinity();
    min_correlation = min_r2 = kNothingAsked;
    if (record.placement.offset.kind == Foreknowledge::kNormal) {
      search.candidates.push_back({record.placement.offset.mean, 0.0, 1.0});
    }
  }
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
    out.message = fmt::format("fewer than {} of {} samples have a counterpart in the reference",
                              fewest, record.size());
    return out;
  }
  const double variance = RefineWithMisfit(record, b, options, &best);
  out.drift = best.drift;
  out.drift_pivot = record.Pivot();
  const Observations a = WithoutDrift(record, out.drift, out.drift_pivot);
  out.misfit = std::sqrt(variance);
  const auto [left, motion] = Squares(a, best);
  out.fit = std::move(best.fit);
  out.reference = std::move(best.reference);
  out.at = out.fit.at;
  out.r2 = motion > 0.0 ? 1.0 - left / motion : 0.0;
  FillCovariance(variance > 0.0 ? Loosened(a, variance) : a, &out);
  out.unknowns = NuisanceNames(WithPlacement(options.registration, record), a);
  if (variance > 0.0) {  // what was weighed less is still told in the marks' own sigmas
    RegistrationOptions none = options.registration;
    none.max_iterations = 0;
    out.fit.residual = FitRegistration(a, out.reference, out.at.offset, out.at, none).residual;
  }
  const double dof = std::max(
      1.0, 3.0 * static_cast<double>(out.fit.known) -
               static_cast<double>(out.fit.jacobian.cols() - a.shared_rank - a.PriorRows()));
  out.chi2_per_dof = a.has_sigma ? out.fit.SumOfSquares() / dof : 0.0;
  FillOverlap(a, &out);
  JudgeAlignment(best.converged, min_r2, &out);
  return out;
}

// What was aligned without the far samples is told of all of them.
void TakeAllSamples(const Observations& record, const SampledModel& b, const AlignOptions& options,
                    std::vector<FarSample> far, Alignment* out) {
  out->far = std::move(far);
  if (out->reference.marks.empty()) return;
  out->message += "; left out: " + Words(record, out->far);
  const Observations all = WithoutDrift(record, out->drift, out->drift_pivot);
  out->reference = b.Evaluate({}, all.StampsAt(out->at.offset));
  RegistrationOptions none = options.registration;
  none.max_iterations = 0;
  out->fit.residual = FitRegistration(all, out->reference, out->at.offset, out->at, none).residual;
}

}  // namespace

// Offset by correlation, frame and offset by least squares from the best candidates, then the
// covariance and how much of the motion the reference explains.
Alignment Align(const Observations& record, const SampledModel& b, const AlignOptions& asked) {
  if (record.marks.empty()) return AlignChannels(record, b, asked);
  std::vector<FarSample> far = FindFarSamples(record);
  Alignment out = AlignAsIs(far.empty() ? record : Without(record, far), b, asked);
  if (!far.empty()) TakeAllSamples(record, b, asked, std::move(far), &out);
  // What was not aligned for its units, and what was though a known clock asked for nothing.
  constexpr double kNothing = 0.5;
  if (!out.Usable() || out.r2 < kNothing) {
    const std::string doubt = UnitDoubt(CompareUnits(record, b.samples()));
    if (!doubt.empty()) out.message += "; " + doubt;
  }
  return out;
}

std::vector<double> OffsetsAlike(const Observations& record, const SampledModel& b,
                                 const AlignOptions& options) {
  if (record.marks.empty()) return ChannelOffsetsAlike(record, b, options);
  std::vector<std::string> marks;
  for (const MarkSeries& m : record.marks) marks.push_back(m.name);
  std::vector<double> out;
  for (const OffsetCandidate& c : Search(record, b, marks, options).candidates) {
    out.push_back(c.offset);
  }
  return out;
}

}  // namespace unfurl::correlate
