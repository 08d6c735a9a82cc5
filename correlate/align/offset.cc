#include "correlate/align/offset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/count.h"
#include "base/statistics.h"
#include "correlate/spectra/fft.h"

namespace unfurl::correlate {

namespace {

// A signal on an even grid; 0 where it is not known.
struct Gridded {
  std::vector<double> value;
  std::vector<double> mask;  // 1: known
};

Prediction OnGrid(const SampledModel& record, const std::vector<std::string>& marks, double low,
                  std::size_t count, double step) {
  std::vector<double> grid(count);
  for (std::size_t i = 0; i < count; ++i) grid[i] = low + static_cast<double>(i) * step;
  Stamps stamps;
  stamps.marks = marks;
  stamps.t.assign(marks.size(), grid);
  return record.Evaluate({}, stamps);
}

bool Known(const MarkMotion& m, std::size_t i) { return m.known.empty() || m.known[i] != 0; }

std::vector<Gridded> Distances(const Prediction& p) {
  std::vector<Gridded> out;
  for (std::size_t a = 0; a < p.marks.size(); ++a) {
    for (std::size_t b = a + 1; b < p.marks.size(); ++b) {
      const auto n = static_cast<std::size_t>(p.marks[a].p.cols());
      Gridded g{std::vector<double>(n, 0.0), std::vector<double>(n, 0.0)};
      for (std::size_t i = 0; i < n; ++i) {
        if (!Known(p.marks[a], i) || !Known(p.marks[b], i)) continue;
        const auto c = static_cast<Eigen::Index>(i);
        g.value[i] = (p.marks[a].p.col(c) - p.marks[b].p.col(c)).norm();
        g.mask[i] = 1.0;
      }
      out.push_back(std::move(g));
    }
  }
  return out;
}

std::vector<Gridded> Speeds(const Prediction& p, double step) {
  constexpr std::size_t kSpan = 2;  // grid steps to either side: halves the noise of differences
  std::vector<Gridded> out;
  for (const MarkMotion& m : p.marks) {
    const auto n = static_cast<std::size_t>(m.p.cols());
    Gridded g{std::vector<double>(n, 0.0), std::vector<double>(n, 0.0)};
    for (std::size_t i = kSpan; i + kSpan < n; ++i) {
      if (!Known(m, i - kSpan) || !Known(m, i + kSpan)) continue;
      const auto c = static_cast<Eigen::Index>(i), s = static_cast<Eigen::Index>(kSpan);
      g.value[i] = (m.p.col(c + s) - m.p.col(c - s)).norm() / (2.0 * kSpan * step);
      g.mask[i] = 1.0;
    }
    out.push_back(std::move(g));
  }
  return out;
}

double SpreadOf(const Gridded& g) {
  std::vector<double> v;
  for (std::size_t i = 0; i < g.value.size(); ++i) {
    if (g.mask[i] > 0.0) v.push_back(g.value[i]);
  }
  return v.size() < 2 ? 0.0 : std::sqrt(Variance(v));
}

// A typical sigma of one coordinate [m]; 0 for records without one.
double MiddleSigma(const Observations& o) {
  if (!o.has_sigma) return 0.0;
  std::vector<double> s;
  for (const MarkSeries& m : o.marks) {
    for (Eigen::Index i = 0; i < m.cov.cols(); ++i) {
      s.push_back(std::sqrt((m.cov(0, i) + m.cov(3, i) + m.cov(5, i)) / 3.0));
    }
  }
  return s.empty() ? 0.0 : Median(s);
}

void Accumulate(std::vector<double>* sum, const std::vector<double>& term) {
  if (sum->empty()) sum->assign(term.size(), 0.0);
  for (std::size_t i = 0; i < term.size(); ++i) (*sum)[i] += term[i];
}

// The two records on one even grid of time.
struct Grid {
  double step = 0.0;                    // [s]; 0: there is none
  double start_a = 0.0, start_b = 0.0;  // of the first point, each on its own clock [s]
  std::size_t count_a = 0, count_b = 0;
};

Grid GridOf(const Observations& A, const Observations& B) {
  constexpr double kMaxGrid = 100000.0;  // points; beyond, a coarser grid locates the peak as well
  Grid grid;
  const double length_a = A.End() - A.Start();
  grid.start_a = A.Start();
  grid.start_b = B.held_before ? B.Start() - length_a : B.Start();
  double step = length_a;
  for (const Observations* o : {&A, &B}) {
    for (const MarkSeries& m : o->marks) {
      const double s = MedianStep(m.t);
      if (s > 0.0) step = std::min(step, s);
    }
  }
  const double length_b = B.End() - grid.start_b;
  step = std::max(step, std::max(length_a, length_b) / kMaxGrid);
  if (!(step > 0.0)) return grid;
  grid.step = step;
  grid.count_a = static_cast<std::size_t>(length_a / step) + 1;
  grid.count_b = static_cast<std::size_t>(length_b / step) + 1;
  return grid;
}

// Signals that no rigid frame changes, of both records in the same order.
struct SignalPairs {
  std::vector<Gridded> a, b;
  std::string name;             // in words
  std::size_t independent = 1;  // histories that may differ freely
};

// Distances between marks, those that vary by more than `noise` [m] of their ends; where none does,
// the speeds of the marks.
SignalPairs ChooseSignals(const Prediction& a, const Prediction& b, double noise, double step) {
  constexpr double kNoise = 10.0;      // sigmas between the ends of thousands of normal draws
  constexpr double kPart = 0.01;       // of the distance that varies most
  constexpr double kRoundOff = 1e-12;  // of the distance itself
  SignalPairs out;
  std::vector<Gridded> da = Distances(a), db = Distances(b);
  double widest = 0.0, longest = 0.0;
  for (std::size_t j = 0; j < da.size(); ++j) {
    widest = std::max(widest, std::min(SpreadOf(da[j]), SpreadOf(db[j])));
    for (double v : da[j].value) longest = std::max(longest, v);
  }
  const double least = std::max({kNoise * noise, kPart * widest, kRoundOff * longest});
  for (std::size_t j = 0; j < da.size(); ++j) {
    if (SpreadOf(da[j]) <= least || SpreadOf(db[j]) <= least) continue;
    out.a.push_back(std::move(da[j]));
    out.b.push_back(std::move(db[j]));
  }
  out.independent = std::max<std::size_t>(1, out.a.size());
  out.name = Counted(out.a.size(), "distance") + " between marks";
  if (out.a.empty()) {
    out.a = Speeds(a, step);
    out.b = Speeds(b, step);
    out.name = "speeds of " + Counted(out.a.size(), "mark");
  }
  return out;
}

// Takes the mean of what is known out, so that differences of sums stay well conditioned. The count
// of what is known.
double Centre(Gridded* g) {
  double sum = 0.0, n = 0.0;
  for (std::size_t i = 0; i < g->value.size(); ++i) sum += g->value[i], n += g->mask[i];
  for (std::size_t i = 0; i < g->value.size(); ++i) {
    if (g->mask[i] > 0.0 && n > 0.0) g->value[i] -= sum / n;
  }
  return n;
}

std::vector<double> Squared(std::vector<double> x) {
  for (double& v : x) v *= v;
  return x;
}

// Sums over all signals, by lag: l stands for sample i of a beside sample i + l - (count_a - 1) of
// b.
struct LagSums {
  std::vector<double> numerator, variance_a, variance_b, overlap;
  double known_a = 0.0, known_b = 0.0;  // samples that are known, of all signals

