#include "measure/course_differences.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/statistics.h"

namespace unfurl::measure {

namespace {

constexpr double kLeastSize = 1e-12;  // of differences that are all the same [-]

Eigen::VectorXd WeightsOf(const CourseKind& kind) {
  Eigen::VectorXd w = Eigen::VectorXd::Zero((kind.points - 1) * kind.stride + 1);
  double binomial = 1.0;
  for (int k = 0; k < kind.points; ++k) {
    w(k * kind.stride) = k % 2 == 0 ? binomial : -binomial;
    binomial *= static_cast<double>(kind.points - 1 - k) / (k + 1);
  }
  return w.normalized();
}

double CorrelationsOf(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  double sum = 0.0;
  for (Eigen::Index shift = 1 - b.size(); shift < a.size(); ++shift) {
    const Eigen::Index from = std::max<Eigen::Index>(0, shift);
    const Eigen::Index n = std::min(a.size(), b.size() + shift) - from;
    const double one = a.segment(from, n).dot(b.segment(from - shift, n));
    sum += one * one;
  }
  return sum;
}

// Times that differ by less from even ones count as even [step].
constexpr double kEven = 1e-9;
using DifferenceWeights = std::array<double, kCoursePoints.back()>;

// Of a divided difference at times t.
DifferenceWeights WeightsAt(std::span<const double> t) {
  DifferenceWeights out{};
  for (std::size_t k = 0; k < t.size(); ++k) {
    double product = 1.0;
    for (std::size_t j = 0; j < t.size(); ++j) {
      if (j != k) product *= t[k] - t[j];
    }
    out[k] = 1.0 / product;
  }
  return out;
}

// Most readings come evenly in time.
const DifferenceWeights& EvenWeights(std::size_t points) {
  static const std::array<DifferenceWeights, kCoursePoints.back() + 1> all = [] {
    std::array<DifferenceWeights, kCoursePoints.back() + 1> out{};
    DifferenceWeights t{};
    for (std::size_t n = 1; n < out.size(); ++n) {
      t[n - 1] = static_cast<double>(n - 1);
      out[n] = WeightsAt(std::span(t).first(n));
    }
    return out;
  }();
  return all[points];
}

// Of readings[at[k]], what no polynomial of degree points - 2 explains, by divided differences,
// over what is stated of it.
Difference DifferenceOf(std::span<const CourseReading> readings, std::span<const std::size_t> at,
                        int stride) {
  DifferenceWeights t{};
  const std::size_t n = at.size();
  const CourseReading &first = readings[at.front()], &last = readings[at.back()];
  const double step = (last.t - first.t) / static_cast<double>(n - 1);
  double uneven = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    t[k] = (readings[at[k]].t - first.t) / step;
    uneven = std::max(uneven, std::abs(t[k] - static_cast<double>(k)));
  }
  DifferenceWeights own;
  const bool even = uneven <= kEven;
  if (!even) own = WeightsAt(std::span(t).first(n));
  const DifferenceWeights& weights = even ? EvenWeights(n) : own;
  double sum = 0.0, variance = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const CourseReading& one = readings[at[k]];
    const double sigma = one.s_px * weights[k];
    sum += one.u_px * weights[k];
    variance += sigma * sigma;
  }
  return {sum / std::sqrt(variance), first.flash, at[n / 2],
          last.flash - first.flash == (n - 1) * static_cast<std::size_t>(stride)};
}

// Of what is usual among them; infinity where there are none.
double UsualSize(std::span<const Difference> all) {
  std::vector<double> sizes;
  sizes.reserve(all.size());
  for (const Difference& one : all) sizes.push_back(std::abs(one.d));
  if (sizes.empty()) return std::numeric_limits<double>::infinity();
  return std::max(Median(sizes) / std::sqrt(ChiSquareQuantile(0.5, 1.0)), kLeastSize);
}

// Takes out the readings that are the largest of their neighbourhood, beyond five sigmas of what is
// usual, of differences that have them in the middle; false: there were none.
bool LeaveOutLargest(const CourseKind& kind, std::vector<CourseReading>* readings) {
  const std::vector<Difference> all = DifferencesOf(*readings, kind);
  const double limit = kWrongSigmas * UsualSize(all);
  std::vector<double> size(readings->size(), 0.0);
  for (const Difference& one : all) size[one.middle] = std::abs(one.d);
  const auto reach = static_cast<std::size_t>(kind.points / 2 * kind.stride);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < size.size(); ++i) {
    const std::size_t low = i - std::min(i, reach), high = std::min(size.size(), i + reach + 1);
    const auto at = [&](std::size_t k) { return size.begin() + static_cast<std::ptrdiff_t>(k); };
    if (size[i] > limit && size[i] >= *std::max_element(at(low), at(high))) continue;
    (*readings)[kept++] = (*readings)[i];
  }
  const bool any = kept < readings->size();
  readings->resize(kept);
  return any;
}

}  // namespace

const CourseKinds& AllCourseKinds() {
  static const CourseKinds kinds = [] {
    CourseKinds out;
    std::size_t at = 0;
    for (const int points : kCoursePoints) {
      for (const int stride : kCourseStrides) out.of[at++] = {points, stride};
    }
    for (std::size_t a = 0; a < kCourseKinds; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const auto i = static_cast<Eigen::Index>(a), j = static_cast<Eigen::Index>(b);
        out.R(i, j) = out.R(j, i) = CorrelationsOf(WeightsOf(out.of[a]), WeightsOf(out.of[b]));
      }
    }
    return out;
  }();
  return kinds;
}

std::vector<Difference> DifferencesOf(std::span<const CourseReading> readings,
                                      const CourseKind& kind) {
  const auto stride = static_cast<std::size_t>(kind.stride);
  const auto points = static_cast<std::size_t>(kind.points);
  std::vector<Difference> out;
  std::vector<std::vector<std::size_t>> at(stride);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    std::vector<std::size_t>& row = at[readings[i].flash % stride];
    if (!row.empty() && readings[row.back()].row != readings[i].row) row.clear();
    row.push_back(i);
    if (row.size() < points) continue;
    out.push_back(DifferenceOf(readings, std::span(row).last(points), kind.stride));
  }
  const auto before = [](const Difference& a, const Difference& b) { return a.first < b.first; };
  if (!std::is_sorted(out.begin(), out.end(), before)) std::sort(out.begin(), out.end(), before);
  return out;
}

void LeaveOutWrong(std::vector<CourseReading>* readings) {
  constexpr int kRounds = 20;         // each takes out one wrong reading of every neighbourhood
  constexpr double kNearLeast = 2.0;  // of what is usual, over the least of any kind [-]
  std::vector<std::pair<double, CourseKind>> kinds;
  for (const int points : {5, 9, 13}) {
    for (const int stride : kCourseStrides) {
      const CourseKind kind{points, stride};
      kinds.emplace_back(UsualSize(DifferencesOf(*readings, kind)), kind);
    }
  }
  std::stable_sort(kinds.begin(), kinds.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [usual, kind] : kinds) {
    if (!(usual <= kNearLeast * kinds.front().first)) break;
    for (int round = 0; round < kRounds && LeaveOutLargest(kind, readings); ++round) {
    }
  }
}

}  // namespace unfurl::measure
