#include "measure/associate.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kLost = 14.0;  // sets whose weight is e^-14 of the best are forgotten
constexpr std::size_t kMostVisited =
    200000;                              // sets looked at; beyond, the line counts as ambiguous
constexpr std::size_t kMostPoints = 60;  // possible points of a mark that are kept

}  // namespace

Associator::Associator(const Triangulator& triangulator, const AssociateOptions& options)
    : triangulator_(triangulator),
      options_(options),
      u_(triangulator.cameras(), kNone),
      s_(triangulator.cameras(), 1.0) {
  const data::Rig& rig = triangulator.rig();
  log_volume_ = std::log(std::max((rig.volume_high - rig.volume_low).prod(), 1e-9));
}

// What the readings say of a point, as if each that was not claimed were clutter: relative to all
// being clutter.
void Associator::Push(const PointSolution& point, std::span<const double> miss,
                      std::vector<Hypothesis>* out) const {
  if (point.outcome != PointOutcome::kSolved) return;
  const double clutter = std::log(options_.clutter / options_.row_px);
  Hypothesis h;
  h.point = point;
  h.chosen = chosen_;
  // The readings' densities, integrated over where the point may be.
  h.score =
      1.5 * std::log(2.0 * M_PI) + 0.5 * std::log(point.cov.determinant()) - 0.5 * point.chi_square;
  for (std::size_t c = 0; c < u_.size(); ++c) {
    const double m = miss.empty() ? options_.miss : miss[c];
    if ((point.cameras >> c & 1U) == 0) {
      if (mark_ == nullptr || (mark_->hidden >> c & 1U) == 0) h.score += std::log(m);
      continue;
    }
    const double sigma = std::hypot(s_[c], data::FloorOf(triangulator_.rig(), c));
    h.score += std::log(1.0 - m) - 0.5 * std::log(2.0 * M_PI) - std::log(sigma) - clutter;
  }
  out->push_back(h);
}

std::size_t Associator::Choices(std::span<const std::span<const Candidate>> cameras,
                                std::size_t camera) const {
  if (mark_ != nullptr && (mark_->hidden >> camera & 1U) != 0) return 1;
  return std::min(cameras[camera].size(), kMostCandidates);
}

bool Associator::Choose(std::span<const std::span<const Candidate>> cameras, std::size_t camera,
                        std::size_t k) {
  if (mark_ != nullptr && (mark_->hidden >> camera & 1U) != 0) {
    if (std::isnan(mark_->merged[camera].u_px)) return false;
    u_[camera] = mark_->merged[camera].u_px;
    s_[camera] = mark_->merged[camera].s_px;
    chosen_[camera] = kMerged;
    return true;
  }
  if ((near_[camera] >> k & 1U) == 0) return false;
  u_[camera] = cameras[camera][k].u_px;
  s_[camera] = cameras[camera][k].s_px;
  chosen_[camera] = static_cast<std::int8_t>(k);
  return true;
}

void Associator::Unchoose(std::size_t camera) {
  u_[camera] = kNone;
  chosen_[camera] = -1;
}

// A point from three readings or more, with and without those of the cameras that come after.
void Associator::Extend(std::span<const std::span<const Candidate>> cameras, std::size_t camera,
                        const PointSolution& from, std::span<const double> miss, int readings,
                        std::vector<Hypothesis>* out) {
  if (camera == cameras.size()) {
    Push(from, miss, out);
    PointSolution twin;
    if (readings == 3 && triangulator_.SecondSolution(u_, s_, from, &twin)) Push(twin, miss, out);
    return;
  }
  Extend(cameras, camera + 1, from, miss, readings, out);
  // Only spots that the point so far can reach: its own error, by the steepest a reading can move.
  constexpr double kSteepest = 1500.0;  // [px/m], 1.5 m from a camera
  std::array<double, CameraBank::kMaxCameras> at;
  triangulator_.bank().Readings(from.p.data(), at.data());
  const double reach = 1.0 + options_.gate_sigmas * kSteepest * std::sqrt(from.cov.trace());
  for (std::size_t k = 0; k < Choices(cameras, camera); ++k) {
    if (!Choose(cameras, camera, k)) continue;
    if (std::abs(u_[camera] - at[camera]) < reach + options_.gate_sigmas * s_[camera]) {
      const PointSolution wider = triangulator_.Solve(u_, s_, from.p);
      if (wider.outcome == PointOutcome::kSolved) {
        Extend(cameras, camera + 1, wider, miss, readings + 1, out);
      }
    }
    Unchoose(camera);
  }
}

