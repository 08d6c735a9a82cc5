#pragma once

// Marks on known ways, what the shipped rig's cameras read of them, and a score.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

#include "base/random.h"
#include "measure/mark_tracker.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure {

inline constexpr double kSigma = 0.02;  // of a reading [px]

using Line = std::vector<std::vector<Candidate>>;  // by camera

inline Candidate Reading(std::size_t camera, const Eigen::Vector3d& p, Rng& rng) {
  double u = 0.0;
  EXPECT_TRUE(Project(ShippedRig().cameras[camera], p, &u));
  return {u + kSigma * rng.Normal(), kSigma};
}

inline Line Readings(const Eigen::Vector3d& p, Rng& rng) {
  Line line(ShippedRig().cameras.size());
  for (std::size_t c = 0; c < line.size(); ++c) line[c] = {Reading(c, p, rng)};
  return line;
}

// Marks of a deployment, more or less: swings, vibrations of the tip, a kick at 1 s.
inline Eigen::Vector3d Swing(int mark, double t, double phase = 0.0) {
  const double m = mark, reach = 0.15 + 0.25 * m, rate = 2.0 - 0.3 * m;
  const double kick = t > 1.0 ? 0.15 * m * (t - 1.0) * std::exp(-3.0 * (t - 1.0)) : 0.0;
  return {-0.4 + 0.3 * m + reach * std::sin(rate * t + m + phase),
          -0.7 + 0.35 * m + 0.4 * reach * std::cos(rate * t + m + phase) + kick,
          0.05 * m + 0.002 * m * std::sin(40.0 * t)};
}

// A tracker whose lines are judged when they come out.
class Following {
 public:
  using Judge = std::function<void(const std::vector<TrackedPoint>&)>;

  Following(const Triangulator& triangulator, std::size_t marks) : tracker_(triangulator, marks) {}
  MarkTracker& tracker() { return tracker_; }
  void Add(double t, const std::vector<int>& lit, const Line& line, Judge judge) {
    const std::vector<std::span<const Candidate>> spans(line.begin(), line.end());
    tracker_.Add(t, lit, spans);
    waiting_.emplace_back(t, std::move(judge));
    Take();
  }
  void Finish() {
    tracker_.Finish();
    Take();
    EXPECT_TRUE(waiting_.empty());
  }

 private:
  void Take() {
    while (const TrackedLine* line = tracker_.Next()) {
      ASSERT_FALSE(waiting_.empty());
      EXPECT_EQ(line->t, waiting_.front().first);
      waiting_.front().second(line->points);
      waiting_.pop_front();
    }
  }

  MarkTracker tracker_;
  std::deque<std::pair<double, Judge>> waiting_;
};

struct Score {
  std::size_t right = 0, wrong = 0, unsolved = 0;
  double worst = 0.0;
  std::size_t all() const { return right + wrong + unsolved; }
  double Share(std::size_t n) const { return static_cast<double>(n) / static_cast<double>(all()); }
  void Count(const TrackedPoint& found, const Eigen::Vector3d& truth) {
    if (!data::Usable(found.status)) {
      ++unsolved;
      return;
    }
    // Another mark's place, or a ghost, is centimetres away; a point that had to make do with a
    // spot of two marks says so by its covariance.
    const double error = (found.point.p - truth).norm();
    worst = std::max(worst, error);
    ++(error < 1e-3 + 4.0 * std::sqrt(found.point.cov.trace()) ? right : wrong);
  }
  void Add(const Score& other) {
    right += other.right;
    wrong += other.wrong;
    unsolved += other.unsolved;
    worst = std::max(worst, other.worst);
  }
};

}  // namespace unfurl::measure
