#include "correlate/fit/between_samples.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// The polynomial through eight points a step apart, half-way between the middle ones. Of a
// sinusoid with four samples to a period it misses a fiftieth, with 2.6 a third, with two all.
constexpr std::array<double, 8> kWeights = {-5.0 / 2048,   49.0 / 2048,   -245.0 / 2048,
                                            1225.0 / 2048, 1225.0 / 2048, -245.0 / 2048,
                                            49.0 / 2048,   -5.0 / 2048};
constexpr std::size_t kPoints = kWeights.size();
// Of the points from the sample, in steps.
double PlaceAmong(std::size_t k) { return static_cast<double>(k) - 3.5; }

// Of one sample, summed over axes.
struct Sample {
  bool known = false;
  double missed = 0.0;  // square of what the eight do not foretell [sigma^2]
  double varies = 0.0;  // square of how far the nine lie from a straight line, mean [sigma^2]
};

// Of one axis: `at` is the value at the sample, `about` those of the eight. Values may be off by a
// constant.
void Add(double at, const std::array<double, kPoints>& about, Sample* s) {
  double missed = at, mean = at, slope = 0.0, spread = 0.0;
  for (std::size_t k = 0; k < kPoints; ++k) {
    missed -= kWeights[k] * about[k];
    mean += about[k];
    slope += PlaceAmong(k) * about[k];
    spread += PlaceAmong(k) * PlaceAmong(k);
  }
  mean /= kPoints + 1.0;
  slope /= spread;
  double varies = (at - mean) * (at - mean);
  for (std::size_t k = 0; k < kPoints; ++k) {
    const double off = about[k] - mean - slope * PlaceAmong(k);
    varies += off * off;
  }
  s->known = true;
  s->missed += missed * missed;
  s->varies += varies / (kPoints + 1.0);
}

// The place of t in ascending stamps, which hold it; the last stamp for what lies beyond.
Eigen::Index Find(const std::vector<double>& stamps, double t) {
  const auto at = std::lower_bound(stamps.begin(), stamps.end(), t);
  return static_cast<Eigen::Index>(std::min<std::ptrdiff_t>(
      at - stamps.begin(), static_cast<std::ptrdiff_t>(stamps.size()) - 1));
}

// `t` and `own` are the mark's stamps and motion, `finer` and `between` those of StampsBetween.
std::vector<Sample> OfMark(const MarkSeries& mark, const std::vector<double>& t,
                           const MarkMotion& own, const std::vector<double>& finer,
                           const MarkMotion& between) {
  std::vector<Sample> out(t.size());
  const double step = MedianStep(t);
  for (std::size_t i = 0; i < t.size(); ++i) {
    const auto c = static_cast<Eigen::Index>(i);
    if (t[i] + PlaceAmong(kPoints - 1) * step > finer.back()) continue;
    if (!own.known.empty() && own.known[i] == 0) continue;
    std::array<Eigen::Index, kPoints> where{};
    bool known = true;
    for (std::size_t k = 0; k < kPoints; ++k) {
      where[k] = Find(finer, t[i] + PlaceAmong(k) * step);
      known = known &&
              (between.known.empty() || between.known[static_cast<std::size_t>(where[k])] != 0);
    }
    if (!known) continue;
    const double sigma =
        std::sqrt((mark.cov(0, c) + mark.cov(3, c) + mark.cov(5, c)) / 3.0);  // of one axis
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      std::array<double, kPoints> about{};
      for (std::size_t k = 0; k < kPoints; ++k) about[k] = between.p(axis, where[k]) / sigma;
      Add(own.p(axis, c) / sigma, about, &out[i]);
    }
  }
  return out;
}

// A kind's residuals by a clock that is ahead of `clocks` by `shift` [s].
Eigen::VectorXd Shifted(const ResidualKind& kind, const Eigen::VectorXd& numbers,
                        ResidualKind::Clocks clocks, const Eigen::VectorXd& own, double shift) {
  clocks.at.offset -= shift;
  ResidualKind::Rows rows;
  rows.residual = rows.by_time = Eigen::VectorXd::Zero(kind.rows());
  rows.by_unknown = Eigen::MatrixXd::Zero(kind.rows(), static_cast<Eigen::Index>(own.size()));
  kind.Evaluate(numbers, clocks, own, &rows);
  return rows.residual;
}

