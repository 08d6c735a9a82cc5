#include "correlate/align/offset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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
double TypicalSigma(const Observations& o) {
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

}  // namespace

OffsetSearch FindOffset(const SampledModel& a, const SampledModel& b,
                        const std::vector<std::string>& marks, const OffsetOptions& options) {
  constexpr double kMaxGrid = 100000.0;  // points; beyond, a coarser grid locates the peak as well
  OffsetSearch out;
  const Observations& A = a.samples();
  const Observations& B = b.samples();
  if (A.size() < 4 || B.size() < 4) return out;
  const double start_a = A.Start(), end_a = A.End();
  double start_b = B.Start();
  const double end_b = B.End();
  if (B.held_before) start_b -= end_a - start_a;

  double step = end_a - start_a;
  for (const Observations* o : {&A, &B}) {
    for (const MarkSeries& m : o->marks) {
      const double s = MedianStep(m.t);
      if (s > 0.0) step = std::min(step, s);
    }
  }
  const double span = std::max(end_a - start_a, end_b - start_b);
  step = std::max(step, span / kMaxGrid);
  if (!(step > 0.0)) return out;
  out.step = step;
  const auto count_a = static_cast<std::size_t>((end_a - start_a) / step) + 1;
  const auto count_b = static_cast<std::size_t>((end_b - start_b) / step) + 1;
  const Prediction grid_a = OnGrid(a, marks, start_a, count_a, step);
  const Prediction grid_b = OnGrid(b, marks, start_b, count_b, step);

  // A distance that varies by no more than the noise of its ends says nothing of time.
  const double noise = std::max(TypicalSigma(A), TypicalSigma(B));
  std::vector<Gridded> signal_a, signal_b;
  {
    std::vector<Gridded> da = Distances(grid_a), db = Distances(grid_b);
    double widest = 0.0;
    for (std::size_t j = 0; j < da.size(); ++j) {
      widest = std::max(widest, std::min(SpreadOf(da[j]), SpreadOf(db[j])));
    }
    const double least = std::max({10.0 * noise, 0.01 * widest, 1e-9});
    for (std::size_t j = 0; j < da.size(); ++j) {
      if (SpreadOf(da[j]) > least && SpreadOf(db[j]) > least) {
        signal_a.push_back(std::move(da[j]));
        signal_b.push_back(std::move(db[j]));
      }
    }
  }
  out.signal = fmt::format("{} distances between marks", signal_a.size());
  out.independent = std::max<std::size_t>(1, signal_a.size());
  if (signal_a.empty()) {
    signal_a = Speeds(grid_a, step);
    signal_b = Speeds(grid_b, step);
    out.signal = fmt::format("speeds of {} marks", signal_a.size());
  }

  // Masked normalised cross-correlation [Padfield 2012], numerators and variances summed over the
  // signals, so that those which move most weigh most.
  std::vector<double> numerator, variance_a, variance_b, overlap;
  double shorter_a = 0.0, shorter_b = 0.0;
  for (std::size_t j = 0; j < signal_a.size(); ++j) {
    Gridded& x = signal_a[j];
    Gridded& y = signal_b[j];
    for (Gridded* g : {&x, &y}) {  // about its mean: keeps the sums' differences well conditioned
      double sum = 0.0, n = 0.0;
      for (std::size_t i = 0; i < g->value.size(); ++i) sum += g->value[i], n += g->mask[i];
      for (std::size_t i = 0; i < g->value.size(); ++i) {
        if (g->mask[i] > 0.0 && n > 0.0) g->value[i] -= sum / n;
      }
      (g == &x ? shorter_a : shorter_b) += n;
    }
    std::vector<double> xx(x.value), yy(y.value);
    for (double& v : xx) v *= v;
    for (double& v : yy) v *= v;
    const std::vector<double> n = CrossCorrelation(x.mask, y.mask);
    const std::vector<double> sx = CrossCorrelation(x.value, y.mask);
    const std::vector<double> sy = CrossCorrelation(x.mask, y.value);
    const std::vector<double> sxy = CrossCorrelation(x.value, y.value);
    std::vector<double> sxx = CrossCorrelation(xx, y.mask);
    std::vector<double> syy = CrossCorrelation(x.mask, yy);
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
  if (numerator.empty()) return out;
  const double total_a = *std::max_element(variance_a.begin(), variance_a.end());
  const double total_b = *std::max_element(variance_b.begin(), variance_b.end());
  // The time before a run's start, in which it is held, is there to be overlapped but not to be
  // asked for.
  const double own_b = shorter_b * std::min(1.0, (end_b - B.Start()) / (end_b - start_b));
  const double shorter = std::max(1.0, std::min(shorter_a, own_b));

  // Entry l: sample i of a beside sample i + l - (count_a - 1) of b.
  auto offset_at = [&](double l) {
    return start_a - start_b - (l - static_cast<double>(count_a - 1)) * step;
  };
  std::vector<double> rho(numerator.size(), -2.0);
  for (std::size_t l = 0; l < rho.size(); ++l) {
    // A part in which nothing moves correlates with anything: it is not evidence.
    constexpr double kMoves = 1e-3;
    const double offset = offset_at(static_cast<double>(l));
    if (overlap[l] < options.min_overlap * shorter || offset < options.low ||
        offset > options.high || variance_a[l] < kMoves * total_a ||
        variance_b[l] < kMoves * total_b) {
      continue;
    }
    rho[l] = numerator[l] / std::sqrt(variance_a[l] * variance_b[l]);
  }
  for (std::size_t l = 0; l < rho.size(); ++l) {
    if (rho[l] <= -2.0) continue;
    const double before = l > 0 ? rho[l - 1] : -2.0;
    const double after = l + 1 < rho.size() ? rho[l + 1] : -2.0;
    if (rho[l] < before || rho[l] <= after) continue;
    double shift = 0.0;
    if (before > -2.0 && after > -2.0) {
      const double bend = before - 2.0 * rho[l] + after;
      if (bend < 0.0) shift = 0.5 * (before - after) / bend;
    }
    out.candidates.push_back(
        {offset_at(static_cast<double>(l) + shift), rho[l], overlap[l] / shorter});
  }
  std::stable_sort(out.candidates.begin(), out.candidates.end(),
                   [](const OffsetCandidate& x, const OffsetCandidate& y) {
                     return x.correlation > y.correlation;
                   });
  if (out.candidates.size() > static_cast<std::size_t>(options.candidates)) {
    out.candidates.resize(static_cast<std::size_t>(options.candidates));
  }
  return out;
}

}  // namespace unfurl::correlate
