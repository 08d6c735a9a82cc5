#include "correlate/design/strobe.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

namespace unfurl::correlate {

namespace {

// Of a line: a stamp that is farther from the middle of its line belongs to no cycle of lines.
constexpr double kOffLine = 0.25;  // half-way to where it would be nearer to the next line's edge

struct Flash {
  double t = 0.0;
  std::size_t mark = 0;
};

std::vector<Flash> FlashesOf(const Observations& o) {
  std::vector<Flash> all;
  for (std::size_t m = 0; m < o.marks.size(); ++m) {
    for (const double t : o.marks[m].t) all.push_back({t, m});
  }
  std::sort(all.begin(), all.end(), [](const Flash& a, const Flash& b) { return a.t < b.t; });
  return all;
}

// The number of each flash's line, all in one even grid; empty: there is none. `line` gets its
// period, `first` the time of line 0.
std::vector<std::int64_t> NumberLines(const std::vector<Flash>& flashes, double* line,
                                      double* first) {
  std::vector<std::int64_t> number(flashes.size(), 0);
  for (std::size_t i = 1; i < flashes.size(); ++i) {
    number[i] = number[i - 1] + std::llround((flashes[i].t - flashes[i - 1].t) / *line);
  }
  // Least squares of t = first + number * line.
  const auto n = static_cast<double>(flashes.size());
  double mean_t = 0.0, mean_k = 0.0, kk = 0.0, kt = 0.0;
  for (std::size_t i = 0; i < flashes.size(); ++i) {
    mean_t += flashes[i].t / n;
    mean_k += static_cast<double>(number[i]) / n;
  }
  for (std::size_t i = 0; i < flashes.size(); ++i) {
    const double k = static_cast<double>(number[i]) - mean_k;
    kk += k * k;
    kt += k * (flashes[i].t - mean_t);
  }
  if (!(kk > 0.0)) return {};
  *line = kt / kk;
  *first = mean_t - mean_k * *line;
  for (std::size_t i = 0; i < flashes.size(); ++i) {
    const double off = flashes[i].t - *first - static_cast<double>(number[i]) * *line;
    if (std::abs(off) > kOffLine * *line) return {};
  }
  return number;
}

// The mark of each slot for a cycle of `length` lines; none where a slot would have two marks.
std::optional<std::vector<int>> SlotsOf(const std::vector<Flash>& flashes,
                                        const std::vector<std::int64_t>& number,
                                        std::size_t length) {
  std::vector<int> slots(length, -1);
  for (std::size_t i = 0; i < flashes.size(); ++i) {
    int& slot = slots[static_cast<std::size_t>(number[i]) % length];
    const int mark = static_cast<int>(flashes[i].mark);
    if (slot >= 0 && slot != mark) return std::nullopt;
    slot = mark;
  }
  return slots;
}

}  // namespace

int Strobe::SlotAt(double t) const {
  if (!(line > 0.0)) return -1;
  const auto n = static_cast<std::int64_t>(slots.size());
  const std::int64_t k = std::llround((t - first) / line) % n;
  return static_cast<int>(k < 0 ? k + n : k);
}

Strobe FindStrobe(const Observations& o) {
  Strobe out;
  const std::vector<Flash> flashes = FlashesOf(o);
  if (flashes.size() < 3) {
    out.why = "too few samples";
    return out;
  }
  std::vector<double> steps, gaps;
  for (std::size_t i = 1; i < flashes.size(); ++i) {
    const double gap = flashes[i].t - flashes[i - 1].t;
    steps.push_back(gap);
    if (flashes[i].mark != flashes[i - 1].mark) gaps.push_back(gap);
  }
  const std::vector<double>& of = o.marks.size() > 1 && !gaps.empty() ? gaps : steps;
  const double shortest = *std::min_element(of.begin(), of.end());
  if (!(shortest > 1e-9 * (1.0 + std::abs(flashes.back().t)))) {  // rounding of stamps
    out.why = "marks are seen at the same time";
    return out;
  }
  // The mean of all gaps that are the shortest, give or take the stamps' resolution.
  double sum = 0.0, count = 0.0;
  for (const double gap : of) {
    if (gap < (1.0 + kOffLine) * shortest) sum += gap, count += 1.0;
  }
  double line = sum / count, first = 0.0;
  const std::vector<std::int64_t> number = NumberLines(flashes, &line, &first);
  if (number.empty()) {
    out.why = "stamps do not follow one another in even lines";
    return out;
  }
  // The shortest cycle in which every line has its mark. It repeats ten times at least, else a
  // record without any order would show one.
  const auto longest = static_cast<std::size_t>(number.back() / 10);
  for (std::size_t length = 1; length <= longest; ++length) {
    const auto slots = SlotsOf(flashes, number, length);
    if (!slots) continue;
    out.line = line;
    out.first = first;
    for (const int mark : *slots) {
      out.slots.push_back(mark < 0 ? std::string() : o.marks[static_cast<std::size_t>(mark)].name);
    }
    return out;
  }
  out.why = "no cycle of lines repeats";
  return out;
}

}  // namespace unfurl::correlate
