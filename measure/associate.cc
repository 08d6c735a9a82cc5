#include "measure/associate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/refuse_option.h"

namespace unfurl::measure {

namespace {

constexpr double kAssociateNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kLost = 14.0;  // sets whose weight is e^-14 of the best are forgotten
constexpr std::size_t kMostVisited =
    200000;  // sets looked at; beyond, the line counts as ambiguous
// Possible points of a mark that are kept; one that has more, and is not followed, is ambiguous.
constexpr std::size_t kMostPoints = 100;
// Points as near as this, over the volume's size, are no alternatives: a hundredth of a pixel or
// two in a row of 2000.
constexpr double kSameShare = 1.3e-5;

}  // namespace

void AssociateOptions::Check() const {
  const RefuseOption refuse("AssociateOptions");
  const auto between = [&](const char* name, double value, double low, double high) {
    if (value > low && value < high) return;
    refuse(name, fmt::format("is not between {:g} and {:g}", low, high),
           "give a number between them");
  };
  constexpr double kAny = std::numeric_limits<double>::infinity();
  between("miss", miss, 0.0, 1.0);
  between("clutter", clutter, 0.0, kAny);
  between("displaced_sigmas", displaced_sigmas, 0.0, kAny);
  between("merge_px", merge_px, 0.0, kAny);
  between("certainty", certainty, 0.0, 1.0);
  between("spread", spread, 0.0, kAny);
  between("gate_sigmas", gate_sigmas, 0.0, kAny);
}

Associator::Associator(const Triangulator& triangulator, const AssociateOptions& options)
    : triangulator_(triangulator),
      options_(options),
      u_(triangulator.cameras(), kAssociateNone),
      s_(triangulator.cameras(), 1.0),
      seen_(triangulator.cameras() * Motion::Prediction::kMost) {
  const data::Rig& rig = triangulator.rig();
  options.Check();
  log_volume_ = std::log((rig.volume_high - rig.volume_low).prod());
  for (const data::RigCamera& camera : rig.cameras) row_px_.push_back(camera.pixels);
}

// Branch and bound over one point, or none, for each mark. `best_rest_` bounds what the marks from
// `depth` on can add; sets whose weight cannot count beside the best are cut off.
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
    const Sets taken = taken_, shared = shared_;
    if (Claim(marks[depth], at) && Ascends(marks, depth, at)) {
      choice_[depth] = h;
      Search(marks, depth + 1, score + gain);
    }
    taken_ = taken;
    shared_ = shared;
  }
}

// A spot is one mark's alone, or is shared by some that are expected there.
bool Associator::Claim(const Mark& mark, const Hypothesis& at) {
  bool free = true;
  for (std::size_t c = 0; c < u_.size() && free; ++c) {
    if (at.chosen[c] < 0) continue;
    const bool merged = at.chosen[c] == kMerged;
    const auto bit = static_cast<std::uint8_t>(
        1U << (merged ? mark.merged_spot[c] : static_cast<unsigned>(at.chosen[c])));
    free = (taken_[c] & bit) == 0 && (merged || (shared_[c] & bit) == 0);
    (merged ? shared_[c] : taken_[c]) |= bit;
  }
  return free;
}

// Marks of which nothing is known: their points ascend in x, so that no set counts twice.
bool Associator::Ascends(std::span<const Mark> marks, std::size_t depth,
                         const Hypothesis& at) const {
  if (marks[depth].known) return true;
  for (std::size_t m = depth; m-- > 0;) {
    if (marks[m].known) continue;
    return choice_[m] >= 0 &&
           lists_[m][static_cast<std::size_t>(choice_[m])].point.p.x() < at.point.p.x();
  }
  return true;
}

