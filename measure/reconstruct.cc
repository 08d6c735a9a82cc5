#include "measure/reconstruct.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/progress.h"
#include "base/refuse_option.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "measure/reconstruct_correct.h"
#include "measure/record_match.h"

namespace unfurl::measure {

namespace {

constexpr double kStartShare = 0.013;  // of the volume's size: start_sigma
constexpr double kReconstructNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void ReconstructOptions::Check() const {
  point.Check();
  associate.Check();
  const RefuseOption refuse("ReconstructOptions");
  if (!(max_speed >= 0.0)) refuse("max_speed", "is negative", "give m/s, or 0 to derive it");
  if (!(start_sigma >= 0.0)) refuse("start_sigma", "is negative", "give m, or 0 to derive it");
  if (!(least_share >= 0.0 && least_share < 1.0)) {
    refuse("least_share", "is not from 0 to 1", "give a share");
  }
  if (!(spot.threshold > 0.0)) refuse("spot.threshold", "is not above 0", "give sigmas");
}

Reconstructor::Reconstructor(const data::TrialReader& trial, const data::Rig& rig,
                             const std::string& rig_path, const ReconstructOptions& options)
    : options_(options), header_(trial.header()), triangulator_(rig, options.point) {
  options.Check();
  PrepareLines(trial.path(), rig_path);
  RefuseSlotSlips(trial);
  const ReadBlock read = [&](std::size_t first, std::size_t count, data::TrialBlock* block) {
    ReadLines(trial, options_.corrections, first, count, block);
  };
  PrimeBackgrounds(trial.path(), trial.size(), read);
  data::TrialBlock block;
  Begin(trial.path(), trial.size(), LookAt(read, &block));
  last_line_ = trial.size();
  evidence_ = HealthEvidence(header_.cameras.size(), last_line_);
}

void Reconstructor::PrepareLines(const std::string& path, const std::string& rig_path) {
  MatchLines(header_, path, triangulator_.rig(), rig_path);
  ReadSlots(path);
  for (std::size_t c = 0; c < header_.cameras.size(); ++c) {
    backgrounds_.emplace_back(header_.format.Of(c));
    finders_.emplace_back(header_.format.Of(c), options_.spot);
    before_.emplace_back(options_.least_share);
  }
  SetResponses(header_.response, finders_);
}

Reconstructor::Look Reconstructor::LookAt(const ReadBlock& read, data::TrialBlock* block) {
  return [this, read, block](std::size_t first, std::size_t count, std::vector<Seen>* seen) {
    read(first, count, block);
    FindSpots(*block, slots_, false, seen);
    return Lines{block->t, block->slot};
  };
}

void Reconstructor::Begin(const std::string& path, std::size_t lines, const Look& look) {
  const std::size_t cameras = header_.cameras.size();
  summary_.marks = layout_.marks;
  summary_.status.resize(layout_.marks.size());
  summary_.reasons.resize(layout_.marks.size());
  summary_.flags.resize(cameras);
  summary_.readings.resize(cameras);
  summary_.left_out.resize(cameras);
  summary_.unseen.resize(layout_.marks.size());
  summary_.too_bright.resize(layout_.marks.size());
  unseen_.resize(layout_.marks.size());
  exchanges_.emplace(layout_.marks.size());
  summary_.lit_dark.votes.assign(layout_.marks.size(), 0);
  readings_.resize(cameras);
  std::vector<FlashReadings> flashes;
  tracking_ = LookAhead(lines, look, &flashes);
  for (LinesBefore& before : before_) before.Conclude();
  RefuseCameraSlips(path, flashes);
  layout_.shared_rank = triangulator_.shared_rank() + CorrectionDirections(options_.corrections);
  tracker_.emplace(triangulator_, layout_.marks.size(), tracking_);
  const double start_sigma =
      options_.start_sigma > 0.0 ? options_.start_sigma : kStartShare * triangulator_.size();
  for (const auto& [name, p] : options_.start) {
    const int mark = layout_.FindMark(name);
    if (mark < 0) {
      throw Error(fmt::format("no mark is named '{}'", name), path,
                  fmt::format("its marks are {}", JoinWords(layout_.marks)));
    }
    tracker_->Expect(static_cast<std::size_t>(mark), p, start_sigma);
  }
}

void Reconstructor::ReadSlots(const std::string& path) {
  CheckSlots(header_.slots, path);
  layout_.frame = "rig";
  layout_.cameras = header_.cameras;
  for (const std::string& name : header_.slots) {
    slots_.emplace_back();
    for (const std::string& mark : data::MarksOfSlot(name)) {
      int at = layout_.FindMark(mark);
      if (at < 0) {
        at = static_cast<int>(layout_.marks.size());
        layout_.marks.push_back(mark);
      }
      slots_.back().marks.push_back(at);
    }
  }
}

// Of a mark that lights up in a dark line the mean would keep a ghost.
int Reconstructor::TakeDark(std::span<const std::uint16_t> line, bool anew, std::size_t camera) {
  int mark = -1;
  if (!backgrounds_[camera].empty()) {
    std::array<Spot, Associator::kMostCandidates> spots;
    const std::size_t lights = finders_[camera].FindAll(line, backgrounds_[camera], spots);
    mark = LightOfDark({spots.data(), lights}, camera);
  }
  if (anew && mark < 0) backgrounds_[camera].Add(line);
  return mark;
}

void Reconstructor::FindSpots(const data::TrialBlock& block, std::span<const Slot> slots,
                              bool learn, std::vector<Seen>* seen) {
  const std::size_t cameras = header_.cameras.size();
  seen->resize(block.size() * cameras);
  if (!learn || next_line_ == 0) {
    for (LinesBefore& before : before_) before.Forget();
    dark_light_.assign(cameras, DarkLight(layout_.marks.size()));
  }
  // Each camera walks through the lines in order, so that its background is what it was then.
  ParallelFor(cameras, options_.workers, [&](std::size_t c) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const auto line = block.Line(header_, i, c);
      Seen& here = (*seen)[i * cameras + c];
      here.count = 0;
      here.flags = 0;
      here.of_dark = -1;
      const std::vector<int>& marks = slots[static_cast<std::size_t>(block.slot[i])].marks;
      std::array<Spot, Associator::kMostCandidates> spots;
      if (marks.empty()) {
        if (learn) here.of_dark = TakeDark(line, next_line_ + i >= primed_, c);
        before_[c].Add({});
        continue;
      }
      const std::size_t count = finders_[c].FindAll(line, backgrounds_[c], spots);
      for (std::size_t k = 1; k < count; ++k) {  // the brightest first
        for (std::size_t j = k; j > 0 && spots[j].flux > spots[j - 1].flux; --j) {
          std::swap(spots[j], spots[j - 1]);
        }
      }
      const std::span<const Spot> found(spots.data(), count);
      if (!learn) before_[c].Learn(found, finders_[c]);
      // What another line's light explains is none of this one's, however bright beside the rest.
      const auto own = std::find_if(found.begin(), found.end(),
                                    [&](const Spot& spot) { return !before_[c].Explain(spot); });
      here.width_px = own != found.end() ? static_cast<float>(own->width_px) : 0.0F;
      here.flags = own != found.end() ? own->flags : static_cast<std::uint8_t>(kSpotDim);
      const bool alone = marks.size() == 1;
      if (alone && learn) {
        dark_light_[c].Lit(marks[0], own != found.end() ? &*own : nullptr, found.size() == 1);
      }
      for (auto spot = own; spot != found.end(); ++spot) {
        if (!Resolved(*spot) || before_[c].Explain(*spot)) continue;
        if (alone && spot->flux < options_.least_share * own->flux) continue;
        if (here.count == 0) here.flux = static_cast<float>(spot->flux);
        here.spots[here.count++] = {spot->u_px, spot->s_px};
      }
      before_[c].Add(found);
    }
  });
}

