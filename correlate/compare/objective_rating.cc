#include "correlate/compare/objective_rating.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

// The standard's constants, by their names there.
constexpr double kA0 = 0.05, kB0 = 0.5;     // half-widths of the corridors over max|T|
constexpr double kMaxShift = 0.2;           // 1 - INIT, of N
constexpr double kBand = 0.1;               // of the shifted length
constexpr double kEpsM = 0.5, kEpsS = 2.0;  // errors at which a score reaches zero
// Weights of corridor, phase, magnitude and slope in the overall rating; they sum to one.
constexpr double kWZ = 0.4, kWP = 0.2, kWM = 0.2, kWS = 0.2;
constexpr std::size_t kFewestOfSlope = 10;  // the slope's average needs nine

// Correlation coefficient; NaN where one does not vary.
double Correlation(std::span<const double> x, std::span<const double> y) {
  const auto n = static_cast<double>(x.size());
  double mx = 0.0, my = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) mx += x[i], my += y[i];
  mx /= n;
  my /= n;
  double xx = 0.0, yy = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mx) * (x[i] - mx);
    yy += (y[i] - my) * (y[i] - my);
    xy += (x[i] - mx) * (y[i] - my);
  }
  return xy / std::sqrt(xx * yy);
}

double Corridor(std::span<const double> test, std::span<const double> computed) {
  double norm = 0.0;
  for (const double v : test) norm = std::max(norm, std::abs(v));
  const double inner = kA0 * norm, outer = kB0 * norm;
  double sum = 0.0;
  for (std::size_t i = 0; i < test.size(); ++i) {
    const double e = std::abs(test[i] - computed[i]);
    if (e <= inner) {
      sum += 1.0;
    } else if (e < outer) {
      sum += (outer - e) * (outer - e) / ((outer - inner) * (outer - inner));
    }
  }
  return sum / static_cast<double>(test.size());
}

// 1 - correlation^2 at shifts of -reach to reach, which a straight line of the other leaves; above
// 1 where they are against each other, 1 where one does not vary.
std::vector<double> LeftAtShifts(std::span<const double> test, std::span<const double> computed,
                                 std::size_t reach) {
  const std::size_t n = test.size();
  std::vector<double> left(2 * reach + 1);
  const auto leaves = [](double c) { return std::isfinite(c) ? 1.0 - c * std::abs(c) : 1.0; };
  for (std::size_t k = 0; k <= reach; ++k) {
    left[reach + k] = leaves(Correlation(test.first(n - k), computed.subspan(k)));
    left[reach - k] = leaves(Correlation(test.subspan(k), computed.first(n - k)));
  }
  return left;
}

// Samples by which `computed` has to be moved ahead for the best correlation. Periodic signals
// correlate alike a period on; the standard takes the smallest such shift, and neither round-off
// nor noise is to choose instead: a peak of the correlation nearer to none is as good as the
// highest where what they leave differs by no more than the highest of as many draws would.
int BestShift(std::span<const double> test, std::span<const double> computed) {
  constexpr double kTie = 1e-12;    // round-off of correlations
  constexpr double kChance = 0.05;  // of taking noise for a better shift
  const auto n = test.size();
  const auto reach = static_cast<std::size_t>(std::floor(kMaxShift * static_cast<double>(n)));
  const std::vector<double> left = LeftAtShifts(test, computed, reach);
  const auto far = static_cast<int>(reach);
  const auto at = [&](int k) { return left[static_cast<std::size_t>(far + k)]; };
  const auto nearer = [&](int k, int than) {  // better, or as good and a smaller shift
    return at(k) < at(than) - kTie || (at(k) <= at(than) + kTie && std::abs(k) < std::abs(than));
  };
  int best = 0;
  for (int k = -far; k <= far; ++k) best = nearer(k, best) ? k : best;
  const double freedom = static_cast<double>(n - reach) - 2.0;
  if (best == 0 || freedom < 1.0) return best;
  const double ratio =
      FisherQuantile(1.0 - kChance / static_cast<double>(left.size()), freedom, freedom);
  const double alike = ratio * at(best) + kTie;
  // From the best one towards none and as far beyond: of each further peak its own best.
  const int step = best > 0 ? -1 : 1;
  std::vector<int> peaks = {best};
  bool apart = false;  // a dip lies between this one and the last
  for (int k = best + step; std::abs(k) <= std::abs(best); k += step) {
    if (at(k) > alike) {
      apart = true;
    } else if (apart) {
      peaks.push_back(k);
      apart = false;
    } else if (peaks.size() > 1 && nearer(k, peaks.back())) {
      peaks.back() = k;
    }
  }
  return *std::min_element(peaks.begin(), peaks.end(),
                           [](int a, int b) { return std::abs(a) < std::abs(b); });
}

double Magnitude(std::span<const double> test, std::span<const double> computed) {
  const int band = static_cast<int>(std::ceil(kBand * static_cast<double>(test.size()))) - 1;
  double apart = 0.0, size = 0.0;
  for (const auto& [i, j] : WarpingPath(computed, test, band)) {
    apart += std::abs(computed[static_cast<std::size_t>(i)] - test[static_cast<std::size_t>(j)]);
    size += std::abs(test[static_cast<std::size_t>(j)]);
  }
  if (apart == 0.0) return 1.0;
  if (apart >= kEpsM * size) return 0.0;
  return (kEpsM - apart / size) / kEpsM;
}

