#include "measure/mark_tracker.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kMemory = 0.995;     // of a camera's record, per line [-]
constexpr double kPriorLines = 50.0;  // what the option's chance counts for against the record
constexpr double kWorst = 0.5;        // a camera is never held to be wrong more often than this

// Where a mark that moves on as it has of late may be; a kick is not expected.
bool Expected(const Motion::Prediction& at, const PointSolution& point) {
  constexpr double kLikely = 0.25;  // weight of a way of moving [-]
  constexpr double kSigmas = 5.0;
  for (std::size_t j = 0; j + 1 < at.weight.size(); ++j) {  // the last one is the kick
    const double sigma = std::sqrt(at.variance[j] + point.cov.trace());
    if (at.weight[j] >= kLikely && (point.p - at.mean[j]).norm() <= kSigmas * sigma) return true;
  }
  return false;
}

}  // namespace

MarkTracker::MarkTracker(const Triangulator& triangulator, std::size_t marks,
                         const TrackerOptions& options)
    : triangulator_(triangulator),
      options_(options),
      associator_(triangulator, options.associate),
      motion_(marks, Motion(options.motion)),
      named_by_place_(marks, false),
      waiting_(marks),
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

// Four readings that meet are believed, kick or no kick, as long as the cameras are. Where they
// have been wrong so often of late that two wrong ones may meet, an unexpected place waits for the
// next sample to confirm it.
bool MarkTracker::Believed(double t, int mark, const PointSolution& point) {
  constexpr double kOften = 0.02;  // wrong readings among all, of late [-]
  constexpr double kSpeed = 2.0;   // that a kick may add [m/s]
  double wrong = 0.0, seen = kPriorLines;
  for (std::size_t c = 0; c < wrong_.size(); ++c) {
    wrong += wrong_[c];
    seen += seen_[c];
  }
  Motion& motion = motion_[static_cast<std::size_t>(mark)];
  if (wrong < kOften * seen || !motion.Fresh(t)) return true;
  if (Expected(motion.Predict(t), point)) return true;
  Waiting& waiting = waiting_[static_cast<std::size_t>(mark)];
  const double since = t - waiting.t;
  const bool confirmed =
      since > 0.0 && since < options_.motion.longest_gap &&
      (point.p - waiting.p - (motion.Start(t) - motion.Start(waiting.t))).norm() <
          kSpeed * since + options_.motion.gate_sigmas * std::sqrt(2.0 * point.cov.trace());
  if (confirmed) {
    motion.Forget();
    motion.Add(waiting.t, waiting.p, point.cov.trace() / 3.0);
    return true;
  }
  waiting = {t, point.p};
  return false;
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
  out->own = readings;
  out->point = triangulator_.Solve({out->u_px.data(), n}, {out->s_px.data(), n}, start);
  if (out->point.outcome == PointOutcome::kDisagree) return false;
  if (out->point.outcome != PointOutcome::kSolved) {
    // From where the mark should be, Newton's method finds what is near; from the middle, anything.
    if (readings > 3) return false;
    return true;
  }
  if (readings == 3) {
    ThreeReadings(t, motion, out);
  } else if (motion.TooFast(t, out->point.p) || !Believed(t, mark, out->point)) {
    out->point.outcome = PointOutcome::kOffPath;
  }
  for (std::size_t c = 0; c < n; ++c) {
    if (cameras[c].size() > 1) out->left_out |= 1U << c;
  }
  return true;
}

// Where marks are expected in one place of a camera there may be one spot for all of them,
// somewhere between them: a reading of each that may be off by half the width of what one spot can
// cover. No use is made of where exactly they are expected: it would come back as if it had been
// measured.
void MarkTracker::FindHidden(std::span<const std::span<const Candidate>> cameras) {
  if (marks_.size() < 2) return;
  // Expectations are not exact: what might be one spot and is, counts as one.
  constexpr double kWider = 1.7;
  const double merge = options_.associate.merge_px, window = kWider * merge;
  expected_u_.resize(marks_.size());
  for (std::size_t m = 0; m < marks_.size(); ++m) {
    if (!marks_[m].followed) continue;
    const Motion::Prediction& at = marks_[m].expected;
    const auto likeliest = std::max_element(at.weight.begin(), at.weight.end());
    const Eigen::Vector3d& p = at.mean[static_cast<std::size_t>(likeliest - at.weight.begin())];
    triangulator_.bank().Readings(p.data(), expected_u_[m].data());
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (std::size_t m = 0; m < marks_.size(); ++m) {
      if (!marks_[m].followed) continue;
      const double mine = expected_u_[m][c];
      double sum = 0.0, count = 0.0;
      for (std::size_t other = 0; other < marks_.size(); ++other) {
        if (!marks_[other].followed || !(std::abs(expected_u_[other][c] - mine) < window)) continue;
        sum += expected_u_[other][c];
        count += 1.0;
      }
      if (count < 2.0) continue;
      const double middle = sum / count;
      double spots = 0.0, nearest = kNone;
      for (std::size_t k = 0; k < std::min(cameras[c].size(), Associator::kMostCandidates); ++k) {
        const Candidate& candidate = cameras[c][k];
        const double away = std::abs(candidate.u_px - middle);
        if (!(away < window)) continue;
        spots += 1.0;
        if (away >= std::abs(nearest - middle)) continue;
        nearest = candidate.u_px;
        marks_[m].merged_spot[c] = static_cast<std::uint8_t>(k);
      }
      if (spots >= count) continue;  // each its own
      marks_[m].hidden |= 1U << c;
      marks_[m].merged[c] = {nearest, 0.5 * merge / std::sqrt(3.0)};
    }
  }
}