void Reconstructor::Candidates(std::span<const Seen> seen,
                               std::vector<std::span<const Candidate>>* out) const {
  out->resize(seen.size());
  for (std::size_t c = 0; c < seen.size(); ++c) (*out)[c] = {seen[c].spots.data(), seen[c].count};
}

void Reconstructor::Process(const data::TrialBlock& block, data::Tracks* tracks) {
  FindSpots(block, slots_, true, &seen_);
  Follow({block.t, block.slot}, tracks);
}

void Reconstructor::Follow(const Lines& lines, data::Tracks* tracks) {
  const std::size_t cameras = header_.cameras.size();
  std::vector<std::span<const Candidate>> candidates;
  lines_decided_ = 0;
  for (std::size_t i = 0; i < lines.t.size(); ++i) {
    const Slot& slot = slots_[static_cast<std::size_t>(lines.slot[i])];
    const std::span<Seen> seen(&seen_[i * cameras], cameras);
    CountLight(lines.t[i], slot, seen);
    Correct(lines.t[i], next_line_ + i, slot, seen);
    if (slot.marks.empty()) {
      CountDark(lines.t[i], seen);
      ++summary_.dark_lines;
      continue;
    }
    for (std::size_t c = 0; c < cameras; ++c) {
      for (std::size_t bit = 0; bit < kSpotFlags; ++bit) {
        summary_.flags[c][bit] += seen[c].flags >> bit & 1U;
      }
    }
    Candidates(seen, &candidates);
    tracker_->Add(lines.t[i], slot.marks, candidates);
    Collect();
  }
  summary_.lines += lines.t.size();
  next_line_ += lines.t.size();
  if (next_line_ >= last_line_) {
    tracker_->Finish();
    Collect();
  }
  HandOut(tracks);
}