  void Add(Gridded& x, Gridded& y) {
    known_a += Centre(&x);
    known_b += Centre(&y);
    const std::vector<double> n = CrossCorrelation(x.mask, y.mask);
    const std::vector<double> sx = CrossCorrelation(x.value, y.mask);
    const std::vector<double> sy = CrossCorrelation(x.mask, y.value);
    const std::vector<double> sxy = CrossCorrelation(x.value, y.value);
    std::vector<double> sxx = CrossCorrelation(Squared(x.value), y.mask);
    std::vector<double> syy = CrossCorrelation(x.mask, Squared(y.value));
    std::vector<double> top(n.size());
    for (std::size_t l = 0; l < n.size(); ++l) {
      const double count = std::max(n[l], 1.0);
      top[l] = sxy[l] - sx[l] * sy[l] / count;
      sxx[l] -= sx[l] * sx[l] / count;
      syy[l] -= sy[l] * sy[l] / count;
    }
    Accumulate(&numerator, top);
    Accumulate(&variance_a, sxx);
    Accumulate(&variance_b, syy);
    Accumulate(&overlap, n);
  }
};

constexpr double kNoCorrelation = -2.0;  // of a lag that takes no part; less than any correlation

// Local maxima of the correlation over the lags, each refined by a parabola through three lags.
std::vector<OffsetCandidate> Peaks(const std::vector<double>& rho,
                                   const std::function<double(double lag)>& offset_at,
                                   const std::vector<double>& share) {
  std::vector<OffsetCandidate> out;
  for (std::size_t l = 0; l < rho.size(); ++l) {
    if (rho[l] <= kNoCorrelation) continue;
    const double before = l > 0 ? rho[l - 1] : kNoCorrelation;
    const double after = l + 1 < rho.size() ? rho[l + 1] : kNoCorrelation;
    if (rho[l] < before || rho[l] <= after) continue;
    double shift = 0.0;
    if (before > kNoCorrelation && after > kNoCorrelation) {
      const double bend = before - 2.0 * rho[l] + after;
      if (bend < 0.0) shift = 0.5 * (before - after) / bend;
    }
    out.push_back({offset_at(static_cast<double>(l) + shift), rho[l], share[l]});
  }
  std::stable_sort(out.begin(), out.end(), [](const OffsetCandidate& x, const OffsetCandidate& y) {
    return x.correlation > y.correlation;
  });
  return out;
}

}  // namespace

bool OffsetOptions::IsKnown(double offset) const {
  return std::any_of(known.begin(), known.end(),
                     [&](double at) { return std::abs(offset - at) <= near; });
}

OffsetSearch FindOffset(const SampledModel& a, const SampledModel& b,
                        const std::vector<std::string>& marks, const OffsetOptions& options) {
  OffsetSearch out;
  const Observations& A = a.samples();
  const Observations& B = b.samples();
  constexpr std::size_t kFewest = 4;  // samples: fewer have no history
  if (A.size() < kFewest || B.size() < kFewest) return out;

  // 1. Both on one even grid; signals that no frame changes.
  const Grid grid = GridOf(A, B);
  if (grid.step <= 0.0) return out;
  out.step = grid.step;
  const double noise = std::max(MiddleSigma(A), MiddleSigma(B));
  SignalPairs signals =
      ChooseSignals(OnGrid(a, marks, grid.start_a, grid.count_a, grid.step),
                    OnGrid(b, marks, grid.start_b, grid.count_b, grid.step), noise, grid.step);
  out.signal = signals.name;
  out.independent = signals.independent;

  // 2. Masked normalised cross-correlation [Padfield 2012]: numerators and variances are summed
  // over the signals, so that those which move most weigh most.
  LagSums sums;
  for (std::size_t j = 0; j < signals.a.size(); ++j) sums.Add(signals.a[j], signals.b[j]);
  if (sums.numerator.empty()) return out;
  const double total_a = *std::max_element(sums.variance_a.begin(), sums.variance_a.end());
  const double total_b = *std::max_element(sums.variance_b.begin(), sums.variance_b.end());
  // The time before a run's start, in which it is held, is there to be overlapped but is not part
  // of what has to be.
  const double own_b =
      sums.known_b * std::min(1.0, (B.End() - B.Start()) / (B.End() - grid.start_b));
  const double shorter = std::max(1.0, std::min(sums.known_a, own_b));
  const std::function<double(double)> offset_at = [&](double lag) {
    return grid.start_a - grid.start_b - (lag - static_cast<double>(grid.count_a - 1)) * grid.step;
  };
  std::vector<double> rho(sums.numerator.size(), kNoCorrelation), share(rho.size());
  for (std::size_t l = 0; l < rho.size(); ++l) {
    // A part in which nothing moves correlates with anything: it is not evidence.
    constexpr double kMoves = 1e-3;  // of the largest variance over any overlap
    const double offset = offset_at(static_cast<double>(l));
    share[l] = sums.overlap[l] / shorter;
    const bool moves =
        sums.variance_a[l] >= kMoves * total_a && sums.variance_b[l] >= kMoves * total_b;
    if (share[l] < options.min_overlap || !moves || offset < options.low || offset > options.high) {
      continue;
    }
    rho[l] = sums.numerator[l] / std::sqrt(sums.variance_a[l] * sums.variance_b[l]);
  }

  // 3. Its peaks, best first.
  out.candidates = Peaks(rho, offset_at, share);
  if (out.candidates.size() > static_cast<std::size_t>(options.candidates)) {
    out.candidates.resize(static_cast<std::size_t>(options.candidates));
  }
  return out;
}

}  // namespace unfurl::correlate