void MarkTracker::Together(double t, std::span<const int> lit,
                           std::span<const std::span<const Candidate>> cameras,
                           std::vector<TrackedPoint>* out) {
  const std::size_t n = cameras.size();
  marks_.resize(lit.size());
  bool any_unknown = false;
  int lost = 0;
  for (std::size_t m = 0; m < lit.size(); ++m) {
    const Motion& motion = motion_[static_cast<std::size_t>(lit[m])];
    marks_[m].known = motion.known();
    any_unknown = any_unknown || !motion.known();
    marks_[m].followed = motion.Fresh(t);
    lost += motion.Lost(t);
    marks_[m].hidden = 0;
    if (motion.known()) marks_[m].expected = motion.Predict(t);
  }
  FindHidden(cameras);
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
      const Candidate none{kNone, 1.0};
      const Candidate& taken = k < 0                      ? none
                               : k == Associator::kMerged ? marks_[m].merged[c]
                                                          : cameras[c][static_cast<std::size_t>(k)];
      mine.u_px[c] = taken.u_px;
      mine.s_px[c] = taken.s_px;
      mine.own += k >= 0 && k != Associator::kMerged;
      if (lit.size() == 1 && cameras[c].size() > (k < 0 ? 0U : 1U)) mine.left_out |= 1U << c;
    }
    if (mine.point.outcome == PointOutcome::kAmbiguous && lit.size() == 1 && one_each) {
      mine.point.outcome = PointOutcome::kDisagree;
    }
    if (mine.point.outcome != PointOutcome::kSolved) continue;
    const bool taken_up = !motion.Fresh(t) && (motion.seen() || motion.Lost(t));
    if (lit.size() > 1 && taken_up && (mine.own <= 3 || (motion.Lost(t) && lost > 1))) {
      // A mark that is not being followed is taken up with a reading to spare, or not yet; of two
      // such nobody can say which is which.
      mine.point.outcome = PointOutcome::kAmbiguous;
    } else if (lit.size() == 1 && mine.left_out != 0 && mine.own <= 3 && !motion.Fresh(t) &&
               one_each) {
      mine.point.outcome = PointOutcome::kDisagree;
    } else if ((lit.size() > 1 || mine.left_out != 0) && mine.own <= 3 && motion.Fresh(t)) {
      // One reading is known to be wrong, or may be another mark's; so may be a second.
      if (!Expected(motion.Predict(t), mine.point)) mine.point.outcome = PointOutcome::kOffPath;
    } else if (mine.own <= 3 &&
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
  if (out->own < 3) {
    // The rest is of spots that it shares: no measurement of this mark.
    out->point.outcome = PointOutcome::kAmbiguous;
    out->status = data::SampleStatus::kUnsolvable;
    return;
  }
  const std::uint32_t unused = out->left_out & ~out->point.cameras;
  out->status = unused != 0    ? data::SampleStatus::kRejectedReading
                : out->own > 3 ? data::SampleStatus::kGood
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
  for (int mark : lit) motion_[static_cast<std::size_t>(mark)].Begin(t);
  if (lit.size() == 1) {
    (*out)[0] = {};
    if (!Alone(t, lit[0], cameras, &(*out)[0])) Together(t, lit, cameras, out);
  } else {
    Together(t, lit, cameras, out);
  }
  for (std::size_t m = 0; m < lit.size(); ++m) Settle(t, lit[m], &(*out)[m]);
}

}  // namespace unfurl::measure
