// Two marks in one place: the part of ExchangeWatch that looks for names of one LED.
#include <algorithm>
#include <cmath>
#include <limits>

#include "measure/exchanged_marks.h"

namespace unfurl::measure {

namespace {

// Sigmas within which places are one: a sound pair of 16,000 is further apart.
constexpr double kSharedNoise = 4.0;
// The jump, or the way, is so many times longer than places must be near: of each coordinate one
// place in five is as near by chance, of three coordinates one in 125.
constexpr double kSharedReach = 5.0;
// Places in one: a jump may by chance end where another mark is, but not go on there; after one,
// three in a row are one chance in two millions. Without a jump all so far must be, and so many
// that their mean tells two on one body apart that are half a sigma of one place from each other.
constexpr std::size_t kSharedAfterJump = 3, kSharedFromStart = 100;

// Weights of Lagrange's parabola or cubic through places at t0.. [1].
template <std::size_t n>
std::array<double, n> Weights(const std::array<double, n>& times, double t) {
  std::array<double, n> w;
  for (std::size_t i = 0; i < n; ++i) {
    w[i] = 1.0;
    for (std::size_t k = 0; k < n; ++k) {
      if (k != i) w[i] *= (t - times[k]) / (times[i] - times[k]);
    }
  }
  return w;
}

}  // namespace

// From here on `jump.mark` may be another.
void ExchangeWatch::Jumped(const Jump& jump, double reach) {
  const auto m = static_cast<std::size_t>(jump.mark);
  for (std::size_t k = 0; k < courses_.size(); ++k) {
    Together& pair = together_[m * courses_.size() + k];
    pair = {.jumped = true, .after = jump.at[1].t, .from = jump.at[2].t, .reach = reach};
  }
}

// With a new place of `mark` two of it lie after those of others that came before.
void ExchangeWatch::Compare(int mark, const Place& here) {
  Recent& own = recent_[static_cast<std::size_t>(mark)];
  const auto back = [](const Recent& of, std::size_t ago) -> const Place& {
    return of.place[(of.count - ago) % of.place.size()];
  };
  own.place[own.count++ % own.place.size()] = here;
  if (own.count < 4) return;
  const std::array<const Place*, 4> course = {&back(own, 4), &back(own, 3), &back(own, 2), &here};
  for (std::size_t m = 0; m < recent_.size(); ++m) {
    if (static_cast<int>(m) == mark) continue;
    const Recent& other = recent_[m];
    const std::size_t kept = std::min(other.count, other.place.size());
    for (std::size_t ago = kept; ago > 0; --ago) {
      const Place& place = back(other, ago);
      if (place.t < course[1]->t || !(place.t < course[2]->t)) continue;
      Judge(static_cast<int>(m), mark, place, course);
    }
  }
}

// Whether a place of `mark` is on the course of `other` at that time.
void ExchangeWatch::Judge(int mark, int other, const Place& place,
                          const std::array<const Place*, 4>& course) {
  Together& pair =
      together_[static_cast<std::size_t>(mark) * courses_.size() + static_cast<std::size_t>(other)];
  if (pair.apart || (pair.jumped && place.t < pair.from)) return;
  const auto& [a, b, c, d] = course;
  const auto w = Weights<4>({a->t, b->t, c->t, d->t}, place.t);
  const auto before = Weights<3>({a->t, b->t, c->t}, place.t);
  const auto behind = Weights<3>({b->t, c->t, d->t}, place.t);
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), bend = Eigen::Vector3d::Zero();
  double variance = place.sigma * place.sigma;
  for (std::size_t i = 0; i < 4; ++i) {
    at += w[i] * course[i]->p;
    variance += w[i] * w[i] * course[i]->sigma * course[i]->sigma;
    if (i < 3) bend += before[i] * course[i]->p;
    if (i > 0) bend -= behind[i - 1] * course[i]->p;
  }
  // What two parabolas differ by is more than what a cubic leaves out.
  const double slack = bend.norm(), near = kSharedNoise * std::sqrt(variance) + slack;
  const Eigen::Vector3d difference = place.p - at;
  if (!pair.jumped) {
    if (!pair.begun) pair.first = place.p;
    pair.begun = true;
    pair.reach = std::max(pair.reach, (place.p - pair.first).norm());
  }
  if (difference.norm() > near) pair.apart = true;
  if (pair.apart || near * kSharedReach > pair.reach) return;
  ++pair.count;
  pair.sum += difference;
  pair.variance += variance;
  pair.slack += bend;
  if (pair.count < (pair.jumped ? kSharedAfterJump : kSharedFromStart)) return;
  // Marks that are only near each other are told apart by the mean.
  const double known_to = kSharedNoise * std::sqrt(pair.variance) + pair.slack.norm();
  if (pair.sum.norm() > known_to) return;
  pair.apart = true;  // it is told once
  Tell(pair, mark, other, known_to / static_cast<double>(pair.count));
}

// `mark` is where `other` is; once for both where neither has jumped.
void ExchangeWatch::Tell(const Together& pair, int mark, int other, double within) {
  const auto known = [&](const ExchangedMark& one) {
    return one.both && ((one.mark == mark && one.was == other) ||
                        (one.mark == other && one.was == mark && !pair.jumped));
  };
  if (found_.size() >= kKept || std::any_of(found_.begin(), found_.end(), known)) return;
  const double never = -std::numeric_limits<double>::infinity();
  found_.push_back({.mark = mark,
                    .was = other,
                    .after = pair.jumped ? pair.after : never,
                    .from = pair.jumped ? pair.from : never,
                    .both = true,
                    .within = within});
}

}  // namespace unfurl::measure
