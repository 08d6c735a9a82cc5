#include "measure/reconstruct.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "data/lab.h"

namespace unfurl::measure {

namespace {

// The background of the first lines comes from the dark ones among these, so that it exists.
constexpr std::size_t kPrimeLines = 160;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::span<const std::uint16_t> LineOf(const data::TrialBlock& block,
                                      const data::TrialHeader& header, std::size_t line,
                                      std::size_t camera) {
  const std::size_t elements = header.format.elements();
  return {&block.counts[(line * header.cameras.size() + camera) * elements], elements};
}

void CheckMatch(const data::TrialReader& trial, const data::Rig& rig, const std::string& rig_path) {
  std::vector<std::string> known;
  for (const data::RigCamera& camera : rig.cameras) known.push_back(camera.name);
  const std::vector<std::string>& recorded = trial.header().cameras;
  if (known == recorded) return;
  throw Error(fmt::format("was recorded by the cameras {}, but the rig {} has {}",
                          JoinWords(recorded), rig_path, JoinWords(known)),
              trial.path(), "give the rig that was calibrated for these cameras, in this order");
}

}  // namespace

std::size_t ReconstructSummary::samples() const {
  std::size_t sum = 0;
  for (const auto& counts : status) {
    for (std::size_t n : counts) sum += n;
  }
  return sum;
}

std::size_t ReconstructSummary::usable() const {
  std::size_t sum = samples();
  for (const auto& counts : status) {
    sum -= counts[static_cast<std::size_t>(data::SampleStatus::kUnsolvable)];
  }
  return sum;
}

Reconstructor::Reconstructor(const data::TrialReader& trial, const data::Rig& rig,
                             const std::string& rig_path, const ReconstructOptions& options)
    : options_(options), header_(trial.header()), triangulator_(rig, options.point) {
  CheckMatch(trial, rig, rig_path);
  layout_.frame = "rig";
  layout_.shared_rank = triangulator_.shared_rank();
  for (const std::string& slot : header_.slots) {
    const bool dark = slot == data::kDarkSlot;
    mark_of_slot_.push_back(dark ? -1 : static_cast<std::int32_t>(layout_.marks.size()));
    if (!dark) layout_.marks.push_back(slot);
  }
  past_.resize(layout_.marks.size());
  const std::size_t cameras = header_.cameras.size();
  summary_.marks = layout_.marks;
  summary_.status.resize(layout_.marks.size());
  summary_.flags.resize(cameras);
  summary_.readings.resize(cameras);
  backgrounds_.assign(cameras, Background(header_.format));
  finders_.assign(cameras, SpotFinder(header_.format, options.spot));
  SetResponses(header_.response, finders_);

  data::TrialBlock block;
  primed_ = std::min(kPrimeLines, trial.size());
  trial.Read(0, primed_, &block);
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (mark_of_slot_[static_cast<std::size_t>(block.slot[i])] >= 0) continue;
    for (std::size_t c = 0; c < cameras; ++c) backgrounds_[c].Add(LineOf(block, header_, i, c));
  }
  if (trial.size() > 0 && backgrounds_[0].empty()) {
    throw Error(fmt::format("has no dark line among its first {}", primed_), trial.path(),
                "record with a slot named dark: the background is taken from it");
  }
}

void Reconstructor::FindSpots(const data::TrialBlock& block) {
  const std::size_t cameras = header_.cameras.size();
  spots_.resize(block.size() * cameras);
  // Each camera walks through the lines in order, so that its background is what it was then.
  ParallelFor(cameras, options_.workers, [&](std::size_t c) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const auto line = LineOf(block, header_, i, c);
      if (mark_of_slot_[static_cast<std::size_t>(block.slot[i])] < 0) {
        if (next_line_ + i >= primed_) backgrounds_[c].Add(line);
        continue;
      }
      spots_[i * cameras + c] = finders_[c].Find(line, backgrounds_[c]);
    }
  });
}

