// Readings of a recorder in place of lines.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "measure/reconstruct.h"
#include "measure/record_match.h"

namespace unfurl::measure {

namespace {

constexpr double kReconstructReadingsNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

data::TrialHeader Reconstructor::HeaderOf(const data::TrialReadings& readings,
                                          const data::Rig& rig) {
  data::TrialHeader header;
  for (const data::RigCamera& camera : rig.cameras) header.cameras.push_back(camera.name);
  header.slots = readings.slots;
  const double span = readings.size() > 1 ? readings.t.back() - readings.t.front() : 0.0;
  header.line_rate = span > 0.0 ? static_cast<double>(readings.size() - 1) / span : 1.0;
  return header;
}

static_assert(data::kMostReadings == Associator::kMostCandidates);

Reconstructor::Reconstructor(const data::TrialReadings& readings, const data::Rig& rig,
                             const std::string& rig_path, const ReconstructOptions& options)
    : options_(options), header_(HeaderOf(readings, rig)), triangulator_(rig, options.point) {
  options.Check();
  MapCameras(readings, rig_path);
  ReadSlots(readings.path);
  RefuseSlotSlips(readings);
  std::vector<double> last(layout_.marks.size(), kReconstructReadingsNone), intervals;
  FindInterval({readings.t, readings.slot}, &last, &intervals);
  SetInterval(&intervals);
  Begin(readings.path, readings.size(),
        [&](std::size_t first, std::size_t count, std::vector<Seen>* seen) {
          FillSpots(readings, first, count, seen);
          return Lines{std::span(readings.t).subspan(first, count),
                       std::span(readings.slot).subspan(first, count)};
        });
  last_line_ = readings.size();
  evidence_ = HealthEvidence(header_.cameras.size(), last_line_);
}

void Reconstructor::MapCameras(const data::TrialReadings& readings, const std::string& rig_path) {
  column_ = MatchReadings(readings.cameras, readings.pixels, readings.path, triangulator_.rig(),
                          rig_path);
  CheckReadings(readings);
}

void Reconstructor::CheckReadings(const data::TrialReadings& readings) const {
  for (std::size_t of_rig = 0; of_rig < column_.size(); ++of_rig) {
    if (column_[of_rig] < 0) continue;
    const auto c = static_cast<std::size_t>(column_[of_rig]);
    const int pixels = triangulator_.rig().cameras[of_rig].pixels;
    for (std::size_t i = 0; i < readings.size(); ++i) {
      for (const double u : readings.Readings(i, c)) {
        if (std::isnan(u) || (u >= -0.5 && u <= pixels - 0.5)) continue;
        throw Error(fmt::format("camera '{}' reads {} px at {} s, but its row has {} pixels",
                                readings.cameras[c], u, readings.t[i], pixels),
                    readings.path, "give readings in pixels: the first one's centre is at 0");
      }
    }
  }
}

void Reconstructor::FillSpots(const data::TrialReadings& readings, std::size_t first,
                              std::size_t count, std::vector<Seen>* seen) const {
  const std::size_t cameras = column_.size();
  seen->assign(count * cameras, {});
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < cameras; ++c) {
      if (column_[c] < 0) continue;
      auto from = static_cast<std::ptrdiff_t>(first + i);
      for (const Correction& correction : options_.corrections) {
        if (correction.camera != static_cast<int>(c) || !correction.Holds(readings.t[first + i])) {
          continue;
        }
        from += correction.lag;
      }
      if (from < 0 || from >= static_cast<std::ptrdiff_t>(readings.size())) continue;
      const auto flash = static_cast<std::size_t>(from);
      const auto u = readings.Readings(flash, static_cast<std::size_t>(column_[c]));
      const auto s = readings.Sigmas(flash, static_cast<std::size_t>(column_[c]));
      Seen& here = (*seen)[i * cameras + c];
      for (std::size_t k = 0; k < u.size() && !std::isnan(u[k]); ++k) {
        here.spots[here.count++] = {u[k], s[k]};
      }
    }
  }
}

void Reconstructor::Process(const data::TrialReadings& readings, std::size_t first,
                            std::size_t count, data::Tracks* tracks) {
  FillSpots(readings, first, count, &seen_);
  Follow(
      {std::span(readings.t).subspan(first, count), std::span(readings.slot).subspan(first, count)},
      tracks);
}

}  // namespace unfurl::measure
