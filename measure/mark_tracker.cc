#include "measure/mark_tracker.h"

#include <cassert>
#include <cmath>
#include <limits>

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kMemory = 0.995;     // of a camera's record, per line [-]
constexpr double kPriorLines = 50.0;  // what the option's chance counts for against the record
constexpr double kWorst = 0.5;        // a camera is never held to be wrong more often than this

}  // namespace

MarkTracker::MarkTracker(const Triangulator& triangulator, std::size_t marks,
                         const TrackerOptions& options)
    : triangulator_(triangulator),
      options_(options),
      associator_(triangulator, options.associate),
      motion_(marks, Motion(options.motion)),
      named_by_place_(marks, false),
      wrong_(triangulator.cameras(), 0.0),
      seen_(triangulator.cameras(), 0.0),
      miss_(triangulator.cameras(), options.associate.miss) {}

void MarkTracker::ThreeReadings(double t, const Motion& motion, TrackedPoint* out) const {
  PointSolution& point = out->point;
  const auto sigma = [](const PointSolution& p) { return std::sqrt(p.cov.trace()); };
  PointSolution twin;
  if (triangulator_.SecondSolution(out->u_px, out->s_px, point, &twin)) {
    if (!motion.Fresh(t)) {
      if (triangulator_.NearVolume(point.p) != triangulator_.NearVolume(twin.p)) {
        if (triangulator_.NearVolume(twin.p)) point = twin;
      } else {
        point.outcome = PointOutcome::kTwoFit;
        return;
      }
    } else {
      const bool first = motion.WithinReach(t, point.p, sigma(point));
      const bool second = motion.WithinReach(t, twin.p, sigma(twin));
      if (first && second) {
        point.outcome = PointOutcome::kTwoFit;
        return;
      }
      if (second) point = twin;
    }
  }
  if (!motion.WithinReach(t, point.p, sigma(point))) point.outcome = PointOutcome::kOffPath;
}

// The plain case: one mark, one spot per camera (or second ones in at most two), readings that
// meet. False: it is not that plain.
bool MarkTracker::Alone(double t, int mark, std::span<const std::span<const Candidate>> cameras,
                        TrackedPoint* out) {
  const Motion& motion = motion_[static_cast<std::size_t>(mark)];
  const std::size_t n = cameras.size();
  int several = 0, readings = 0;
  for (std::size_t c = 0; c < n; ++c) {
    const bool any = !cameras[c].empty();
    out->u_px[c] = any ? cameras[c][0].u_px : kNone;
    out->s_px[c] = any ? cameras[c][0].s_px : 1.0;
    several += cameras[c].size() > 1;
    readings += any;
  }
  // A mirror shows a whole second point: it needs three cameras to be one.
  if (several > 2 || (several > 0 && readings < 4)) return false;
  const Eigen::Vector3d start = motion.known() ? motion.Start(t) : triangulator_.centre();
  out->point = triangulator_.Solve({out->u_px.data(), n}, {out->s_px.data(), n}, start);
  if (out->point.outcome == PointOutcome::kDisagree) return false;
  if (out->point.outcome != PointOutcome::kSolved) {
    // From where the mark should be, Newton's method finds what is near; from the middle, anything.
    if (readings > 3) return false;
    return true;
  }
  if (readings == 3) {
    ThreeReadings(t, motion, out);
  } else if (motion.TooFast(t, out->point.p)) {
    out->point.outcome = PointOutcome::kOffPath;
  }
  for (std::size_t c = 0; c < n; ++c) {
    if (cameras[c].size() > 1) out->left_out |= 1U << c;
  }
  return true;
}