// Central differences (one-sided at the ends), averaged over nine samples, or over as many as lie
// symmetrically about the sample near the ends. Per sample: the step cancels from the score.
std::vector<double> AveragedSlope(std::span<const double> x) {
  const std::size_t n = x.size();
  std::vector<double> d(n), out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t from = i > 0 ? i - 1 : 0, to = std::min(n - 1, i + 1);
    d[i] = (x[to] - x[from]) / static_cast<double>(to - from);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t half = std::min({std::size_t{4}, i, n - 1 - i});
    double sum = 0.0;
    for (std::size_t k = i - half; k <= i + half; ++k) sum += d[k];
    out[i] = sum / static_cast<double>(2 * half + 1);
  }
  return out;
}

double Slope(std::span<const double> test, std::span<const double> computed) {
  const std::vector<double> t = AveragedSlope(test), c = AveragedSlope(computed);
  double apart = 0.0, size = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    apart += std::abs(c[i] - t[i]);
    size += std::abs(t[i]);
  }
  if (apart == 0.0) return 1.0;
  if (apart >= kEpsS * size) return 0.0;
  return (kEpsS - apart / size) / kEpsS;
}

}  // namespace

const char* Name(RatingGrade grade) {
  switch (grade) {
    case RatingGrade::kExcellent:
      return "excellent";
    case RatingGrade::kGood:
      return "good";
    case RatingGrade::kFair:
      return "fair";
    case RatingGrade::kPoor:
      return "poor";
  }
  return "";
}

RatingGrade GradeOf(double overall) {
  if (overall > 0.94) return RatingGrade::kExcellent;
  if (overall > 0.80) return RatingGrade::kGood;
  if (overall > 0.58) return RatingGrade::kFair;
  return RatingGrade::kPoor;
}

std::vector<std::pair<int, int>> WarpingPath(std::span<const double> x, std::span<const double> y,
                                             int band) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  enum From : std::uint8_t { kUp, kLeft, kDiagonal };
  const int n = static_cast<int>(x.size()), width = 2 * band + 1;
  // Cell (i, j) is column j - i + band of row i.
  std::vector<double> above(static_cast<std::size_t>(width) + 1, kNever), row(above);
  std::vector<std::uint8_t> from(static_cast<std::size_t>(n) * static_cast<std::size_t>(width));
  const int m = static_cast<int>(y.size());
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < width; ++k) {
      const int j = i + k - band;
      const auto cell = static_cast<std::size_t>(k);
      row[cell] = kNever;
      if (j < 0 || j >= m) continue;
      const double e = x[static_cast<std::size_t>(i)] - y[static_cast<std::size_t>(j)];
      // Row i - 1 is shifted by one: its column k + 1 is the same j.
      const double up = i > 0 ? above[cell + 1] : kNever;
      const double left = k > 0 ? row[cell - 1] : kNever;
      const double diagonal = i > 0 ? above[cell] : (j == 0 ? 0.0 : kNever);
      double best = up;
      From step = kUp;
      if (left < best) best = left, step = kLeft;
      if (diagonal < best) best = diagonal, step = kDiagonal;
      row[cell] = best + e * e;
      from[static_cast<std::size_t>(i) * static_cast<std::size_t>(width) + cell] = step;
    }
    std::swap(above, row);
  }
  std::vector<std::pair<int, int>> path;
  int i = n - 1, j = m - 1;
  while (i >= 0 && j >= 0) {
    path.emplace_back(i, j);
    const int k = j - i + band;
    if (k < 0 || k >= width) break;  // lengths that the band cannot join
    const auto step =
        static_cast<From>(from[static_cast<std::size_t>(i) * static_cast<std::size_t>(width) +
                               static_cast<std::size_t>(k)]);
    if (step != kLeft) --i;
    if (step != kUp) --j;
  }
  std::reverse(path.begin(), path.end());
  return path;
}

ObjectiveRating RateObjectively(std::span<const double> test, std::span<const double> computed) {
  const std::size_t n = test.size();
  if (n != computed.size() || n < kFewestOfSlope) {
    throw Error(fmt::format("signals of {} and {} samples cannot be rated", n, computed.size()),
                "ISO/TS 18571", "give as many of both, at least 10, on one even grid");
  }
  ObjectiveRating out;
  out.corridor = Corridor(test, computed);
  out.shift = BestShift(test, computed);
  const double most = kMaxShift * static_cast<double>(n);
  out.phase = std::max(0.0, (most - std::abs(out.shift)) / most);
  const auto k = static_cast<std::size_t>(std::abs(out.shift));
  const auto T = out.shift >= 0 ? test.first(n - k) : test.subspan(k);
  const auto C = out.shift >= 0 ? computed.subspan(k) : computed.first(n - k);
  out.magnitude = Magnitude(T, C);
  out.slope = Slope(T, C);
  out.overall = kWZ * out.corridor + kWP * out.phase + kWM * out.magnitude + kWS * out.slope;
  out.grade = GradeOf(out.overall);
  return out;
}

}  // namespace unfurl::correlate
