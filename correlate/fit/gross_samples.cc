#include "correlate/fit/gross_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"
#include "correlate/fit/at_once.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

constexpr double kLikelier = 0.5;  // probability of being gross beyond which a sample is

// A sample against its neighbours.
struct Deviation {
  GrossSample sample;
  double square = 0.0;       // of its coordinates [-]
  double excused = 0.0;      // so far off it may be for what the model does there [sigmas]
  std::size_t place = 0;     // among the series' known samples
  double probability = 0.0;  // of being gross
};

// The samples of one series that are known, and how each lies to its neighbours.
class Neighbours {
 public:
  // `mark`: what the samples are named by.
  Neighbours(const RowSeries& series, const Eigen::VectorXd& residual, std::size_t mark)
      : series_(series), residual_(residual) {
    for (std::size_t i = 0; i < series.size(); ++i) {
      if (!series.Known(residual, i)) continue;
      Deviation d;
      d.sample.mark = mark, d.sample.index = i, d.sample.t = (*series.t)[i];
      d.place = samples.size();
      samples.push_back(d);
    }
  }

  // Each against the median of the nearest three to either side that are not gross so far.
  void Measure() {
    std::vector<double> beside;
    for (Deviation& d : samples) {
      d.square = 0.0;
      for (Eigen::Index axis = 0; axis < series_.axes; ++axis) {
        beside.clear();
        Gather(d.place, -1, axis, &beside);
        Gather(d.place, 1, axis, &beside);
        if (beside.empty()) continue;
        const double off = residual_(series_.Row(d.sample.index, axis)) - Median(beside);
        d.square += off * off;
      }
      d.sample.sigmas = std::sqrt(d.square / static_cast<double>(series_.axes));
    }
  }

  double axes() const { return static_cast<double>(series_.axes); }

  std::vector<Deviation> samples;

 private:
  void Gather(std::size_t place, int side, Eigen::Index axis, std::vector<double>* out) const {
    constexpr int kBeside = 3;  // two gross ones in six do not reach the median
    int found = 0;
    for (auto k = static_cast<std::ptrdiff_t>(place) + side;
         k >= 0 && k < std::ssize(samples) && found < kBeside; k += side) {
      const Deviation& d = samples[static_cast<std::size_t>(k)];
      if (d.probability > kLikelier) continue;
      out->push_back(residual_(series_.Row(d.sample.index, axis)));
      ++found;
    }
  }

  RowSeries series_;
  const Eigen::VectorXd& residual_;
};

// Two normal densities of mean zero, by expectation and maximisation [Dempster, Laird and Rubin
// 1977]; fills in the probabilities.
struct Mixture {
  double share = 0.02;                // of the wider one
  double narrow = 1.0, wide = 100.0;  // variances of a coordinate [-]
  double gain = 0.0;                  // twice the rise of the log-likelihood over one density

  // `axes`: coordinates of a sample. `least`: no variance is less than this.
  Mixture(const std::vector<Deviation*>& all, double axes, double least) {
    constexpr int kRounds = 200;  // ends before, where shares stand still
    // Of chi-square with one and with three degrees of freedom.
    const double median = axes > 1.0 ? 2.365974 : 0.454936;
    // Without the factor (2 pi)^(-axes / 2).
    auto log_density = [&](double square, double v) {
      return -0.5 * axes * std::log(v) - 0.5 * square / v;
    };
    std::vector<double> squares;
    double sum = 0.0;
    for (const Deviation* d : all) squares.push_back(d->square), sum += d->square;
    const double n = static_cast<double>(squares.size());
    const double one = sum / (axes * n);
    narrow = std::max(Median(squares) / median, least);
    wide = std::max(wide * narrow, one);
    double likelihood = 0.0;
    for (int round = 0; round < kRounds; ++round) {
      likelihood = 0.0;
      double weight = 0.0, wide_sum = 0.0;
      for (Deviation* d : all) {
        const double a = std::log(share) + log_density(d->square, wide);
        const double b = std::log1p(-share) + log_density(d->square, narrow);
        const double top = std::max(a, b);
        const double both = top + std::log(std::exp(a - top) + std::exp(b - top));
        d->probability = std::exp(a - both);
        likelihood += both;
        weight += d->probability;
        wide_sum += d->probability * d->square;
      }
      const double before = share;
      share = std::clamp(weight / n, 1e-12, 0.5);
      if (weight > 0.0) wide = std::max(wide_sum / (axes * weight), least);
      narrow = std::max((sum - wide_sum) / (axes * std::max(n - weight, 1.0)), least);
      if (std::abs(share - before) < 1e-9) break;
    }
    double single = 0.0;
    for (const Deviation* d : all) single += log_density(d->square, std::max(one, least));
    gain = 2.0 * (likelihood - single);
  }
};

