#include "correlate/fit/gross_samples.h"

#include <algorithm>
#include <cmath>

#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

constexpr double kLikelier = 0.5;  // probability of being gross beyond which a sample is

// A sample against its neighbours.
struct Deviation {
  GrossSample sample;
  double square = 0.0;       // of three coordinates [-]
  std::size_t place = 0;     // among the mark's known samples
  double probability = 0.0;  // of being gross
};

// The samples of one mark that are known, and how each lies to its neighbours.
class Neighbours {
 public:
  // The mark's rows begin at `first`.
  Neighbours(const Observations& o, const Eigen::VectorXd& residual, std::size_t m,
             Eigen::Index first)
      : residual_(residual), first_(first) {
    const MarkSeries& mark = o.marks[m];
    for (std::size_t i = 0; i < mark.size(); ++i) {
      if (residual.segment<3>(Row(i)).squaredNorm() == 0.0) continue;
      Deviation d;
      d.sample.mark = m, d.sample.index = i, d.sample.t = mark.t[i];
      d.place = samples.size();
      samples.push_back(d);
    }
  }

  // Each against the median of the nearest three to either side that are not gross so far.
  void Measure() {
    std::vector<double> beside;
    for (Deviation& d : samples) {
      d.square = 0.0;
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        beside.clear();
        Gather(d.place, -1, axis, &beside);
        Gather(d.place, 1, axis, &beside);
        if (beside.empty()) continue;
        const double off = residual_(Row(d.sample.index) + axis) - Median(beside);
        d.square += off * off;
      }
      d.sample.sigmas = std::sqrt(d.square / 3.0);
    }
  }

  std::vector<Deviation> samples;

 private:
  Eigen::Index Row(std::size_t i) const { return first_ + 3 * static_cast<Eigen::Index>(i); }
  void Gather(std::size_t place, int side, Eigen::Index axis, std::vector<double>* out) const {
    constexpr int kBeside = 3;  // two gross ones in six do not reach the median
    int found = 0;
    for (auto k = static_cast<std::ptrdiff_t>(place) + side;
         k >= 0 && k < std::ssize(samples) && found < kBeside; k += side) {
      const Deviation& d = samples[static_cast<std::size_t>(k)];
      if (d.probability > kLikelier) continue;
      out->push_back(residual_(Row(d.sample.index) + axis));
      ++found;
    }
  }

  const Eigen::VectorXd& residual_;
  Eigen::Index first_;
};

// Densities of three coordinates of variance v each, without the factor (2 pi)^(-3/2).
double LogDensity(double square, double v) { return -1.5 * std::log(v) - 0.5 * square / v; }

// Two normal densities of mean zero, by expectation and maximisation [Dempster, Laird and Rubin
// 1977]; fills in the probabilities.
struct Mixture {
  double share = 0.02;                // of the wider one
  double narrow = 1.0, wide = 100.0;  // variances of a coordinate [-]
  double gain = 0.0;                  // twice the rise of the log-likelihood over one density

  explicit Mixture(const std::vector<Deviation*>& all) {
    constexpr int kRounds = 200;           // ends before, where shares stand still
    constexpr double kMedian3 = 2.365974;  // of chi-square with three degrees of freedom
    std::vector<double> squares;
    double sum = 0.0;
    for (const Deviation* d : all) squares.push_back(d->square), sum += d->square;
    const double n = static_cast<double>(squares.size());
    const double one = sum / (3.0 * n);
    narrow = std::max(Median(squares) / kMedian3, 1e-12);
    wide = std::max(wide * narrow, one);
    double likelihood = 0.0;
    for (int round = 0; round < kRounds; ++round) {
      likelihood = 0.0;
      double weight = 0.0, wide_sum = 0.0;
      for (Deviation* d : all) {
        const double a = std::log(share) + LogDensity(d->square, wide);
        const double b = std::log1p(-share) + LogDensity(d->square, narrow);
        const double top = std::max(a, b);
        const double both = top + std::log(std::exp(a - top) + std::exp(b - top));
        d->probability = std::exp(a - both);
        likelihood += both;
        weight += d->probability;
        wide_sum += d->probability * d->square;
      }
      const double before = share;
      share = std::clamp(weight / n, 1e-12, 0.5);
      if (weight > 0.0) wide = wide_sum / (3.0 * weight);
      narrow = std::max((sum - wide_sum) / (3.0 * std::max(n - weight, 1.0)), 1e-12);
      if (std::abs(share - before) < 1e-9) break;
    }
    double single = 0.0;
    for (const Deviation* d : all) single += LogDensity(d->square, std::max(one, 1e-12));
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

}  // namespace

GrossErrors FindGrossErrors(const Observations& observations, const Eigen::VectorXd& residual) {
  constexpr double kApart = 9.0;       // ratio of variances
  constexpr std::size_t kFewest = 20;  // samples; fewer show no two densities
  constexpr int kMostRounds = 5;  // gross neighbours bend a median; two rounds nearly always do
  GrossErrors out;
  std::vector<Neighbours> marks;
  std::vector<double> known_of_mark;
  Eigen::Index first = 0;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    marks.emplace_back(observations, residual, m, first);
    known_of_mark.push_back(static_cast<double>(marks.back().samples.size()));
    first += 3 * static_cast<Eigen::Index>(observations.marks[m].size());
  }
  std::vector<Deviation*> all;
  for (Neighbours& mark : marks) {
    for (Deviation& d : mark.samples) all.push_back(&d);
  }
  if (all.size() < kFewest) return out;
  const double penalty = 2.0 * std::log(static_cast<double>(all.size()));  // share and width
  std::vector<Deviation> gross;
  double wide = 1.0, narrow = 1.0;
  for (int round = 0; round < kMostRounds; ++round) {
    for (Neighbours& mark : marks) mark.Measure();
    const Mixture mixture(all);
    if (mixture.gain <= penalty || mixture.wide < kApart * mixture.narrow) return out;
    wide = mixture.wide, narrow = mixture.narrow;
    std::vector<Deviation> now;
    for (const Deviation* d : all) {
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
  const bool too_many =
      static_cast<double>(gross.size()) > kMostGross * static_cast<double>(all.size());
  if (too_many || InBursts(gross, known_of_mark)) {
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

void PutAside(const GrossErrors& gross, Observations* observations) {
  for (const auto* group : {&gross.samples, &gross.suspects}) {
    for (const GrossSample& s : *group) {
      // No less than the sample itself: one far beyond the others must not count as one of them.
      const double width = std::max(gross.widening, s.sigmas);
      observations->marks[s.mark].cov.col(static_cast<Eigen::Index>(s.index)) *= width * width;
    }
  }
}

}  // namespace unfurl::correlate
