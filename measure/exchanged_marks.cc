#include "measure/exchanged_marks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace unfurl::measure {

namespace {

// A course misses its own continuation by so many times what it misses the other's by, each of
// three coordinates: by chance one jump in 125 does, two at one time one in 15,000.
constexpr double kExchangeFits = 5.0;
constexpr double kExchangeNoise = 8.0;  // sigmas: no noise looks like a jump
constexpr double kExchangeKick = 3.0;   // a jump is longer than so many times what the speeds cover
constexpr double kExchangeWait = 40.0;  // intervals of a mark in which the others' jumps must come

}  // namespace

// The mean of the two speeds carries b to c: exact to third order in the time between.
ExchangeWatch::Miss ExchangeWatch::MissOf(const Place& a, const Place& b, const Place& c,
                                          const Place& d) {
  const double gap = c.t - b.t, before = b.t - a.t, after = d.t - c.t;
  const Eigen::Vector3d speed = 0.5 * ((b.p - a.p) / before + (d.p - c.p) / after);
  const double x = 0.5 * gap / before, y = 0.5 * gap / after;
  return {(c.p - b.p - speed * gap).norm(),
          std::sqrt(x * x * a.sigma * a.sigma + (1.0 + x) * (1.0 + x) * b.sigma * b.sigma +
                    (1.0 + y) * (1.0 + y) * c.sigma * c.sigma + y * y * d.sigma * d.sigma)};
}

// Whether what comes after one jump goes on where another mark's course was broken off.
bool ExchangeWatch::Continues(const Jump& jump, const Jump& other) {
  const auto& [a, b, c, d] = other.at;
  const Place &first = jump.at[2], &second = jump.at[3];
  if (!(first.t > b.t) || jump.mark == other.mark) return false;
  const Miss own = MissOf(jump.at[0], jump.at[1], first, second);
  const Miss cross = MissOf(a, b, first, second);
  return cross.distance * kExchangeFits < own.distance;
}

void ExchangeWatch::Add(double t, int mark, const Eigen::Vector3d& p, double sigma) {
  Course& course = courses_[static_cast<std::size_t>(mark)];
  const Place here{t, sigma, p};
  if (course.count == course.last.size()) {
    const auto& [a, b, c] = course.last;
    const Miss miss = MissOf(a, b, c, here);
    const double way = 0.5 * ((b.p - a.p).norm() / (b.t - a.t) + (p - c.p).norm() / (t - c.t));
    if (miss.distance > kExchangeNoise * miss.sigma &&
        miss.distance > kExchangeKick * way * (c.t - b.t)) {
      const double since = b.t - kExchangeWait * std::min(b.t - a.t, t - c.t);
      std::erase_if(jumps_, [since](const Jump& one) { return one.at[2].t < since; });
      Jumped({mark, {a, b, c, here}}, miss.distance);
      if (jumps_.size() < kKept) {
        jumps_.push_back({mark, {a, b, c, here}});
        Match();
      }
    }
    std::rotate(course.last.begin(), course.last.begin() + 1, course.last.end());
    course.last.back() = here;
  } else {
    course.last[course.count++] = here;
  }
  Compare(mark, here);
}

// Two that go on where the other was, or more in a ring.
void ExchangeWatch::Match() {
  const std::size_t begin = jumps_.size() - 1;
  std::vector<std::size_t> ring = {begin};
  for (std::size_t at = begin; ring.size() <= jumps_.size();) {
    const auto next = std::find_if(jumps_.begin(), jumps_.end(), [&](const Jump& other) {
      return !other.told && Continues(jumps_[at], other);
    });
    if (next == jumps_.end()) return;
    at = static_cast<std::size_t>(next - jumps_.begin());
    if (at == begin) break;
    if (std::find(ring.begin(), ring.end(), at) != ring.end()) return;
    ring.push_back(at);
  }
  for (std::size_t k = 0; k < ring.size() && found_.size() < kKept; ++k) {
    Jump& jump = jumps_[ring[k]];
    const Jump& other = jumps_[ring[(k + 1) % ring.size()]];
    found_.push_back({jump.mark, other.mark, jump.at[1].t, jump.at[2].t});
    jump.told = true;
  }
}

namespace {

constexpr std::size_t kExchangesTold = 4;  // a sentence of more is not read

// Those that one sentence can hold, joined.
std::string Told(const std::vector<std::string>& parts) {
  const std::size_t told = std::min(parts.size(), kExchangesTold);
  std::string text = JoinWords({parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(told)});
  if (parts.size() > told) text += fmt::format(", and {} more", parts.size() - told);
  return text;
}

}  // namespace

std::string Describe(std::span<const ExchangedMark> exchanged, std::span<const std::string> marks) {
  std::vector<std::string> changed, both;
  for (const ExchangedMark& one : exchanged) {
    const std::string& mark = marks[static_cast<std::size_t>(one.mark)];
    const std::string& was = marks[static_cast<std::size_t>(one.was)];
    if (!one.both) {
      changed.push_back(fmt::format("{} goes on from {:.5g} s where {} was at {:.5g} s", mark,
                                    one.from, was, one.after));
    } else if (std::isfinite(one.after)) {
      both.push_back(fmt::format("{} is from {:.5g} s on where {} is, to {:.2g} mm", mark, one.from,
                                 was, 1e3 * one.within));
    } else {
      both.push_back(fmt::format("{} is where {} is, to {:.2g} mm, from the first flash on", mark,
                                 was, 1e3 * one.within));
    }
  }
  std::string text;
  if (!changed.empty()) {
    text = fmt::format(
        "marks change their names: {}; the slots name them wrongly from there on, or a line was "
        "lost: name them anew from that line, or reconstruct both parts by themselves",
        Told(changed));
  }
  if (!both.empty()) {
    text += fmt::format(
        "{}two marks in one place: {}, as two LEDs cannot be: one LED is lit in both slots, or the "
        "slots name it twice: look at the wiring and the table of slots",
        text.empty() ? "" : "; ", Told(both));
  }
  return text;
}

}  // namespace unfurl::measure
