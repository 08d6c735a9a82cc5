#include "measure/associate.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kLost = 14.0;  // sets whose weight is e^-14 of the best are forgotten
constexpr std::size_t kMostVisited =
    200000;  // sets looked at; beyond, the line counts as ambiguous
// Possible points of a mark that are kept; one that has more, and is not followed, is ambiguous.
constexpr std::size_t kMostPoints = 100;

}  // namespace

Associator::Associator(const Triangulator& triangulator, const AssociateOptions& options)
    : triangulator_(triangulator),
      options_(options),
      u_(triangulator.cameras(), kNone),
      s_(triangulator.cameras(), 1.0),
      seen_(triangulator.cameras() * Motion::Prediction::kMost) {
  const data::Rig& rig = triangulator.rig();
  log_volume_ = std::log(std::max((rig.volume_high - rig.volume_low).prod(), 1e-9));
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
  constexpr double kFar = 5e-3;   // an error as large as this is as bad as any [m]
  const auto best = std::max_element(sets_.begin(), sets_.end(),
                                     [](const Set& a, const Set& b) { return a.score < b.score; });
  const auto of = [&](const Set& set, std::size_t m) -> const Hypothesis* {
    const int choice = set.choice[m];
    return choice < 0 ? nullptr : &lists_[m][static_cast<std::size_t>(choice)];
  };
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
    const Hypothesis* choice = of(*best, m);
    double agree = 0.0, spread = 0.0;
    for (const Set& set : sets_) {
      const Hypothesis* other = of(set, m);
      const double weight = std::exp(set.score - best->score);
      bool same = other == choice;
      if (!same && choice != nullptr) {
        const bool place = other != nullptr || marks[m].known;
        const Eigen::Vector3d p = other != nullptr ? other->point.p : marks[m].expected.Likeliest();
        const double apart = place ? (p - choice->point.p).norm() : 0.0;
        same = other != nullptr &&
               apart < kSame + kSameSigmas *
                                   std::sqrt(choice->point.cov.trace() + other->point.cov.trace());
        spread += weight * std::min(apart * apart, kFar * kFar);
      }
      if (same) agree += weight;
    }
    mine.certainty = agree / total;
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
        spread / total <= options_.spread * mine.point.cov.trace() + kSame * kSame &&
        (marks[m].known || named || marks.size() == 1);
    if (!certain) mine.point.outcome = PointOutcome::kAmbiguous;
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
    for (Hypothesis& h : lists_[m]) {
      if (h.point.readings < 3) continue;
      h.weighed = h.score + (marks[m].known ? LogDensity(marks[m].expected, h.point.p, h.point.cov)
                                            : -log_volume_);
    }
    std::stable_sort(
        lists_[m].begin(), lists_[m].end(),
        [](const Hypothesis& a, const Hypothesis& b) { return a.weighed > b.weighed; });
    if (lists_[m].size() > kMostPoints) {
      cut_[m] = marks[m].known || lists_[m][kMostPoints].weighed > lists_[m][0].weighed - kLost;
      lists_[m].resize(kMostPoints);
    }
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