// Whether what sticks out comes together: more lie within three samples of one another than chance
// has it. One trial in a thousand with gross errors by chance is taken for one with bursts.
bool InBursts(const std::vector<Deviation>& gross, const std::vector<double>& known_of_mark) {
  constexpr double kUnlikely = 0.001;  // of a trial without bursts
  constexpr std::size_t kWithin = 3;   // samples, those that a median looks at
  std::vector<double> count(known_of_mark.size(), 0.0);
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < gross.size(); ++i) {
    count[gross[i].sample.mark] += 1.0;
    for (std::size_t j = i; j > 0; --j) {
      const Deviation& before = gross[j - 1];
      if (before.sample.mark != gross[i].sample.mark || gross[i].place - before.place > kWithin) {
        break;
      }
      ++pairs;
    }
  }
  double expected = 0.0;
  for (std::size_t m = 0; m < count.size(); ++m) {
    if (known_of_mark[m] > 0.0) expected += kWithin * count[m] * count[m] / known_of_mark[m];
  }
  // Poisson: P(X >= pairs).
  double term = std::exp(-expected), below = 0.0;
  for (std::size_t k = 0; k < pairs; ++k) {
    below += term;
    term *= expected / static_cast<double>(k + 1);
  }
  return 1.0 - below < kUnlikely;
}

// Samples that may be gross, and what is too small for one.
struct GrossCandidates {
  std::vector<Deviation*> all;
  double least_size = 0.0;        // from the neighbours, in sigmas [-]
  double least_variance = 1e-12;  // of what is no gross error [-]
};

// Of series that share one noise.
GrossErrors FindIn(std::vector<Neighbours>* series, const GrossCandidates& among) {
  constexpr double kApart = 9.0;       // ratio of variances
  constexpr std::size_t kFewest = 20;  // samples; fewer show no two densities
  constexpr int kMostRounds = 5;  // gross neighbours bend a median; two rounds nearly always do
  GrossErrors out;
  if (among.all.size() < kFewest) return out;
  const double n = static_cast<double>(among.all.size());
  const double penalty = 2.0 * std::log(n);  // share and width
  std::vector<Deviation> gross;
  double wide = 1.0, narrow = 1.0;
  for (int round = 0; round < kMostRounds; ++round) {
    for (Neighbours& one : *series) one.Measure();
    const Mixture mixture(among.all, series->front().axes(), among.least_variance);
    if (mixture.gain <= penalty || mixture.wide < kApart * mixture.narrow) return out;
    wide = mixture.wide, narrow = mixture.narrow;
    std::vector<Deviation> now;
    for (Deviation* d : among.all) {
      if (d->sample.sigmas < std::max(among.least_size, d->excused)) d->probability = 0.0;
      if (d->probability > kLikelier) now.push_back(*d);
    }
    const bool same = std::equal(now.begin(), now.end(), gross.begin(), gross.end(),
                                 [](const Deviation& a, const Deviation& b) {
                                   return a.sample.mark == b.sample.mark && a.place == b.place;
                                 });
    gross = std::move(now);
    if (same) break;
  }
  // Were more than a fifth gross, three of six neighbours would be in a tenth of all cases, and
  // their median would vouch for nothing: what sticks out so often is the model.
  constexpr double kMostGross = 0.2;
  std::vector<double> known;
  for (const Neighbours& one : *series) known.push_back(static_cast<double>(one.samples.size()));
  if (static_cast<double>(gross.size()) > kMostGross * n || InBursts(gross, known)) {
    out.in_bursts = gross.size();
    out.widening = std::sqrt(wide);
    for (const Deviation& d : gross) out.suspects.push_back(d.sample);
    return out;
  }
  for (const Deviation& d : gross) out.samples.push_back(d.sample);
  out.widening = std::sqrt(wide);
  out.clean = std::sqrt(narrow);
  return out;
}

