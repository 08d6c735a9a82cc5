#include "correlate/fit/goodness.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/statistics.h"
#include "correlate/residual/row_layout.h"
#include "correlate/tolerance.h"

namespace unfurl::correlate {

namespace {

// More than this, and the misfit's correlation with the mesh's error is above 0.7. Motions of any
// other origin that swing ten times or more do not come so close by chance.
constexpr double kHalf = 0.5;
constexpr double kFactor = 4.0;  // of the extrapolated error, to either side of 1

double Either(double a, double b) { return std::min(1.0, 2.0 * std::min(a, b)); }

// Sum of squares of one series (mark and axis) over one section of time.
struct Stretch {
  double squares = 0.0, n = 0.0;
};

// The variance of fewer values is known to worse than half of itself: sqrt(2 / 10) = 0.45.
constexpr double kFewestOfStretch = 10.0;

// One axis of a series over the record, in so many sections of time.
std::vector<Stretch> StretchesOf(const RowSeries& series, const Eigen::VectorXd& residual,
                                 Eigen::Index axis, double start, double span, int sections) {
  std::vector<Stretch> out(static_cast<std::size_t>(sections));
  for (std::size_t i = 0; i < series.size(); ++i) {
    if (!series.Known(residual, i)) continue;
    const double x = residual(series.Row(i, axis));
    const int s =
        std::clamp(static_cast<int>(((*series.t)[i] - start) / span * sections), 0, sections - 1);
    out[static_cast<std::size_t>(s)].squares += x * x;
    out[static_cast<std::size_t>(s)].n += 1.0;
  }
  return out;
}

// By series and axis; sections with fewer than ten values take no part. A series with too few
// values for so many sections has fewer of them: the most that leave more than half of the values
// in sections of ten.
std::vector<std::vector<Stretch>> StretchesOf(const Observations& observations,
                                              const Eigen::VectorXd& residual, int sections) {
  const double start = observations.Start();
  const double span = std::max(1e-12, observations.End() - start);
  std::vector<std::vector<Stretch>> out;
  const RowLayout layout(observations);
  for (const RowSeries& mark : layout.series) {
    for (Eigen::Index axis = 0; axis < mark.axes; ++axis) {
      std::vector<Stretch> series;
      for (int count = sections; count >= std::min(2, sections); --count) {
        series = StretchesOf(mark, residual, axis, start, span, count);
        double all = 0.0, used = 0.0;
        for (const Stretch& s : series) all += s.n, used += s.n < kFewestOfStretch ? 0.0 : s.n;
        if (2.0 * used > all) break;
      }
      std::erase_if(series, [](const Stretch& s) { return s.n < kFewestOfStretch; });
      out.push_back(std::move(series));
    }
  }
  return out;
}

double LeastOfMarks(const Observations& o) {
  double least = std::numeric_limits<double>::infinity();
  for (const MarkSeries& mark : o.marks) {
    const double n = static_cast<double>(mark.p.cols());
    const double motion = (mark.p.colwise() - mark.p.rowwise().mean()).squaredNorm() / n;
    const double noise = (mark.cov.row(0) + mark.cov.row(3) + mark.cov.row(5)).mean();
    if (motion > 0.0) least = std::min(least, std::sqrt(noise / motion));
  }
  return least;
}

}  // namespace

SeriesNoise Believed(SeriesNoise found, const Observations& observations) {
  constexpr double kRoundOff = 1e-6;  // of noise that was set to that tolerance
  if (!observations.has_sigma ||
      LeastNoiseOverMotion(observations) < (1.0 - kRoundOff) * kLoosestTolerance) {
    return found;
  }
  bool below = true, correlated = false;
  for (MarkovNoise& noise : found.series) {
    correlated = correlated || !noise.white();
    if (noise.Peak() > 1.0) {
      below = false;
    } else {
      noise = {};
    }
  }
  found.below = below && correlated;
  return found;
}

double LeastNoiseOverMotion(const Observations& observations) {
  double least = LeastOfMarks(observations);
  for (const auto& kind : observations.others) least = std::min(least, kind->NoiseOverMotion());
  return least;
}

double GoodnessOfFit::p_covariances() const { return Either(p_size, p_white); }
double GoodnessOfFit::p_constant() const { return std::min(1.0, 3.0 * constancy.p_value); }
double GoodnessOfFit::p_noise() const {
  return std::min({1.0, 3.0 * std::min(p_found, p_steady), p_constant()});
}

double SteadyPValue(const Observations& observations, const Eigen::VectorXd& residual,
                    int sections) {
  double statistic = 0.0, freedoms = 0.0;
  for (const std::vector<Stretch>& series : StretchesOf(observations, residual, sections)) {
    double all = 0.0, total = 0.0, used = 0.0;
    for (const Stretch& s : series) all += s.squares, total += s.n, used += 1.0;
    if (used < 2.0 || all <= 0.0) continue;
    // Bartlett's statistic: a likelihood ratio, with his correction for few values.
    const double pooled = all / total;
    double ratio = total * std::log(pooled), inverse = -1.0 / total;
    for (const Stretch& s : series) {
      ratio -= s.n * std::log(std::max(s.squares / s.n, 1e-12 * pooled));
      inverse += 1.0 / s.n;
    }
    statistic += ratio / (1.0 + inverse / (3.0 * (used - 1.0)));
    freedoms += used - 1.0;
  }
  return freedoms > 0.0 ? ChiSquareTail(statistic, freedoms) : 1.0;
}

double LargestStretchPValue(const Observations& observations, const Eigen::VectorXd& residual,
                            int sections) {
  double least = 1.0, count = 0.0;
  for (const std::vector<Stretch>& series : StretchesOf(observations, residual, sections)) {
    for (const Stretch& s : series) {
      least = std::min(least, ChiSquareTail(s.squares, s.n));
      count += 1.0;
    }
  }
  return std::min(1.0, count * least);
}

GoodnessOfFit TestGoodness(const GoodnessInput& in) {
  GoodnessOfFit out;
  out.p_size = ChiSquareTail(in.squares, in.dof);
  out.p_white = in.plain->p_together;
  out.excess = std::sqrt(std::max(in.squares / in.dof - 1.0, 0.0));
  out.p_found = in.whitened->p_together;
  out.p_steady = SteadyPValue(*in.observations, *in.whitened_residual, in.sections);
  if (in.quantised != nullptr && in.quantised->all()) {
    const QuantisedRows::PValues p = in.quantised->Ask(*in.observations, in.whitening, in.sections);
    out.p_white = p.white, out.p_found = p.found, out.p_steady = p.steady;
  }
  const double stretch = in.residual != nullptr
                             ? LargestStretchPValue(*in.observations, *in.residual, in.sections)
                             : 0.0;
  out.p_steady = std::max(out.p_steady, stretch);
  const double beyond = in.left - in.dof;
  const double factor = in.finer > 0.0 ? -in.left_by_finer / in.finer : 0.0;
  if (beyond > 0.0 && factor > 1.0 / kFactor && factor < kFactor) {
    out.mesh_takes = std::min(1.0, -factor * in.left_by_finer / beyond);
  }
  out.within_known = out.p_size >= kGoodnessLevel && in.finer > in.dof;
  out.below = in.below && out.p_size >= kGoodnessLevel && stretch >= kGoodnessLevel;
  const bool small = out.within_known || out.below;
  const bool yes = small || out.p_covariances() >= kGoodnessLevel;
  const bool mesh = !yes && out.mesh_takes > kHalf;
  if (in.constancy != nullptr && !small && !mesh) {
    ConstancyInput asked = *in.constancy;
    // Where it would change nothing it need not be exact.
    if (!yes && out.p_noise() < kGoodnessLevel) asked.calibrated_below = 0.0;
    out.constancy = TestConstancy(asked);
  }
  if (yes && out.p_constant() >= kGoodnessLevel) {
    out.outcome = Explained::kYes;
  } else if (mesh) {
    out.outcome = Explained::kMesh;
  } else {
    out.outcome = out.p_noise() >= kGoodnessLevel ? Explained::kNoise : Explained::kNo;
  }
  return out;
}

}  // namespace unfurl::correlate
