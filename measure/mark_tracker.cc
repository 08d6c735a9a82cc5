#include "measure/mark_tracker.h"

#include <algorithm>
#include <cassert>

namespace unfurl::measure {

namespace {

constexpr std::size_t kAhead = 8;  // clear samples of a mark that tell where it comes from

// No doubt about this one: a reading to spare, and all of them agree.
bool Vouched(const TrackedPoint& point) {
  return point.status == data::SampleStatus::kGood && point.own > 3;
}

}  // namespace

MarkTracker::MarkTracker(const Triangulator& triangulator, std::size_t marks,
                         const TrackerOptions& options)
    : triangulator_(triangulator),
      options_(options),
      first_look_(triangulator, marks, options),
      final_(triangulator, marks, options),
      together_(marks, false),
      last_(marks, triangulator.centre()),
      held_(8) {}

void MarkTracker::Expect(std::size_t mark, const Eigen::Vector3d& p, double sigma) {
  first_look_.Expect(mark, p, sigma);
  final_.Expect(mark, p, sigma);
  last_[mark] = p;
}

void MarkTracker::Add(double t, std::span<const int> lit, Follower::Cameras cameras) {
  assert(cameras.size() == triangulator_.cameras());
  if (count_ == held_.size()) {
    std::rotate(held_.begin(), held_.begin() + static_cast<std::ptrdiff_t>(first_), held_.end());
    first_ = 0;
    held_.resize(2 * held_.size());
  }
  Held& here = At(count_++);
  here.line.t = t;
  here.line.lit.assign(lit.begin(), lit.end());
  here.line.points.resize(lit.size());
  here.spots.resize(cameras.size());
  here.cameras.resize(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const std::size_t n = std::min(cameras[c].size(), Associator::kMostCandidates);
    std::copy_n(cameras[c].begin(), n, here.spots[c].begin());
    here.cameras[c] = {here.spots[c].data(), n};
  }
  if (lit.size() == 1) {
    const auto mark = static_cast<std::size_t>(lit[0]);
    TrackedPoint& point = here.line.points[0];
    here.clear = first_look_.Alone(here.cameras, last_[mark], &point);
    const bool solved = here.clear && point.point.outcome == PointOutcome::kSolved;
    if (solved) last_[mark] = point.point.p;
    point.status = !solved         ? data::SampleStatus::kUnsolvable
                   : point.own > 3 ? data::SampleStatus::kGood
                                   : data::SampleStatus::kThreeCameras;
    if (!together_[mark]) return;
    if (!first_look_.Take(t, lit, here.clear, here.line.points, &out_.points)) {
      first_look_.Decide(t, lit, here.cameras, here.line.points, {}, &out_.points);
    }
  } else {
    for (int mark : lit) together_[static_cast<std::size_t>(mark)] = true;
    first_look_.Decide(t, lit, here.cameras, {}, {}, &here.line.points);
  }
}

// What the lines behind the first tell of its marks; false while more of them may still come.
bool MarkTracker::Look(const Held& front) {
  const double longest = options_.motion.longest_gap();
  const bool enough =
      finished_ || count_ >= kMostHeld || At(count_ - 1).line.t - front.line.t > longest;
  after_.resize(front.line.lit.size());
  for (std::size_t m = 0; m < front.line.lit.size(); ++m) {
    // Samples that a fourth reading vouches for; of a mark that has none, those of three, as long
    // as a mark can get from each to the next.
    bool spare = false;
    for (const bool vouched : {true, false}) {
      spare = vouched;
      anchors_.clear();
      for (std::size_t i = 1; i < count_ && anchors_.size() < kAhead; ++i) {
        const TrackedLine& line = At(i).line;
        if (line.t - front.line.t > longest) break;
        for (std::size_t k = 0; k < line.lit.size(); ++k) {
          const TrackedPoint& point = line.points[k];
          if (line.lit[k] != front.line.lit[m] || !(line.t > front.line.t)) continue;
          if (vouched ? !Vouched(point) : !data::Usable(point.status)) continue;
          anchors_.push_back({line.t, point.point.cov.trace() / 3.0, point.point.p});
        }
      }
      if (anchors_.size() >= 3) break;
      if (vouched && !enough) return false;
    }
    if (anchors_.size() < kAhead && !enough) return false;
    after_[m] = Motion(options_.motion);
    for (std::size_t k = anchors_.size(); k-- > 0;) {
      if (!spare && after_[m].TooFast(-anchors_[k].t, anchors_[k].p)) {
        after_[m] = Motion(options_.motion);
        break;
      }
      after_[m].Add(-anchors_[k].t, anchors_[k].p, anchors_[k].variance);
    }
  }
  return true;
}

const TrackedLine* MarkTracker::Next() {
  if (count_ == 0) return nullptr;
  Held& front = At(0);
  const TrackedLine& line = front.line;
  if (!final_.Take(line.t, line.lit, front.clear, line.points, &out_.points)) {
    if (!Look(front)) return nullptr;
    final_.Decide(line.t, line.lit, front.cameras, line.points, after_, &out_.points);
  }
  out_.t = line.t;
  out_.lit = line.lit;
  first_ = (first_ + 1) % held_.size();
  --count_;
  return &out_;
}

}  // namespace unfurl::measure