// The instrument's resolution, whether it is known or the readings, whenever they were taken, lie
// whole steps apart; 0: neither [in sigmas].
double StepOf(const RowSeries& series, const Eigen::VectorXd& readings) {
  constexpr double kRoundOff = 1e-9;    // of the range: equal, but for their digits
  constexpr double kWhole = 0.1;        // of a step, that digits may take from a whole one
  constexpr double kFar = 5.0;          // steps; over more the digits add up
  constexpr std::size_t kEvidence = 3;  // gaps beside the least, that are whole by chance
  std::vector<double> sorted(readings.begin(), readings.end()), gaps;
  std::sort(sorted.begin(), sorted.end());
  const double same = kRoundOff * (sorted.back() - sorted.front());
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i] - sorted[i - 1] > same) gaps.push_back(sorted[i] - sorted[i - 1]);
  }
  if (gaps.empty()) return series.step;
  const double least = *std::min_element(gaps.begin(), gaps.end());
  std::erase_if(gaps, [&](double gap) { return gap > kFar * least; });
  const bool whole = std::all_of(gaps.begin(), gaps.end(), [&](double gap) {
    return std::abs(gap / least - std::round(gap / least)) < kWhole;
  });
  return whole && gaps.size() > kEvidence ? std::max(series.step, least) : series.step;
}

}  // namespace

GrossErrors FindGrossErrors(const Observations& observations, const Eigen::VectorXd& residual) {
  const RowLayout layout(observations);
  std::vector<Neighbours> marks;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    marks.emplace_back(layout.series[m], residual, m);
  }
  GrossCandidates among;
  for (Neighbours& mark : marks) {
    for (Deviation& d : mark.samples) among.all.push_back(&d);
  }
  return FindIn(&marks, among);
}

std::vector<ChannelGross> FindChannelGross(const Observations& observations,
                                           const Eigen::VectorXd& residual) {
  const RowLayout layout(observations);
  std::vector<ChannelGross> out;
  for (std::size_t k = 0; k < observations.others.size(); ++k) {
    const ResidualKind& kind = *observations.others[k];
    const Eigen::VectorXd readings = kind.Readings();
    if (readings.size() == 0) continue;
    const Eigen::VectorXd own = residual.segment(layout.others[k], readings.size());
    const RowSeries series = kind.series().front();
    std::vector<Neighbours> one;
    one.emplace_back(series, own, 0);
    std::vector<Deviation>& samples = one.front().samples;
    if (samples.empty()) continue;
    one.front().Measure();
    const double step = StepOf(series, readings);
    GrossCandidates among;
    // Of readings and of their neighbours' median, each within half a step of the motion.
    among.least_size = 2.0 * step;
    among.least_variance = std::max(1e-12, 2.0 * step * step / 12.0);
    constexpr double kOfMedian = 0.6745;  // median of a normal deviate's size
    std::vector<double> sizes;
    sizes.reserve(samples.size());
    for (const Deviation& d : samples) sizes.push_back(d.sample.sigmas);
    const double noise = Median(sizes) / kOfMedian;
    std::vector<Eigen::Index> known;
    known.reserve(samples.size());
    for (const Deviation& d : samples) known.push_back(static_cast<Eigen::Index>(d.sample.index));
    const std::vector<double> at_once = ExcusedAtOnce((readings - own)(known), own(known), noise);
    // What is excused says nothing of the noise, unless it lies as near as the others do: a short
    // record may have no place without something at once.
    constexpr double kNear = 3.0;  // standard deviations
    const double near = kNear * noise;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      samples[i].excused = at_once[i];
      const double off = samples[i].sample.sigmas;
      if (off > at_once[i] || at_once[i] == 0.0 || off <= near) among.all.push_back(&samples[i]);
    }
    GrossErrors errors = FindIn(&one, among);
    if (errors.samples.empty() && errors.suspects.empty()) continue;
    out.push_back({k, series.name, samples.size(), std::move(errors)});
  }
  return out;
}

void PutAside(const GrossErrors& gross, Observations* observations) {
  for (const auto* group : {&gross.samples, &gross.suspects}) {
    for (const GrossSample& s : *group) {
      // No less than the sample itself: one far beyond the others must not count as one of them.
      const double width = std::max(gross.widening, s.sigmas);
      observations->marks[s.mark].cov.col(static_cast<Eigen::Index>(s.index)) *= width * width;
    }
  }
}

void PutAside(const std::vector<ChannelGross>& gross, Observations* observations) {
  for (auto& kind : observations->others) {
    if (const auto all = kind->Without({})) kind = all;
  }
  for (const ChannelGross& one : gross) {
    std::vector<std::size_t> samples;
    for (const auto* group : {&one.errors.samples, &one.errors.suspects}) {
      for (const GrossSample& s : *group) samples.push_back(s.index);
    }
    auto& kind = observations->others[one.kind];
    if (auto rest = kind->Without(samples)) kind = std::move(rest);
  }
}

}  // namespace unfurl::correlate
