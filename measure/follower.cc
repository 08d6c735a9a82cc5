#include "measure/follower.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace unfurl::measure {

namespace {

constexpr double kFollowerNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kMemory = 0.995;     // of a camera's record, per line [-]
constexpr double kPriorLines = 50.0;  // what the option's chance counts for against the record
// Sigmas of where a mark is that is not followed, over the volume's size: up to the first a spot
// between it and another is understood (twice what one spot can cover, in a row of 2000 pixels that
// sees the volume), and from the second on it is lost [-].
constexpr double kPlaced = 0.008, kLostSigma = 0.013;
// Three false spots meet at any place of the volume alike. Where a mark may be within this much of
// it (radius over the volume's size from corner to corner), one such point in 300 is there [-].
constexpr double kTellingReach = 0.05;
constexpr double kTakenUp = 0.9999;  // certainty that a mark is taken up with again [-]
constexpr double kWorst = 0.5;       // a camera is never held to be wrong more often than this

// Where a mark that moves on as it has of late may be; a kick is not expected. `at` is a forecast.
bool Expected(const Motion::Prediction& at, const PointSolution& point) {
  constexpr double kLikely = 0.25;  // weight of a way of moving [-]
  // The mark's own place lies beyond in 2 of 100,000 cases at most (chi-square of 3).
  constexpr double kSigmas = 5.0;
  for (std::size_t j = 0; j + 1 < at.count; ++j) {  // the last one is the kick
    const double sigma = std::sqrt(at.variance[j] + point.cov.trace());
    if (at.weight[j] >= kLikely && (point.p - at.mean[j]).norm() <= kSigmas * sigma) return true;
  }
  return false;
}

}  // namespace

Follower::Follower(const Triangulator& triangulator, std::size_t marks,
                   const TrackerOptions& options)
    : triangulator_(triangulator),
      options_(options),
      associator_(triangulator, options.associate),
      motion_(marks, Motion(options.motion)),
      named_by_place_(marks, false),
      wrong_(triangulator.cameras(), 0.0),
      seen_(triangulator.cameras(), 0.0),
      miss_(triangulator.cameras(), options.associate.miss) {}