void Associator::Enumerate(std::span<const std::span<const Candidate>> cameras, const Mark* mark,
                           std::span<const double> miss, std::vector<Hypothesis>* out) {
  out->clear();
  std::fill(u_.begin(), u_.end(), kNone);
  chosen_.fill(-1);
  const std::size_t n = cameras.size();
  // Spots near where the mark is expected, or all of them.
  near_.fill(0xFF);
  mark_ = mark;
  Eigen::Vector3d start = triangulator_.centre();
  if (mark != nullptr) {
    near_.fill(0);
    const auto likeliest =
        std::max_element(mark->expected.weight.begin(), mark->expected.weight.end());
    start =
        mark->expected.mean[static_cast<std::size_t>(likeliest - mark->expected.weight.begin())];
    for (std::size_t c = 0; c < n; ++c) {
      if ((mark->hidden >> c & 1U) != 0) continue;
      for (std::size_t j = 0; j < Motion::kModels; ++j) {
        Projection here;
        if (!Project(triangulator_.rig().cameras[c], mark->expected.mean[j], &here)) continue;
        const double reach =
            options_.gate_sigmas * here.du_dp.norm() * std::sqrt(mark->expected.variance[j]);
        for (std::size_t k = 0; k < std::min(cameras[c].size(), kMostCandidates); ++k) {
          const Candidate& candidate = cameras[c][k];
          if (std::abs(candidate.u_px - here.u_px) <
              reach + 1.0 + options_.gate_sigmas * candidate.s_px) {
            near_[c] |= static_cast<std::uint8_t>(1U << k);
          }
        }
      }
    }
  }
  const auto each = [&](std::size_t c, const auto& then) {
    for (std::size_t k = 0; k < Choices(cameras, c); ++k) {
      if (!Choose(cameras, c, k)) continue;
      then();
      Unchoose(c);
    }
  };
  // Every set of readings is named by its first three.
  for (std::size_t i = 0; i + 2 < n; ++i) {
    for (std::size_t j = i + 1; j + 1 < n; ++j) {
      for (std::size_t k = j + 1; k < n; ++k) {
        each(i, [&] {
          each(j, [&] {
            each(k, [&] {
              const PointSolution three = triangulator_.Solve(u_, s_, start);
              if (three.outcome == PointOutcome::kSolved) {
                Extend(cameras, k + 1, three, miss, 3, out);
              }
            });
          });
        });
      }
    }
  }
}

void Associator::Search(std::span<const Mark> marks, std::size_t depth, double score) {
  if (depth == marks.size()) {
    best_ = std::max(best_, score);
    sets_.push_back({score, choice_});
    return;
  }
  if (score + best_rest_[depth] < best_ - kLost) return;
  const std::vector<Hypothesis>& list = lists_[depth];
  for (int h = 0; h <= static_cast<int>(list.size()); ++h) {
    if (++visited_ > kMostVisited) return;
    const bool none = h == static_cast<int>(list.size());
    const double gain = none ? none_[depth] : list[static_cast<std::size_t>(h)].weighed;
    const double rest = depth + 1 < marks.size() ? best_rest_[depth + 1] : 0.0;
    if (score + gain + rest < best_ - kLost) {
      if (none) return;
      continue;  // "not seen" may still be better
    }
    if (none) {
      choice_[depth] = -1;
      Search(marks, depth + 1, score + gain);
      continue;
    }
    const Hypothesis& at = list[static_cast<std::size_t>(h)];
    // A spot is one mark's alone, or is shared by some that are expected there.
    bool free = true;
    const Sets taken = taken_, shared = shared_;
    for (std::size_t c = 0; c < u_.size() && free; ++c) {
      if (at.chosen[c] < 0) continue;
      const bool merged = at.chosen[c] == kMerged;
      const auto bit = static_cast<std::uint8_t>(
          1U << (merged ? marks[depth].merged_spot[c] : static_cast<unsigned>(at.chosen[c])));
      free = (taken_[c] & bit) == 0 && (merged || (shared_[c] & bit) == 0);
      (merged ? shared_[c] : taken_[c]) |= bit;
    }
    // Marks of which nothing is known: their points ascend in x, so that no set counts twice.
    for (std::size_t m = depth; free && !marks[depth].known && m-- > 0;) {
      if (marks[m].known) continue;
      free = choice_[m] >= 0 &&
             lists_[m][static_cast<std::size_t>(choice_[m])].point.p.x() < at.point.p.x();
      break;
    }
    if (free) {
      choice_[depth] = h;
      Search(marks, depth + 1, score + gain);
    }
    taken_ = taken;
    shared_ = shared;
  }
}

