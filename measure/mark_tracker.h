#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "measure/follower.h"

namespace unfurl::measure {

// One line, decided.
struct TrackedLine {
  double t = 0.0;                    // [s]
  std::vector<int> lit;              // marks
  std::vector<TrackedPoint> points;  // one for each
};

// From readings to points with what the lines before and after tell, in constant memory: a line
// that leaves a doubt waits until every mark in it has been seen clearly, eight times, by lines
// that follow, until MotionOptions::longest_gap has passed, or until 1024 lines wait. It
// is then weighed with where both sides lead. Lines come out in the order in which they went in.
class MarkTracker {
 public:
  static constexpr std::size_t kMostHeld = 1024;  // lines

  MarkTracker(const Triangulator& triangulator, std::size_t marks,
              const TrackerOptions& options = {});

  // Where a mark is before its first sample.
  void Expect(std::size_t mark, const Eigen::Vector3d& p, double sigma);

  // The marks `lit` in a line at time `t`, with the candidates of every camera. Times must not
  // fall.
  void Add(double t, std::span<const int> lit, Follower::Cameras cameras);
  // The next line that is decided, until the next call of anything; null when it has to wait for
  // others. After Finish, all come.
  const TrackedLine* Next();
  void Finish() { finished_ = true; }

  // Marks that were named by their places, because nobody said where they start.
  bool named_by_place(std::size_t mark) const {
    return first_look_.named_by_place()[mark] || final_.named_by_place()[mark];
  }

 private:
  struct Held {
    TrackedLine line;  // as far as it is known
    bool clear = false;
    std::vector<std::array<Candidate, Associator::kMostCandidates>> spots;  // by camera
    std::vector<std::span<const Candidate>> cameras;
  };
  Held& At(std::size_t i) { return held_[(first_ + i) % held_.size()]; }
  bool Look(const Held& front);

  const Triangulator& triangulator_;
  TrackerOptions options_;
  Follower first_look_;  // of lines with several marks, as they come
  Follower final_;
  std::vector<bool> together_;         // marks that were ever lit with another
  std::vector<Eigen::Vector3d> last_;  // by mark: where a search begins [m]
  std::vector<Held> held_;             // a ring
  std::size_t first_ = 0, count_ = 0;
  bool finished_ = false;
  std::vector<Motion> after_;
  struct Anchor {
    double t, variance;  // [s], [m^2]
    Eigen::Vector3d p;   // [m]
  };
  std::vector<Anchor> anchors_;
  TrackedLine out_;
};

}  // namespace unfurl::measure
