// A record that is still being made: what its beginning tells, or another record of its kind.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "measure/reconstruct.h"
#include "measure/record_match.h"
#include "measure/trial_record.h"

namespace unfurl::measure {

namespace {

constexpr double kReconstructLiveNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

Reconstructor::Reconstructor(const LiveBeginning& beginning, const data::Rig& rig,
                             const std::string& rig_path, const ReconstructOptions& options)
    : options_(options),
      header_(beginning.header.cameras.empty() ? HeaderOf(beginning.readings, rig)
                                               : beginning.header),
      triangulator_(rig, options.point) {
  options.Check();
  if (beginning.header.cameras.empty()) {
    BeginReadings(beginning, rig_path);
  } else {
    BeginLines(beginning, rig_path);
  }
  last_line_ = std::numeric_limits<std::size_t>::max();
  evidence_ = HealthEvidence::OfLast(header_.cameras.size(), beginning.evidence_lines);
}

void Reconstructor::BeginLines(const LiveBeginning& beginning, const std::string& rig_path) {
  PrepareLines(beginning.path, rig_path);
  const ReadBlock read = [&](std::size_t first, std::size_t count, data::TrialBlock* block) {
    const auto from = static_cast<std::ptrdiff_t>(first);
    const auto to = static_cast<std::ptrdiff_t>(first + count);
    const auto counts = static_cast<std::ptrdiff_t>(header_.line_counts());
    const data::TrialBlock& all = beginning.lines;
    block->t.assign(all.t.begin() + from, all.t.begin() + to);
    block->slot.assign(all.slot.begin() + from, all.slot.begin() + to);
    block->counts.assign(all.counts.begin() + from * counts, all.counts.begin() + to * counts);
  };
  data::TrialBlock block;
  if (beginning.like == nullptr) {
    PrimeBackgrounds(beginning.path, beginning.lines.size(), read);
    Begin(beginning.path, beginning.lines.size(), LookAt(read, &block));
    return;
  }
  MatchStream({.trial = header_}, beginning.path, triangulator_.rig(), rig_path, beginning.like);
  const data::TrialReader& like = *beginning.like->lines();
  const ReadBlock read_like = [&](std::size_t first, std::size_t count, data::TrialBlock* out) {
    like.Read(first, count, out);
  };
  PrimeBackgrounds(like.path(), like.size(), read_like);
  Begin(beginning.path, like.size(), LookAt(read_like, &block));
  // The other record's light is not this one's.
  for (std::size_t c = 0; c < backgrounds_.size(); ++c) {
    backgrounds_[c] = Background(header_.format.Of(c));
  }
  primed_ = 0;
  PrimeBackgrounds(beginning.path, beginning.lines.size(), read);
}

void Reconstructor::BeginReadings(const LiveBeginning& beginning, const std::string& rig_path) {
  const data::TrialReadings& own = beginning.readings;
  MapCameras(own, rig_path);
  ReadSlots(own.path);
  const data::TrialReadings* look = &own;
  const std::vector<int> mine = column_;
  if (beginning.like != nullptr) {
    data::LiveHeader header{.readings = true, .trial = header_, .pixels = own.pixels};
    header.trial.cameras = own.cameras;
    MatchStream(header, own.path, triangulator_.rig(), rig_path, beginning.like);
    look = beginning.like->readings();
    MapCameras(*look, rig_path);
  }
  std::vector<double> last(layout_.marks.size(), kReconstructLiveNone), intervals;
  FindInterval({look->t, look->slot}, &last, &intervals);
  SetInterval(&intervals);
  Begin(own.path, look->size(), [&](std::size_t first, std::size_t count, std::vector<Seen>* seen) {
    FillSpots(*look, first, count, seen);
    return Lines{std::span(look->t).subspan(first, count),
                 std::span(look->slot).subspan(first, count)};
  });
  column_ = mine;
}

void Reconstructor::Finish(data::Tracks* tracks) {
  lines_decided_ = 0;
  tracker_->Finish();
  Collect();
  HandOut(tracks);
}

void Reconstructor::LeaveOut(std::vector<Correction> corrections) {
  for (const Correction& correction : corrections) {
    const bool widens =
        correction.offset_px == 0.0 && correction.slope == 0.0 && correction.lag == 0;
    if (correction.leave_out || correction.camera < 0 || widens) continue;
    throw Error("a correction of readings comes too late", "LeaveOut",
                "leave the camera out, and correct when the record is whole");
  }
  options_.corrections = std::move(corrections);
}

}  // namespace unfurl::measure