void Follower::ThreeReadings(double t, const Motion& motion, TrackedPoint* out) const {
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

// Have the cameras been wrong so often of late that two wrong readings may meet?
bool Follower::Trusted() const {
  constexpr double kOften = 0.02;  // wrong readings among all [-]
  double wrong = 0.0, seen = kPriorLines;
  for (std::size_t c = 0; c < wrong_.size(); ++c) {
    wrong += wrong_[c];
    seen += seen_[c];
  }
  return wrong < kOften * seen;
}

bool Follower::Alone(Cameras cameras, const Eigen::Vector3d& start, TrackedPoint* out) const {
  *out = {};
  const std::size_t n = cameras.size();
  int several = 0;
  for (std::size_t c = 0; c < n; ++c) {
    const bool any = !cameras[c].empty();
    out->u_px[c] = any ? cameras[c][0].u_px : kFollowerNone;
    out->s_px[c] = any ? cameras[c][0].s_px : 1.0;
    if (cameras[c].size() > 1) out->left_out |= 1U << c;
    several += cameras[c].size() > 1;
    out->own += any;
  }
  out->point = triangulator_.Solve({out->u_px.data(), n}, {out->s_px.data(), n}, start);
  // A mirror shows a whole second point: it needs three cameras to be one.
  return several <= 2 && (several == 0 || out->own > 3) &&
         (out->own < 4 || out->point.outcome == PointOutcome::kSolved);
}

bool Follower::Take(double t, std::span<const int> lit, bool clear,
                    std::span<const TrackedPoint> first, std::vector<TrackedPoint>* out) {
  for (std::size_t m = 0; m < lit.size(); ++m) {
    const Motion& motion = motion_[static_cast<std::size_t>(lit[m])];
    const TrackedPoint& mine = first[m];
    if (lit.size() > 1) {
      if (mine.status != data::SampleStatus::kGood) return false;
      continue;
    }
    if (!clear) return false;
    if (mine.point.outcome != PointOutcome::kSolved) continue;  // with three readings or fewer
    if (motion.TooFast(t, mine.point.p)) return false;
    if (!Trusted()) return false;
  }
  out->assign(first.begin(), first.end());
  if (lit.size() == 1 && (*out)[0].own == 3) {
    TrackedPoint& mine = (*out)[0];
    if (mine.point.outcome == PointOutcome::kSolved) {
      // Any three false spots meet somewhere: what follows must vouch for the first.
      if (!Telling(motion_[static_cast<std::size_t>(lit[0])], t)) return false;
      ThreeReadings(t, motion_[static_cast<std::size_t>(lit[0])], &mine);
      if (mine.point.outcome != PointOutcome::kSolved) return false;
    }
  }
  for (std::size_t m = 0; m < lit.size(); ++m) {
    motion_[static_cast<std::size_t>(lit[m])].Begin(t);
    Settle(t, lit[m], &(*out)[m]);
  }
  return true;
}

void Follower::Decide(double t, std::span<const int> lit, Cameras cameras,
                      std::span<const TrackedPoint> first, std::span<const Motion> after,
                      std::vector<TrackedPoint>* out) {
  assert(cameras.size() == triangulator_.cameras());
  out->resize(lit.size());
  for (int mark : lit) motion_[static_cast<std::size_t>(mark)].Begin(t);
  const auto solved = [&] {  // by itself, for nothing else tells anything
    if (lit.size() > 1 || first[0].point.outcome != PointOutcome::kSolved) return false;
    if (first[0].own < 4) return false;
    const Motion& motion = motion_[static_cast<std::size_t>(lit[0])];
    return !motion.Fresh(t) && (after.empty() || !after[0].Fresh(-t)) &&
           !motion.TooFast(t, first[0].point.p) && __builtin_popcount(first[0].left_out) <= 2;
  };
  // Three readings, none left over: the lines that follow vouch for them.
  const auto foretold = [&] {
    if (lit.size() > 1 || first[0].point.outcome != PointOutcome::kSolved) return false;
    if (first[0].own != 3 || first[0].left_out != 0) return false;
    const Motion& motion = motion_[static_cast<std::size_t>(lit[0])];
    if (motion.Fresh(t) || after.empty() || !Telling(after[0], -t)) return false;
    (*out)[0] = first[0];
    ThreeReadings(-t, after[0], &(*out)[0]);
    const TrackedPoint& mine = (*out)[0];
    return mine.point.outcome == PointOutcome::kSolved && !motion.TooFast(t, mine.point.p);
  };
  if (solved()) {
    (*out)[0] = first[0];
  } else if (!foretold()) {
    Together(t, lit, cameras, after, out);
  }
  for (std::size_t m = 0; m < lit.size(); ++m) Settle(t, lit[m], &(*out)[m]);
}

// Where marks are expected in one place of a camera there may be one spot for all of them,
// somewhere between them: a reading of each that may be off by half the width of what one spot can
// cover. No use is made of where exactly they are expected: it would come back as if it had been
// measured.
void Follower::FindHidden(Cameras cameras) {
  if (marks_.size() < 2) return;
  // Expectations are not exact: what might be one spot and is, counts as one.
  constexpr double kWider = 1.7;
  const double merge = options_.associate.merge_px, window = kWider * merge;
  expected_u_.resize(marks_.size());
  for (std::size_t m = 0; m < marks_.size(); ++m) {
    if (!marks_[m].placed) continue;
    triangulator_.bank().Readings(marks_[m].expected.Likeliest().data(), expected_u_[m].data());
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (std::size_t m = 0; m < marks_.size(); ++m) {
      if (!marks_[m].placed) continue;
      const double mine = expected_u_[m][c];
      double sum = 0.0, count = 0.0;
      for (std::size_t other = 0; other < marks_.size(); ++other) {
        if (!marks_[other].placed || !(std::abs(expected_u_[other][c] - mine) < window)) continue;
        sum += expected_u_[other][c];
        count += 1.0;
      }
      if (count < 2.0) continue;
      const double middle = sum / count;
      double spots = 0.0, nearest = kFollowerNone;
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

// Where each mark of the line is expected, and how surely.
bool Follower::ExpectMarks(double t, std::span<const int> lit, std::span<const Motion> after) {
  const double placed = kPlaced * triangulator_.size(), lost = kLostSigma * triangulator_.size();
  marks_.resize(lit.size());
  bool all_known = true;
  for (std::size_t m = 0; m < lit.size(); ++m) {
    const Motion& motion = motion_[static_cast<std::size_t>(lit[m])];
    const bool ahead = !after.empty() && after[m].Fresh(-t);
    Associator::Mark& mark = marks_[m];
    mark.known = motion.known() || ahead;
    all_known = all_known && mark.known;
    mark.followed = motion.Fresh(t) || ahead;
    mark.hidden = 0;
    mark.lost = false;
    if (!mark.known) continue;
    mark.expected = ahead ? motion.Between(t, after[m]) : motion.Predict(t);
    const double variance = mark.expected.variance[mark.expected.LikeliestAt()];
    const bool stale = motion.seen() && motion.Lost(t);
    mark.placed = mark.followed || (!stale && variance <= placed * placed);
    mark.lost = lit.size() > 1 && !mark.followed && (stale || variance > lost * lost);
  }
  return all_known;
}

// The association's m-th mark with the readings that it took.
TrackedPoint Follower::PointOf(std::size_t m, bool several, Cameras cameras) const {
  TrackedPoint mine;
  mine.point = found_[m].point;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const std::int8_t k = found_[m].chosen[c];
    const Candidate none{kFollowerNone, 1.0};
    const Candidate& taken = k < 0                      ? none
                             : k == Associator::kMerged ? marks_[m].merged[c]
                                                        : cameras[c][static_cast<std::size_t>(k)];
    mine.u_px[c] = taken.u_px;
    mine.s_px[c] = taken.s_px;
    mine.own += k >= 0 && k != Associator::kMerged;
    if (!several && cameras[c].size() > (k < 0 ? 0U : 1U)) mine.left_out |= 1U << c;
  }
  return mine;
}

// A mark that was lost is taken up when it is the only one that can be there: of two that are
// missing, nobody can say which is which.
void Follower::TakeUpLost(std::vector<TrackedPoint>* out) const {
  for (std::size_t m = 0; m < marks_.size(); ++m) {
    if (!marks_[m].lost || (*out)[m].point.outcome != PointOutcome::kSolved) continue;
    bool alone = found_[m].certainty >= kTakenUp;
    for (std::size_t other = 0; other < marks_.size(); ++other) {
      alone = alone && (other == m || (!marks_[other].lost &&
                                       (*out)[other].point.outcome == PointOutcome::kSolved));
    }
    if (!alone) (*out)[m].point.outcome = PointOutcome::kAmbiguous;
  }
}

void Follower::Together(double t, std::span<const int> lit, Cameras cameras,
                        std::span<const Motion> after, std::vector<TrackedPoint>* out) {
  const bool several = lit.size() > 1;
  const bool all_known = ExpectMarks(t, lit, after);
  FindHidden(cameras);
  // How often each camera misses: its record of late, begun with the option's chance.
  bool one_each = true;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const double prior = options_.associate.miss;
    miss_[c] = std::min(kWorst, (prior * kPriorLines + wrong_[c]) / (kPriorLines + seen_[c]));
    one_each = one_each && cameras[c].size() <= 1;
  }
  associator_.Associate(cameras, marks_, miss_, &found_);
  for (std::size_t m = 0; m < lit.size(); ++m) {
    TrackedPoint& mine = (*out)[m];
    mine = PointOf(m, several, cameras);
    if (mine.point.outcome == PointOutcome::kAmbiguous && !several && one_each) {
      mine.point.outcome = PointOutcome::kDisagree;
    }
    if (mine.point.outcome != PointOutcome::kSolved) continue;
    mine.point.outcome = Allowed(t, lit[m], after.empty() ? nullptr : &after[m], several, one_each,
                                 marks_[m].lost, mine);
    if (mine.point.outcome == PointOutcome::kSolved && several && !all_known && !marks_[m].known) {
      named_by_place_[static_cast<std::size_t>(lit[m])] = true;
    }
  }
  TakeUpLost(out);
}

bool Follower::Telling(const Motion& motion, double t) const {
  return motion.Reach(t) <= kTellingReach * triangulator_.size();
}

namespace {

// One reading is known to be wrong, or may be another mark's; so may be a second.
bool AsExpected(const Motion& motion, double t, bool several, const TrackedPoint& mine) {
  return (!several && mine.left_out == 0) || Expected(motion.Predict(t), mine.point);
}

}  // namespace

// Conditions that hold whatever the association's probabilities say: no mark is faster than its
// highest speed, and a point without a reading to spare continues the mark's motion.
PointOutcome Follower::Allowed(double t, int mark, const Motion* after, bool several, bool one_each,
                               bool lost, const TrackedPoint& mine) const {
  const Motion& motion = motion_[static_cast<std::size_t>(mark)];
  if (after != nullptr && !after->Fresh(-t)) after = nullptr;
  const bool before = motion.Fresh(t), ahead = after != nullptr;
  const Eigen::Vector3d& p = mine.point.p;
  if (motion.TooFast(t, p)) return PointOutcome::kOffPath;
  if (ahead && after->TooFast(-t, p)) return PointOutcome::kOffPath;
  if (mine.own > 3) return PointOutcome::kSolved;  // a reading is left over to vouch for it
  const double sigma = std::sqrt(mine.point.cov.trace());
  const auto reaches = [&](const Motion& m, double at) {
    return m.WithinReach(at, p, sigma) && (several || Telling(m, at));
  };
  if (before && ahead) {
    return reaches(motion, t) || reaches(*after, -t) ? PointOutcome::kSolved
                                                     : PointOutcome::kOffPath;
  }
  if (before || ahead) {
    const Motion& known = before ? motion : *after;
    const double at = before ? t : -t;
    return reaches(known, at) && AsExpected(known, at, several, mine) ? PointOutcome::kSolved
                                                                      : PointOutcome::kOffPath;
  }
  // A mark that is not being followed is taken up with a reading to spare, or not yet: any three
  // false spots meet somewhere. Of several lit together the association weighs that.
  if (!several && mine.left_out != 0 && one_each) return PointOutcome::kDisagree;
  return lost || !several ? PointOutcome::kAmbiguous : PointOutcome::kSolved;
}

void Follower::Settle(double t, int mark, TrackedPoint* out) {
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

}  // namespace unfurl::measure