// Of a series of a kind; its readings, which the model is taken from, are the constant of Add.
std::vector<Sample> OfKind(const ResidualKind& kind, const RowSeries& series,
                           const Eigen::VectorXd& numbers, const ResidualKind::Clocks& clocks,
                           const Eigen::VectorXd& own) {
  std::vector<Sample> out(series.size());
  const double step = MedianStep(*series.t);
  const Eigen::VectorXd here = Shifted(kind, numbers, clocks, own, 0.0);
  std::array<Eigen::VectorXd, kPoints> there;
  for (std::size_t k = 0; k < kPoints; ++k) {
    there[k] = Shifted(kind, numbers, clocks, own, PlaceAmong(k) * step);
  }
  for (std::size_t i = 0; i < series.size(); ++i) {
    bool known = series.Known(here, i);
    for (const Eigen::VectorXd& r : there) known = known && series.Known(r, i);
    for (Eigen::Index axis = 0; known && axis < series.axes; ++axis) {
      const Eigen::Index row = series.Row(i, axis);
      std::array<double, kPoints> about{};
      for (std::size_t k = 0; k < kPoints; ++k) about[k] = -there[k](row);
      Add(-here(row), about, &out[i]);
    }
  }
  return out;
}

// Mean square of a sample's residuals, summed over axes.
double MeanSquare(const RowSeries& series, const Eigen::VectorXd& residual) {
  double squares = 0.0, n = 0.0;
  for (std::size_t i = 0; i < series.size(); ++i) {
    if (!series.Known(residual, i)) continue;
    squares += residual.segment(series.Row(i), series.axes).squaredNorm();
    n += 1.0;
  }
  return squares / std::max(1.0, n);
}

// Which of the samples lie where much is missed, of the motion and beside the residuals.
std::vector<std::uint8_t> HiddenOf(const std::vector<Sample>& samples, double residual) {
  constexpr std::size_t kNear = 4;          // samples to either side: as far as the eight reach
  constexpr double kOfTheMotion = 0.1;      // squared: 2.6 samples to a period
  constexpr double kOfTheResiduals = 0.25;  // squared: of a wrong minimum's they are all but noise
  std::vector<std::uint8_t> out(samples.size(), 0);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    double missed = 0.0, varies = 0.0, n = 0.0;
    for (std::size_t j = i - std::min(i, kNear); j < std::min(samples.size(), i + kNear + 1); ++j) {
      if (!samples[j].known) continue;
      missed += samples[j].missed;
      varies += samples[j].varies;
      n += 1.0;
    }
    out[i] =
        missed > 0.0 && missed >= kOfTheMotion * varies && missed >= kOfTheResiduals * n * residual;
  }
  return out;
}

}  // namespace

Stamps StampsBetween(const Stamps& stamps) {
  Stamps out;
  out.marks = stamps.marks;
  const double last = stamps.Last();
  for (const std::vector<double>& t : stamps.t) {
    const double step = MedianStep(t);
    std::vector<double> finer;
    for (const double at : t) {
      for (std::size_t k = 0; k < kPoints; ++k) {
        if (at + PlaceAmong(k) * step <= last) finer.push_back(at + PlaceAmong(k) * step);
      }
    }
    std::sort(finer.begin(), finer.end());
    finer.erase(std::unique(finer.begin(), finer.end()), finer.end());
    out.t.push_back(std::move(finer));
  }
  return out;
}

BetweenSamples LookBetween(const Observations& o, const Prediction& prediction,
                           const Prediction& between, const Clock& reference,
                           const Registration& at, const Eigen::VectorXd& residual) {
  const RowLayout layout(o);
  const Stamps stamps = o.StampsAt(reference), finer = StampsBetween(stamps);
  std::vector<std::vector<Sample>> samples;
  for (std::size_t m = 0; m < o.marks.size(); ++m) {
    samples.push_back(
        OfMark(o.marks[m], stamps.t[m], prediction.marks[m], finer.t[m], between.marks[m]));
  }
  const ResidualKind::Clocks clocks = ClocksOf(o, reference, at.clock());
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    for (const RowSeries& series : o.others[k]->series()) {
      samples.push_back(OfKind(*o.others[k], series, o.others[k]->NumbersOf(prediction), clocks,
                               layout.OwnOf(k, at.own)));
    }
  }
  BetweenSamples out;
  double missed = 0.0;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const double square = MeanSquare(layout.series[s], residual);
    out.hidden.push_back(HiddenOf(samples[s], square));
    for (std::size_t i = 0; i < samples[s].size(); ++i) {
      if (out.hidden[s][i] == 0) continue;
      ++out.samples;
      missed += samples[s][i].missed / std::max(square, 1e-300);
    }
  }
  out.times = std::sqrt(missed / std::max<double>(1.0, static_cast<double>(out.samples)));
  return out;
}

}  // namespace unfurl::correlate
