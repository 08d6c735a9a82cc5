#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "measure/reconstruct.h"

namespace unfurl::measure {

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

std::map<std::string, std::size_t> ReconstructSummary::Unsolved() const {
  std::map<std::string, std::size_t> out;
  for (const auto& counts : reasons) {
    for (std::size_t r = 0; r < counts.size(); ++r) {
      if (counts[r] > 0) out[data::Name(static_cast<data::SampleReason>(r))] += counts[r];
    }
  }
  return out;
}

namespace {

// What makes most of a mark's samples fail for a reason, most likely first.
const char* CauseOf(data::SampleReason reason) {
  switch (reason) {
    case data::SampleReason::kTooFew:
      return "its LED is dark, hidden or out of view, or the slots name another mark in its place: "
             "look at --picture";
    case data::SampleReason::kDisagree:
      return "a camera has moved or is late by a line, or the slots are off by one: unfurl check "
             "with some surveyed points shows which";
    case data::SampleReason::kOutside:
      return "the rig's lengths have another unit, its axes another order, or cameras are "
             "exchanged";
    case data::SampleReason::kOffPath:
      return "two marks share its slot, or it is faster than --max-speed";
    default:
      return "the page (--report) shows which cameras see it";
  }
}

}  // namespace

std::vector<std::string> ReconstructSummary::LostMarks() const {
  std::vector<std::string> lost;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const std::size_t all = std::accumulate(status[m].begin(), status[m].end(), std::size_t{0});
    const std::size_t without =
        status[m][static_cast<std::size_t>(data::SampleStatus::kUnsolvable)];
    if (2 * without <= all) continue;
    const auto most = std::max_element(reasons[m].begin(), reasons[m].end());
    const auto reason = static_cast<data::SampleReason>(most - reasons[m].begin());
    lost.push_back(
        fmt::format("{}: {} of {} samples have a position, {} times because of \"{}\"; {}",
                    marks[m], all - without, all, *most, data::Name(reason), CauseOf(reason)));
  }
  return lost;
}

}  // namespace unfurl::measure
