#include "study/cost_limit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::study {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();
// An extrapolated error is of the next power at least.
constexpr double kNextPower = 1.0;

// Three sizes, rising.
struct CostSizes {
  double s1, s2, s3;
  double At(double size, double power) const { return std::pow(size / s3, -power); }
  // (q1 - q2) / (q2 - q3) where errors fall with this power.
  double Ratio(double power) const {
    return (At(s1, power) - At(s2, power)) / (At(s2, power) - 1.0);
  }
  // Error of q3 over q2 - q3.
  double Left(double power) const { return 1.0 / (At(s2, power) - 1.0); }
  // The power with which they do fall, at most `most`; 0: they do not.
  double Power(double ratio, double most) const {
    constexpr double kLeast = 1e-3;  // slower than that is not falling
    if (!(ratio > Ratio(kLeast))) return 0.0;
    if (ratio >= Ratio(most)) return most;
    double low = kLeast, high = most;
    constexpr int kHalvings = 60;  // to rounding
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      (Ratio(middle) < ratio ? low : high) = middle;
    }
    return low;
  }
};

double Over(double a, double b) { return b > 0.0 ? a / b : a > 0.0 ? kNoLimit : 1.0; }

// Error of the finest mesh from the differences of three; `turns`: the second goes back on the
// first.
double RawError(const CostSizes& sizes, double power, double d12, double d23, bool turns) {
  if (!std::isfinite(d12) || !std::isfinite(d23)) return kNoLimit;
  if (d12 == 0.0 && d23 == 0.0) return 0.0;
  const double seen = sizes.Power(Over(d12, d23), power);
  // What goes to and fro has its limit between; what goes on without slowing down may have none.
  if (seen == 0.0) return turns ? std::max(d12, d23) : kNoLimit;
  // A last difference that is small by chance is not believed: the first one says what to expect.
  const double error =
      std::max(sizes.Left(seen) * d23, sizes.Left(power) * d12 / sizes.Ratio(power));
  return turns ? std::clamp(error, d23, std::max(d12, d23)) : error;
}

// Whether the way from q2 to q3 goes back on that from q1 to q2.
bool Turns(const CostValues& q1, const CostValues& q2, const CostValues& q3) {
  double sum = 0.0;
  const auto add = [&](const std::vector<double>& a, const std::vector<double>& b,
                       const std::vector<double>& c) {
    const std::size_t n = std::min({a.size(), b.size(), c.size()});
    for (std::size_t i = 0; i < n; ++i) sum += (b[i] - a[i]) * (c[i] - b[i]);
  };
  add(q1.a, q2.a, q3.a);
  add(q1.b, q2.b, q3.b);
  return sum < 0.0;
}

// Error of the extrapolated values: what the power seen makes of it, and what the next power leaves
// of the change from the extrapolation before.
double ExtrapolatedError(const CostSizes& sizes, double power, double d12, double d23,
                         double change) {
  if (!std::isfinite(d12) || !std::isfinite(d23)) return kNoLimit;
  if (d12 == 0.0 && d23 == 0.0) return 0.0;
  constexpr double kMost = 12.0;  // power: as good as none left
  const double seen = sizes.Power(Over(d12, d23), kMost);
  if (seen == 0.0) return kNoLimit;
  const double off = std::fabs(sizes.Left(seen) - sizes.Left(power)) * d23;
  return std::max(off, sizes.Left(power + kNextPower) * change);
}

std::vector<double> Beyond(const std::vector<double>& coarse, const std::vector<double>& fine,
                           double left) {
  std::vector<double> out(std::min(coarse.size(), fine.size()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = fine[i] + left * (fine[i] - coarse[i]);
  return out;
}

CostValues Beyond(const CostValues& coarse, const CostValues& fine, double left) {
  return {Beyond(coarse.a, fine.a, left), Beyond(coarse.b, fine.b, left)};
}

}  // namespace

CostLimit LimitOf(const std::vector<CostValues>& values, const std::vector<double>& sizes,
                  double power, bool regular) {
  CostLimit out;
  out.error = {kNoLimit, kNoLimit};
  const std::size_t n = values.size();
  if (n == 0) return out;
  out.values = values[n - 1];
  if (n == 1) return out;
  const CostDistance d23 = DistanceOf(values[n - 2], values[n - 1]);
  if (n == 2) {
    out.error = d23;
    return out;
  }
  const CostSizes s{sizes[n - 3], sizes[n - 2], sizes[n - 1]};
  const CostDistance d12 = DistanceOf(values[n - 3], values[n - 2]);
  const bool turns = Turns(values[n - 3], values[n - 2], values[n - 1]);
  out.error = {RawError(s, power, d12.rms, d23.rms, turns),
               RawError(s, power, d12.largest, d23.largest, turns)};
  out.settles = std::isfinite(out.error.rms);
  if (!regular || turns || values[n - 3].a.empty() || values[n - 2].a.empty()) return out;
  const double left = s.Left(power);
  const double before = 1.0 / (s.At(s.s1, power) / s.At(s.s2, power) - 1.0);
  const CostValues now = Beyond(values[n - 2], values[n - 1], left);
  const CostDistance change = DistanceOf(Beyond(values[n - 3], values[n - 2], before), now);
  const CostDistance error = {
      ExtrapolatedError(s, power, d12.rms, d23.rms, change.rms),
      ExtrapolatedError(s, power, d12.largest, d23.largest, change.largest)};
  if (!(error.rms < out.error.rms)) return out;
  out.values = now;
  out.error = error;
  out.spread = 1.0 + 2.0 * left;
  out.extrapolated = true;
  return out;
}

CostLimit Joined(const CostLimit& a, const CostLimit& b) {
  const bool first = a.error.rms <= b.error.rms;
  CostLimit out = first ? a : b;
  const CostLimit& other = first ? b : a;
  const CostDistance apart = DistanceOf(a.values, b.values);
  if (!std::isfinite(other.error.rms)) {
    if (out.settles || other.values.a.empty()) return out;
    out.error.rms = std::max(out.error.rms, apart.rms);
    out.error.largest = std::max(out.error.largest, apart.largest);
    return out;
  }
  out.error.rms = std::max(out.error.rms, apart.rms - other.error.rms);
  out.error.largest = std::max(out.error.largest, apart.largest - other.error.largest);
  return out;
}

}  // namespace unfurl::study