// How sure a choice for one mark is: the share of the weight of all sets that agree with it, and
// the variance that the other places which it may have instead would add [m^2].
Associator::Doubt Associator::DoubtOf(std::span<const Mark> marks, std::size_t m,
                                      const Set& best) const {
  // Of their distance: two solutions of one place lie farther apart in 0.3% of cases at most.
  constexpr double kSameSigmas = 3.0;
  // Over the volume's size: an error as large as this is as bad as any (some pixels).
  constexpr double kFarShare = 1.3e-3;
  const double nearest = kSameShare * triangulator_.size(), far = kFarShare * triangulator_.size();
  const Hypothesis* choice = HypothesisOf(best, m);
  Doubt out;
  double total = 0.0, agree = 0.0;
  for (const Set& set : sets_) {
    const Hypothesis* other = HypothesisOf(set, m);
    const double weight = std::exp(set.score - best.score);
    total += weight;
    bool same = other == choice;
    if (!same && choice != nullptr) {
      const bool place = other != nullptr || marks[m].known;
      const Eigen::Vector3d p = other != nullptr ? other->point.p : marks[m].expected.Likeliest();
      const double apart = place ? (p - choice->point.p).norm() : 0.0;
      same = other != nullptr &&
             apart < nearest + kSameSigmas *
                                   std::sqrt(choice->point.cov.trace() + other->point.cov.trace());
      out.spread += weight * std::min(apart * apart, far * far);
    }
    if (same) agree += weight;
  }
  out.certainty = agree / total;
  out.spread /= total;
  return out;
}

void Associator::Conclude(std::span<const Mark> marks, std::vector<Association>* out) const {
  const auto best = std::max_element(sets_.begin(), sets_.end(),
                                     [](const Set& a, const Set& b) { return a.score < b.score; });
  const double nearest = kSameShare * triangulator_.size();
  // Places give names only where every one of them is there.
  bool named = true;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    named = named && (marks[m].known || best->choice[m] >= 0);
  }
  for (std::size_t m = 0; m < marks.size(); ++m) {
    Association& mine = (*out)[m];
    mine = {};
    mine.chosen.fill(-1);
    const Hypothesis* choice = HypothesisOf(*best, m);
    const Doubt doubt = DoubtOf(marks, m, *best);
    mine.certainty = doubt.certainty;
    if (choice == nullptr || choice->point.readings < 3) {
      const bool any = std::any_of(lists_[m].begin(), lists_[m].end(),
                                   [](const Hypothesis& h) { return h.point.readings >= 3; });
      mine.point.outcome = any ? PointOutcome::kAmbiguous : PointOutcome::kTooFew;
      continue;
    }
    mine.point = choice->point;
    mine.chosen = choice->chosen;
    const bool certain =
        (marks[m].followed || !cut_[m]) && mine.certainty >= options_.certainty &&
        doubt.spread <= options_.spread * mine.point.cov.trace() + nearest * nearest &&
        (marks[m].known || named || marks.size() == 1);
    if (!certain) mine.point.outcome = PointOutcome::kAmbiguous;
  }
}

// Adds where the mark is expected to the points' scores, and keeps the best of them.
void Associator::Weigh(const Mark& mark, std::size_t m) {
  std::vector<Hypothesis>& list = lists_[m];
  for (Hypothesis& h : list) {
    if (h.point.readings < 3) continue;
    h.weighed =
        h.score + (mark.known ? LogDensity(mark.expected, h.point.p, h.point.cov) : -log_volume_);
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.weighed > b.weighed; });
  if (list.size() > kMostPoints) {
    cut_[m] = mark.known || list[kMostPoints].weighed > list[0].weighed - kLost;
    list.resize(kMostPoints);
  }
}

void Associator::Associate(std::span<const std::span<const Candidate>> cameras,
                           std::span<const Mark> marks, std::span<const double> miss,
                           std::vector<Association>* out) {
  lists_.resize(marks.size());
  none_.assign(marks.size(), 0.0);
  cut_.assign(marks.size(), false);
  best_rest_.assign(marks.size(), 0.0);
  choice_.assign(marks.size(), -1);
  out->resize(marks.size());
  sets_.clear();
  taken_.fill(0);
  shared_.fill(0);
  visited_ = 0;
  best_ = -std::numeric_limits<double>::infinity();
  lone_ = marks.size() == 1 ? cameras : std::span<const std::span<const Candidate>>();
  int unknown = -1;  // all of them have the same list
  for (std::size_t m = 0; m < marks.size(); ++m) {
    if (!marks[m].known && unknown >= 0) {
      lists_[m] = lists_[static_cast<std::size_t>(unknown)];
    } else {
      Enumerate(cameras, marks[m].known ? &marks[m] : nullptr, miss, &lists_[m]);
      if (!marks[m].known) unknown = static_cast<int>(m);
    }
    Weigh(marks[m], m);
    mark_ = &marks[m];
    none_[m] =
        Unclaimed(marks[m].known ? marks[m].expected.Likeliest() : triangulator_.centre(), 0, miss);
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
