#include "correlate/residual/held_readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/fixed_number.h"
#include "base/number.h"
#include "base/text.h"

namespace unfurl::correlate {

namespace {

constexpr double kRecords = 100.0;  // in one of which chance makes a run that is taken for held
constexpr double kMostHeld = 0.2;   // of the readings; as of gross ones

// The largest of the steps among the six readings beyond an end of a run, and the step to the run.
bool Jumps(const Eigen::VectorXd& y, Eigen::Index edge, Eigen::Index side) {
  constexpr double kSteps = 2.0;  // twice the motion's own, as of far samples
  constexpr int kBeside = 6;      // readings: a step or two may chance to be small, five do not
  const Eigen::Index next = edge + side;
  if (next < 0 || next >= y.size()) return false;
  double largest = 0.0;
  int steps = 0;
  for (Eigen::Index i = next; steps < kBeside - 1; i += side, ++steps) {
    if (i + side < 0 || i + side >= y.size()) break;
    largest = std::max(largest, std::abs(y(i + side) - y(i)));
  }
  return steps > 0 && std::abs(y(next) - y(edge)) > kSteps * largest;
}

}  // namespace

std::vector<HeldRun> FindHeldRuns(const std::vector<double>& t, const Eigen::VectorXd& y) {
  std::vector<HeldRun> all, out;
  double equal = 0.0;
  for (Eigen::Index i = 0; i < y.size();) {
    Eigen::Index end = i + 1;
    while (end < y.size() && y(end) == y(i)) ++end;
    const auto first = static_cast<std::size_t>(i), count = static_cast<std::size_t>(end - i);
    if (count > 1) all.push_back({first, count, t[first], t[first + count - 1], y(i)});
    equal += static_cast<double>(count) - 1.0;
    i = end;
  }
  const double n = static_cast<double>(y.size());
  double held = 0.0;
  for (const HeldRun& run : all) {
    const double own = static_cast<double>(run.count) - 1.0;
    // Laplace's rule of succession: what was never seen is not impossible.
    const double again = (equal - own + 1.0) / (n - own + 2.0);
    if (n * std::pow(again, own) > 1.0 / kRecords) continue;
    const auto first = static_cast<Eigen::Index>(run.first);
    const Eigen::Index last = first + static_cast<Eigen::Index>(run.count) - 1;
    if (!Jumps(y, first, -1) && !Jumps(y, last, +1)) continue;
    held += static_cast<double>(run.count);
    out.push_back(run);
  }
  if (held > kMostHeld * n) out.clear();
  return out;
}

void LeaveOut(const std::vector<HeldRun>& runs, std::vector<double>* values) {
  if (values->empty()) return;
  for (auto run = runs.rbegin(); run != runs.rend(); ++run) {
    const auto first = values->begin() + static_cast<std::ptrdiff_t>(run->first);
    values->erase(first, first + static_cast<std::ptrdiff_t>(run->count));
  }
}

std::string HeldWords(const std::vector<HeldRun>& runs, const std::string& name,
                      const std::string& unit) {
  constexpr std::size_t kNamed = 5;  // as many as a sentence bears
  std::vector<std::string> each;
  std::size_t count = 0;
  for (const HeldRun& run : runs) {
    count += run.count;
    if (each.size() == kNamed) continue;
    each.push_back(fmt::format("{} to {} s, all {}{}", FixedNumber(run.from), FixedNumber(run.to),
                               Number(run.value, 6), UnitAfter(unit)));
  }
  return fmt::format(
      "The instrument {} dropped out: {} readings in a row that repeat one value and jump to it or "
      "from it ({}{}). They are left out.",
      name, count, runs.size() > kNamed ? "the first from " : "from ", JoinWords(each));
}

}  // namespace unfurl::correlate
