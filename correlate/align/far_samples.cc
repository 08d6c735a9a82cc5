#include "correlate/align/far_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/length.h"
#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

constexpr std::size_t kBeside = 3;                  // samples to either side
constexpr std::size_t kFewestOfMark = 4 * kBeside;  // of a mark; fewer show no scale

// One series' samples, each against those of its neighbours that are not far.
class Path {
 public:
  // `p`: axes x n; `least`: nothing nearer is far.
  Path(const std::vector<double>& t, Eigen::MatrixXd p, double least = 0.0)
      : t_(t),
        p_(std::move(p)),
        least_(least),
        far_(t.size(), 0),
        distance_(t.size()),
        step_(t.size()) {}

  // Marks what is far, anew: a sample beside a far one is off by that one's error at first.
  std::vector<std::size_t> Find() {
    constexpr int kMostRounds = 5;  // two nearly always do
    std::vector<std::size_t> found;
    for (int round = 0; round < kMostRounds; ++round) {
      for (std::size_t i = 0; i < t_.size(); ++i) Measure(i);
      std::vector<std::size_t> now = BeyondChance();
      const bool same = now == found;
      found = std::move(now);
      std::fill(far_.begin(), far_.end(), 0);
      for (std::size_t i : found) far_[i] = 1;
      if (same) break;
    }
    return found;
  }
  double distance(std::size_t i) const { return distance_[i]; }

 private:
  // The nearest samples before (side -1) or after i that are not far.
  std::size_t Gather(std::size_t i, int side, std::array<std::size_t, kBeside>* out) const {
    std::size_t count = 0;
    for (auto k = static_cast<std::ptrdiff_t>(i) + side;
         k >= 0 && k < std::ssize(far_) && count < kBeside; k += side) {
      if (!far_[static_cast<std::size_t>(k)]) (*out)[count++] = static_cast<std::size_t>(k);
    }
    return count;
  }

  void Measure(std::size_t i) {
    std::array<std::size_t, kBeside> before{}, after{};
    const std::size_t b = Gather(i, -1, &before), a = Gather(i, +1, &after);
    distance_[i] = step_[i] = 0.0;
    if (b == 0 || a == 0) return;  // the ends: extrapolated motion judges nothing
    Eigen::VectorXd place(p_.rows());
    for (Eigen::Index axis = 0; axis < p_.rows(); ++axis) {
      std::vector<double> lines;
      for (std::size_t m = 0; m < b; ++m) {
        for (std::size_t n = 0; n < a; ++n) lines.push_back(Between(before[m], after[n], i, axis));
      }
      place(axis) = Median(lines);
    }
    distance_[i] = (P(i) - place).norm();
    // At a kink of the path (an impact) the sample lies where one side's motion leads.
    for (const auto& [side, count] : {std::pair(&before, b), std::pair(&after, a)}) {
      if (count < 2) continue;
      const std::size_t near = (*side)[0], next = (*side)[1];
      Eigen::VectorXd ahead(p_.rows());
      for (Eigen::Index axis = 0; axis < p_.rows(); ++axis)
        ahead(axis) = Between(next, near, i, axis);
      distance_[i] = std::min(distance_[i], (P(i) - ahead).norm());
    }
    // The neighbours' own steps, and half of the one across the sample.
    std::vector<double> steps = {(P(after[0]) - P(before[0])).norm() / 2.0};
    for (std::size_t m = 0; m + 1 < b; ++m)
      steps.push_back((P(before[m]) - P(before[m + 1])).norm());
    for (std::size_t n = 0; n + 1 < a; ++n) steps.push_back((P(after[n]) - P(after[n + 1])).norm());
    step_[i] = Median(steps);
  }

  double Between(std::size_t j, std::size_t k, std::size_t i, Eigen::Index axis) const {
    const double span = t_[k] - t_[j];
    const double part = span > 0.0 ? (t_[i] - t_[j]) / span : 0.5;
    return P(j)(axis) + part * (P(k)(axis) - P(j)(axis));
  }
  Eigen::MatrixXd::ConstColXpr P(std::size_t i) const {
    return p_.col(static_cast<Eigen::Index>(i));
  }

