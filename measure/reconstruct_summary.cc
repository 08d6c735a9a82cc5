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

constexpr char kTooBright[] =
    "its light fills the pixels of too many cameras: dim its LED or shorten the flash";

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
                    marks[m], all - without, all, *most, data::Name(reason),
                    2 * too_bright[m] > without ? kTooBright : CauseOf(reason)));
  }
  return lost;
}

// Of several that are lit together nobody can say which is missing.
void Reconstructor::CountLight(double t, const Slot& slot, std::span<const Seen> seen) {
  if (slot.marks.size() != 1) return;
  const auto mark = static_cast<std::size_t>(slot.marks[0]);
  UnseenMark &now = unseen_[mark], &longest = summary_.unseen[mark];
  std::size_t read = 0, light = 0, full = 0;
  for (const Seen& one : seen) {
    read += one.count > 0;
    light += one.count > 0 || (one.flags & ~kSpotDim) != 0;
    full += one.count == 0 && (one.flags & kSpotSaturated) != 0;
  }
  summary_.too_bright[mark] += read < 3 && read + full >= 3;
  if (light > 0) {
    if (now.flashes > 0 && longest.to_end) longest.to_end = false;
    now = {};
    return;
  }
  if (now.flashes++ == 0) now.from = t;
  now.until = t;
  now.to_end = true;
  if (now.flashes > longest.flashes) longest = now;
}

int Reconstructor::LightOfDark(std::span<const Spot> spots, std::size_t camera) const {
  for (const Spot& spot : spots) {
    if ((spot.flags & kSpotDim) != 0 || before_[camera].Explain(spot)) continue;
    const int mark = dark_light_[camera].MarkOf(spot);
    if (mark >= 0) return mark;
  }
  return -1;
}

void Reconstructor::CountDark(double t, std::span<const Seen> seen) {
  of_dark_.clear();
  for (const Seen& one : seen) of_dark_.push_back(one.of_dark);
  lit_dark_ = summary_.lit_dark.Add(t, of_dark_);
}

std::vector<std::string> ReconstructSummary::LitDarkLines() const {
  // A light at the place of a mark in most cameras at once is hardly chance; thrice it is none.
  constexpr std::size_t kTimes = 3;
  if (lit_dark.lines < kTimes) return {};
  return {
      fmt::format("{} of {} lines named dark show the light of {}, from {:.4g} s to {:.4g} s: its "
                  "LED stays lit or flashes in their slot, and then perhaps in other marks' lines "
                  "as well: look at its driver and the table of slots",
                  lit_dark.lines, dark_lines, marks[static_cast<std::size_t>(lit_dark.mark())],
                  lit_dark.from, lit_dark.until)};
}

std::vector<std::string> ReconstructSummary::DarkMarks() const {
  // As many as a mark is followed without (MotionOptions::longest_gap). By chance all cameras miss
  // one flash in a thousand at worst, never twenty in a row.
  constexpr std::size_t kFlashes = 20;
  const std::vector<std::string> lost = LostMarks();
  std::vector<std::string> dark;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const UnseenMark& run = unseen[m];
    const bool told = std::any_of(lost.begin(), lost.end(), [&](const std::string& one) {
      return one.starts_with(marks[m] + ":");
    });
    if (told || run.flashes < kFlashes) continue;
    dark.push_back(fmt::format(
        "no camera sees {} from {:.4g} s to {} ({} flashes in a row): its LED is dark, hidden or "
        "out of view",
        marks[m], run.from, run.to_end ? "the end" : fmt::format("{:.4g} s", run.until),
        run.flashes));
  }
  return dark;
}

}  // namespace unfurl::measure