void Reconstructor::Collect() {
  while (const TrackedLine* line = tracker_->Next()) {
    if (lines_decided_ == decided_.size()) decided_.emplace_back();
    decided_[lines_decided_++] = *line;
  }
}

void Reconstructor::HandOut(data::Tracks* tracks) {
  const std::size_t cameras = header_.cameras.size();
  const Eigen::Index rank = layout_.shared_rank;
  std::size_t n = 0;
  for (std::size_t i = 0; i < lines_decided_; ++i) n += decided_[i].lit.size();
  tracks->frame = layout_.frame;
  tracks->marks = layout_.marks;
  tracks->cameras = layout_.cameras;
  tracks->smoothed = false;
  tracks->shared_rank = layout_.shared_rank;
  tracks->t.resize(n);
  tracks->mark.resize(n);
  tracks->status.resize(n);
  tracks->used.assign(n, 0);
  tracks->left_out.assign(n, 0);
  tracks->reason.assign(n, data::SampleReason::kNone);
  tracks->p.setConstant(3, static_cast<Eigen::Index>(n), kReconstructNone);
  tracks->cov.setConstant(6, static_cast<Eigen::Index>(n), kReconstructNone);
  tracks->shared.setZero(3, static_cast<Eigen::Index>(n) * rank);
  residuals_.assign(n * cameras, std::numeric_limits<float>::quiet_NaN());
  std::vector<double> residual(cameras);
  std::size_t sample = 0;
  for (std::size_t i = 0; i < lines_decided_; ++i) {
    TrackedLine& line = decided_[i];
    const bool doubtful = Doubtful(line.t);
    for (std::size_t m = 0; m < line.lit.size(); ++m, ++sample) {
      TrackedPoint& mine = line.points[m];
      if (doubtful && mine.point.outcome == PointOutcome::kSolved) {
        mine.status = data::SampleStatus::kUnsolvable;
        mine.point.outcome = PointOutcome::kDisagree;
      }
      const auto mark = static_cast<std::size_t>(line.lit[m]);
      tracks->t[sample] = line.t;
      tracks->mark[sample] = line.lit[m];
      tracks->status[sample] = mine.status;
      tracks->left_out[sample] = mine.left_out;
      ++summary_.status[mark][static_cast<std::size_t>(mine.status)];
      for (std::size_t c = 0; c < cameras; ++c) {
        summary_.left_out[c] += mine.left_out >> c & 1U;
      }
      if (!data::Usable(mine.status)) {
        tracks->reason[sample] = ReasonOf(mine.point.outcome);
        ++summary_.reasons[mark][static_cast<std::size_t>(tracks->reason[sample])];
        continue;
      }
      tracks->used[sample] = mine.point.cameras;
      evidence_.Took(line.t, {mine.u_px.data(), cameras});
      for (std::size_t c = 0; c < cameras; ++c) {
        summary_.readings[c] += mine.point.cameras >> c & 1U;
      }
      const auto col = static_cast<Eigen::Index>(sample);
      Eigen::Matrix3d C = mine.point.cov;
      if (rank > 0) {
        Eigen::Matrix3d rest;
        auto F = tracks->shared.middleCols(col * rank, rank);
        triangulator_.SharedFactor(mine.point, mine.s_px, F.leftCols(triangulator_.shared_rank()),
                                   &rest);
        AddCorrectionErrors(line, mine, F.rightCols(rank - triangulator_.shared_rank()));
        C += rest;
        const double lost = rest.trace();
        if (lost > 0.0) {
          summary_.unshared = std::max(summary_.unshared, lost / (lost + F.squaredNorm()));
        }
      }
      tracks->p.col(col) = mine.point.p;
      // The calibration's errors go along with the place.
      exchanges_->Add(line.t, line.lit[m], mine.point.p, std::sqrt(mine.point.cov.trace()));
      tracks->cov.col(col) << C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2);
      triangulator_.Residuals(mine.u_px, mine.point, residual);
      for (std::size_t c = 0; c < cameras; ++c) {
        residuals_[sample * cameras + c] = static_cast<float>(residual[c]);
      }
    }
  }
  summary_.exchanged = exchanges_->found();
  summary_.named_by_place.clear();
  for (std::size_t m = 0; m < layout_.marks.size(); ++m) {
    if (tracker_->named_by_place(m)) summary_.named_by_place.push_back(layout_.marks[m]);
  }
}

}  // namespace unfurl::measure
