#include "correlate/align/unit_doubt.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl::correlate {

namespace {

// Of all samples of the marks that both have.
double Spread(const Observations& o, const Observations& other) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0.0, n = 0.0;
  for (const MarkSeries& m : o.marks) {
    if (other.FindMark(m.name) < 0) continue;
    sum += m.p.rowwise().sum();
    squares += m.p.squaredNorm();
    n += static_cast<double>(m.size());
  }
  return n > 0.0 ? std::sqrt(std::max(squares / n - (sum / n).squaredNorm(), 0.0)) : 0.0;
}

// Over a hundredth of the record, so that noise is no speed.
double HighestSpeed(const Observations& o, const Observations& other) {
  constexpr double kParts = 100.0;  // of the record; over less, noise would be a speed
  double highest = 0.0;
  for (const MarkSeries& m : o.marks) {
    if (other.FindMark(m.name) < 0 || m.size() < 2) continue;
    const double step = (m.t.back() - m.t.front()) / kParts;
    for (std::size_t from = 0, to = 1; to < m.size(); ++to) {
      if (m.t[to] - m.t[from] < step) continue;
      const auto a = static_cast<Eigen::Index>(from), b = static_cast<Eigen::Index>(to);
      highest = std::max(highest, (m.p.col(b) - m.p.col(a)).norm() / (m.t[to] - m.t[from]));
      from = to;
    }
  }
  return highest;
}

// The power of a thousand that a ratio is within a factor of ten of; 0: of one, or of none.
int Thousands(double ratio) {
  if (!(ratio > 0.0) || !std::isfinite(ratio)) return 0;
  const double decades = std::log10(ratio);
  const int thousands = static_cast<int>(std::lround(decades / 3.0));
  return std::abs(decades - 3.0 * thousands) < 1.0 ? thousands : 0;
}

std::string Words(const char* what, int thousands, const char* const names[2]) {
  const double factor = std::pow(1000.0, std::abs(thousands));
  const char* unit = std::abs(thousands) <= 2 ? names[std::abs(thousands) - 1] : "another unit";
  return thousands > 0 ? fmt::format("its {} are about {:g} times the reference's: are they in {}?",
                                     what, factor, unit)
                       : fmt::format("its {} are about 1/{:g} of the reference's: is that in {}?",
                                     what, factor, unit);
}

}  // namespace

UnitRatios CompareUnits(const Observations& record, const Observations& reference) {
  UnitRatios out;
  const double a = Spread(record, reference), b = Spread(reference, record);
  if (!(a > 0.0) || !(b > 0.0)) return out;
  out.length = a / b;
  const double va = HighestSpeed(record, reference), vb = HighestSpeed(reference, record);
  if (va > 0.0 && vb > 0.0) out.time = (a / va) / (b / vb);
  const double lasts = record.End() - record.Start(), of = reference.End() - reference.Start();
  if (lasts > 0.0 && of > 0.0) out.duration = lasts / of;
  return out;
}

std::string UnitDoubt(const UnitRatios& ratios) {
  constexpr const char* kLengths[2] = {"millimetres", "micrometres"};
  constexpr const char* kTimes[2] = {"milliseconds", "microseconds"};
  constexpr double kAlike = 10.0;  // durations: what a factor of a thousand is told from
  const int lengths = Thousands(ratios.length);
  int times = Thousands(ratios.time);
  if (ratios.duration > 1.0 / kAlike && ratios.duration < kAlike) times = 0;
  std::string words;
  if (times != 0) words = Words("times", times, kTimes);
  if (lengths != 0) words += (words.empty() ? "" : "; ") + Words("lengths", lengths, kLengths);
  return words;
}

}  // namespace unfurl::correlate