void Associator::Conclude(std::span<const Mark> marks, std::vector<Association>* out) const {
  constexpr double kSameSigmas = 3.0;
  constexpr double kSame = 5e-5;  // points as near as this are no alternatives [m]
  const auto best = std::max_element(sets_.begin(), sets_.end(),
                                     [](const Set& a, const Set& b) { return a.score < b.score; });
  double total = 0.0;
  for (const Set& set : sets_) total += std::exp(set.score - best->score);
  // Places give names only where every one of them is there.
  bool named = true;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    named = named && (marks[m].known || best->choice[m] >= 0);
  }
  for (std::size_t m = 0; m < marks.size(); ++m) {
    Association& mine = (*out)[m];
    mine = {};
    mine.chosen.fill(-1);
    const int choice = best->choice[m];
    double agree = 0.0;
    for (const Set& set : sets_) {
      const int other = set.choice[m];
      bool same = other == choice;
      if (!same && other >= 0 && choice >= 0) {
        const PointSolution& a = lists_[m][static_cast<std::size_t>(choice)].point;
        const PointSolution& b = lists_[m][static_cast<std::size_t>(other)].point;
        same = (a.p - b.p).norm() < kSame + kSameSigmas * std::sqrt(a.cov.trace() + b.cov.trace());
      }
      if (same) agree += std::exp(set.score - best->score);
    }
    mine.certainty = agree / total;
    if (choice < 0) {
      mine.point.outcome = lists_[m].empty() ? PointOutcome::kTooFew : PointOutcome::kAmbiguous;
      continue;
    }
    const Hypothesis& h = lists_[m][static_cast<std::size_t>(choice)];
    mine.point = h.point;
    mine.chosen = h.chosen;
    const bool certain =
        mine.certainty >= options_.certainty && (marks[m].known || named || marks.size() == 1);
    if (!certain) mine.point.outcome = PointOutcome::kAmbiguous;
  }
}

void Associator::Associate(std::span<const std::span<const Candidate>> cameras,
                           std::span<const Mark> marks, std::span<const double> miss,
                           std::vector<Association>* out) {
  lists_.resize(marks.size());
  none_.assign(marks.size(), 0.0);
  best_rest_.assign(marks.size(), 0.0);
  choice_.assign(marks.size(), -1);
  out->resize(marks.size());
  sets_.clear();
  taken_.fill(0);
  shared_.fill(0);
  visited_ = 0;
  best_ = -std::numeric_limits<double>::infinity();
  double unseen = 0.0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    unseen += std::log(miss.empty() ? options_.miss : miss[c]);
  }
  int unknown = -1;  // all of them have the same list
  for (std::size_t m = 0; m < marks.size(); ++m) {
    if (!marks[m].known && unknown >= 0) {
      lists_[m] = lists_[static_cast<std::size_t>(unknown)];
    } else {
      Enumerate(cameras, marks[m].known ? &marks[m] : nullptr, miss, &lists_[m]);
      if (!marks[m].known) unknown = static_cast<int>(m);
    }
    for (Hypothesis& h : lists_[m]) {
      h.weighed = h.score + (marks[m].known ? LogDensity(marks[m].expected, h.point.p, h.point.cov)
                                            : -log_volume_);
    }
    std::stable_sort(
        lists_[m].begin(), lists_[m].end(),
        [](const Hypothesis& a, const Hypothesis& b) { return a.weighed > b.weighed; });
    if (lists_[m].size() > kMostPoints) lists_[m].resize(kMostPoints);
    none_[m] = unseen;
  }
  for (std::size_t m = marks.size(); m-- > 0;) {
    const double mine = lists_[m].empty() ? none_[m] : std::max(none_[m], lists_[m][0].weighed);
    best_rest_[m] = mine + (m + 1 < marks.size() ? best_rest_[m + 1] : 0.0);
  }
  Search(marks, 0, 0.0);
  if (visited_ > kMostVisited || sets_.empty()) {
    for (Association& association : *out) {
      association = {};
      association.chosen.fill(-1);
      association.point.outcome = PointOutcome::kAmbiguous;
    }
    return;
  }
  Conclude(marks, out);
}

}  // namespace unfurl::measure