bool Reconstructor::LeaveOneOut(const Past& past, double t, std::span<const double> u,
                                std::span<const double> s, PointSolution* point) const {
  if (past.count < 2) return false;
  const double before = past.t[1] - past.t[0];
  const double since = t - past.t[1];
  if (before > options_.longest_gap || since > options_.longest_gap) return false;
  const Eigen::Vector3d expected = past.p[1] + (past.p[1] - past.p[0]) * (since / before);
  // The velocity is a chord's: it belongs to the middle of the last interval.
  const double slack = 0.5 * options_.max_acceleration * since * (since + before);

  int inside = 0;
  PointSolution found;
  for (std::size_t c = 0; c < u.size(); ++c) {
    if ((point->cameras >> c & 1U) == 0) continue;
    const PointSolution candidate =
        triangulator_.Solve(u, s, expected, point->cameras & ~(1U << c));
    if (candidate.outcome != PointOutcome::kSolved) continue;
    const double reach = options_.gate_sigmas * std::sqrt(candidate.cov.trace()) + slack;
    if ((candidate.p - expected).norm() > reach) continue;
    ++inside;
    found = candidate;
  }
  if (inside != 1) return false;
  *point = found;
  return true;
}

void Reconstructor::Process(const data::TrialBlock& block, data::Tracks* tracks) {
  FindSpots(block);
  const std::size_t cameras = header_.cameras.size();
  const Eigen::Index rank = layout_.shared_rank;
  std::size_t n = 0;
  for (std::int32_t slot : block.slot) n += mark_of_slot_[static_cast<std::size_t>(slot)] >= 0;
  tracks->frame = layout_.frame;
  tracks->marks = layout_.marks;
  tracks->smoothed = false;
  tracks->shared_rank = layout_.shared_rank;
  tracks->t.resize(n);
  tracks->mark.resize(n);
  tracks->status.resize(n);
  tracks->p.setConstant(3, static_cast<Eigen::Index>(n), kNone);
  tracks->cov.setConstant(6, static_cast<Eigen::Index>(n), kNone);
  tracks->shared.setZero(3, static_cast<Eigen::Index>(n) * rank);

  std::vector<double> u(cameras), s(cameras);
  std::size_t sample = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    const std::int32_t mark = mark_of_slot_[static_cast<std::size_t>(block.slot[i])];
    if (mark < 0) {
      ++summary_.dark_lines;
      continue;
    }
    for (std::size_t c = 0; c < cameras; ++c) {
      const Spot& spot = spots_[i * cameras + c];
      const bool usable = Usable(spot);
      u[c] = usable ? spot.u_px : kNone;
      s[c] = usable ? spot.s_px : kNone;
      summary_.readings[c] += usable;
      for (std::size_t bit = 0; bit < 6; ++bit) summary_.flags[c][bit] += spot.flags >> bit & 1U;
    }
    Past& past = past_[static_cast<std::size_t>(mark)];
    const double t = block.t[i];
    PointSolution point =
        triangulator_.Solve(u, s, past.count > 0 ? past.p[1] : triangulator_.centre());
    data::SampleStatus status = data::SampleStatus::kUnsolvable;
    if (point.outcome == PointOutcome::kSolved) {
      status = point.readings > 3 ? data::SampleStatus::kGood : data::SampleStatus::kThreeCameras;
    } else if (point.outcome == PointOutcome::kDisagree && LeaveOneOut(past, t, u, s, &point)) {
      status = data::SampleStatus::kRejectedReading;
    } else {
      ++summary_.unsolved[Name(point.outcome)];
    }
    ++summary_.status[static_cast<std::size_t>(mark)][static_cast<std::size_t>(status)];

    tracks->t[sample] = t;
    tracks->mark[sample] = mark;
    tracks->status[sample] = status;
    const auto col = static_cast<Eigen::Index>(sample);
    if (data::Usable(status)) {
      const Eigen::Matrix3d& C = point.cov;
      tracks->p.col(col) = point.p;
      tracks->cov.col(col) << C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2);
      if (rank > 0) {
        triangulator_.SharedFactor(point, s, tracks->shared.middleCols(col * rank, rank));
      }
      past.t = {past.t[1], t};
      past.p = {past.count > 0 ? past.p[1] : point.p, point.p};
      past.count = std::min(past.count + 1, 2);
    }
    ++sample;
  }
  summary_.lines += block.size();
  next_line_ += block.size();
}

data::Tracks Reconstruct(const data::TrialReader& trial, const data::Rig& rig,
                         const ReconstructOptions& options, ReconstructSummary* summary) {
  Reconstructor reconstructor(trial, rig, "the rig", options);
  data::TrialBlock block;
  trial.Read(0, trial.size(), &block);
  data::Tracks tracks;
  reconstructor.Process(block, &tracks);
  if (summary != nullptr) *summary = reconstructor.summary();
  return tracks;
}

}  // namespace unfurl::measure