void MarkTracker::Together(double t, std::span<const int> lit,
                           std::span<const std::span<const Candidate>> cameras,
                           std::vector<TrackedPoint>* out) {
  const std::size_t n = cameras.size();
  marks_.resize(lit.size());
  bool any_unknown = false;
  for (std::size_t m = 0; m < lit.size(); ++m) {
    const Motion& motion = motion_[static_cast<std::size_t>(lit[m])];
    marks_[m].known = motion.known();
    any_unknown = any_unknown || !motion.known();
    if (motion.known()) marks_[m].expected = motion.Predict(t);
  }
  bool one_each = true;
  for (std::size_t c = 0; c < n; ++c) {
    const double prior = options_.associate.miss;
    miss_[c] = std::min(kWorst, (prior * kPriorLines + wrong_[c]) / (kPriorLines + seen_[c]));
    one_each = one_each && cameras[c].size() <= 1;
  }
  associator_.Associate(cameras, marks_, miss_, &found_);
  for (std::size_t m = 0; m < lit.size(); ++m) {
    TrackedPoint& mine = (*out)[m];
    const Motion& motion = motion_[static_cast<std::size_t>(lit[m])];
    mine = {};
    mine.point = found_[m].point;
    for (std::size_t c = 0; c < n; ++c) {
      const std::int8_t k = found_[m].chosen[c];
      mine.u_px[c] = k < 0 ? kNone : cameras[c][static_cast<std::size_t>(k)].u_px;
      mine.s_px[c] = k < 0 ? 1.0 : cameras[c][static_cast<std::size_t>(k)].s_px;
      if (lit.size() == 1 && cameras[c].size() > (k < 0 ? 0U : 1U)) mine.left_out |= 1U << c;
    }
    if (mine.point.outcome == PointOutcome::kAmbiguous && lit.size() == 1 && one_each) {
      mine.point.outcome = PointOutcome::kDisagree;
    }
    if (mine.point.outcome != PointOutcome::kSolved) continue;
    if (mine.point.readings == 3 &&
        !motion.WithinReach(t, mine.point.p, std::sqrt(mine.point.cov.trace()))) {
      mine.point.outcome = PointOutcome::kOffPath;
    } else if (motion.TooFast(t, mine.point.p)) {
      mine.point.outcome = PointOutcome::kOffPath;
    }
    if (mine.point.outcome == PointOutcome::kSolved && any_unknown && lit.size() > 1 &&
        !marks_[m].known) {
      named_by_place_[static_cast<std::size_t>(lit[m])] = true;
    }
  }
}

void MarkTracker::Settle(double t, int mark, TrackedPoint* out) {
  if (out->point.outcome != PointOutcome::kSolved) {
    out->status = data::SampleStatus::kUnsolvable;
    return;
  }
  const std::uint32_t unused = out->left_out & ~out->point.cameras;
  out->status = unused != 0               ? data::SampleStatus::kRejectedReading
                : out->point.readings > 3 ? data::SampleStatus::kGood
                                          : data::SampleStatus::kThreeCameras;
  motion_[static_cast<std::size_t>(mark)].Add(t, out->point.p, out->point.cov.trace() / 3.0);
  for (std::size_t c = 0; c < wrong_.size(); ++c) {
    const bool rejected = (unused >> c & 1U) != 0;
    if (!rejected && (out->point.cameras >> c & 1U) == 0) continue;
    wrong_[c] = kMemory * wrong_[c] + (rejected ? 1.0 : 0.0);
    seen_[c] = kMemory * seen_[c] + 1.0;
  }
}

void MarkTracker::Add(double t, std::span<const int> lit,
                      std::span<const std::span<const Candidate>> cameras,
                      std::vector<TrackedPoint>* out) {
  assert(cameras.size() == triangulator_.cameras());
  out->resize(lit.size());
  if (lit.size() == 1) {
    (*out)[0] = {};
    if (!Alone(t, lit[0], cameras, &(*out)[0])) Together(t, lit, cameras, out);
  } else {
    Together(t, lit, cameras, out);
  }
  for (std::size_t m = 0; m < lit.size(); ++m) Settle(t, lit[m], &(*out)[m]);
}

}  // namespace unfurl::measure