  std::vector<std::size_t> BeyondChance() const {
    // Of the length of one and of three standard normal numbers.
    const double median = p_.rows() > 1 ? 1.538172 : 0.674490;
    // Two impacts within six samples leave no side that leads to the sample; it then lies off by up
    // to 3/4 of the change of the step, that is by 1.5 steps where it is thrown back at full speed.
    constexpr double kSteps = 2.0;
    const double scale = Median(distance_) / median;
    // Three normal numbers are longer than k with about sqrt(2 / pi) k exp(-k^2 / 2), one less
    // often: one sample of n in a hundred records.
    const double n = static_cast<double>(t_.size());
    double k = 3.0;
    for (int i = 0; i < 6; ++i) k = std::sqrt(2.0 * std::log(100.0 * n * 0.8 * k));
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < t_.size(); ++i) {
      if (distance_[i] > k * scale && distance_[i] > kSteps * step_[i] && distance_[i] > least_) {
        out.push_back(i);
      }
    }
    return out;
  }

  const std::vector<double>& t_;
  Eigen::MatrixXd p_;
  double least_;
  std::vector<char> far_;
  std::vector<double> distance_, step_;  // [m]
};

}  // namespace

std::vector<FarSample> FindFarSamples(const Observations& observations) {
  std::vector<FarSample> out;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    if (observations.marks[m].size() < kFewestOfMark) continue;
    Path path(observations.marks[m].t, observations.marks[m].p);
    for (std::size_t i : path.Find()) out.push_back({m, i, path.distance(i)});
  }
  return out;
}

std::vector<std::size_t> FindFarReadings(const std::vector<double>& t, const Eigen::VectorXd& y) {
  if (static_cast<std::size_t>(y.size()) < kFewestOfMark) return {};
  // A slow motion goes on by a step of the instrument's resolution at a time.
  double step = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 1; i < y.size(); ++i) {
    if (y(i) != y(i - 1)) step = std::min(step, std::abs(y(i) - y(i - 1)));
  }
  return Path(t, y.transpose(), 2.0 * step).Find();
}

std::vector<std::vector<std::size_t>> FindFarReadings(const Observations& observations) {
  std::vector<std::vector<std::size_t>> out;
  for (const auto& kind : observations.others) {
    const Eigen::VectorXd y = kind->Readings();
    out.push_back(y.size() == 0 ? std::vector<std::size_t>()
                                : FindFarReadings(*kind->series().front().t, y));
  }
  return out;
}

Observations Aside(Observations observations, const std::vector<std::vector<std::size_t>>& far) {
  for (std::size_t k = 0; k < far.size(); ++k) {
    if (!far[k].empty()) observations.others[k] = observations.others[k]->Without(far[k]);
  }
  return observations;
}

std::string Words(const Observations& observations, const std::vector<FarSample>& far) {
  const FarSample& first = far.front();
  const MarkSeries& mark = observations.marks[first.mark];
  const std::string where = fmt::format("'{}' at {:.6g} s, by {}", mark.name, mark.t[first.index],
                                        LengthText(first.distance));
  if (far.size() == 1) {
    return "one sample that lies further from its neighbours in time than the mark moves between "
           "them, of " +
           where;
  }
  return fmt::format(
      "{} samples that lie further from their neighbours in time than the mark moves between them, "
      "the first of {}",
      far.size(), where);
}

Observations Widened(Observations observations, const std::vector<FarSample>& far) {
  for (const FarSample& f : far) {
    auto cov = observations.marks[f.mark].cov.col(static_cast<Eigen::Index>(f.index));
    const double variance = (cov(0) + cov(3) + cov(5)) / 3.0;
    cov *= std::max(1.0, f.distance * f.distance / variance);
  }
  return observations;
}

Observations Without(const Observations& observations, const std::vector<FarSample>& far) {
  Observations out = observations;
  const int k = observations.shared_rank;
  for (std::size_t m = 0; m < out.marks.size(); ++m) {
    const MarkSeries& from = observations.marks[m];
    std::vector<char> drop(from.size(), 0);
    for (const FarSample& f : far) {
      if (f.mark == m) drop[f.index] = 1;
    }
    MarkSeries& to = out.marks[m];
    to.t.clear();
    Eigen::Index kept = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (drop[i]) continue;
      const auto at = static_cast<Eigen::Index>(i);
      to.t.push_back(from.t[i]);
      to.p.col(kept) = from.p.col(at);
      to.cov.col(kept) = from.cov.col(at);
      if (k > 0) to.shared.middleCols(kept * k, k) = from.shared.middleCols(at * k, k);
      ++kept;
    }
    to.p.conservativeResize(3, kept);
    to.cov.conservativeResize(6, kept);
    if (k > 0) to.shared.conservativeResize(3, kept * k);
  }
  return out;
}

}  // namespace unfurl::correlate
