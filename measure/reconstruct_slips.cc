// Records whose cameras or lines are named wrongly are refused before they are read.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kStretches = 32, kSlotRounds = 4;  // rounds of slots in each
constexpr std::size_t kLongestStretch = 128;             // of a stretch

// Lines of a stretch, and how many there are.
std::pair<std::size_t, std::size_t> StretchesOf(std::size_t lines, std::size_t slots) {
  const std::size_t length = std::min({kSlotRounds * slots, kLongestStretch, lines});
  return {length, std::min(kStretches, lines / length)};
}

std::vector<bool> DarkOf(const std::vector<std::string>& slots) {
  std::vector<bool> out;
  out.reserve(slots.size());
  for (const std::string& slot : slots) out.push_back(data::MarksOfSlot(slot).empty());
  return out;
}

}  // namespace

void Reconstructor::RefuseCameraSlips(const std::string& path,
                                      std::span<const FlashReadings> flashes) const {
  if (!options_.corrections.empty()) return;  // it was looked at before
  const RecordSlip slip = FindCameraSlip(flashes, triangulator_);
  if (slip.found()) throw Error(slip.what, path, slip.remedy);
}

void Reconstructor::RefuseSlotSlips(const data::TrialReader& trial) {
  if (!options_.corrections.empty() || trial.size() == 0) return;
  const std::vector<bool> dark = DarkOf(header_.slots);
  const std::size_t cameras = header_.cameras.size();
  const auto [length, count] = StretchesOf(trial.size(), slots_.size());
  // What is dark is in question: no line is taken for a background.
  std::vector<Background> none;
  none.reserve(cameras);
  for (std::size_t c = 0; c < cameras; ++c) none.emplace_back(header_.format.Of(c));
  std::vector<NamedLines> stretches;
  data::TrialBlock block;
  for (std::size_t k = 0; k < count; ++k) {
    trial.Read(k * trial.size() / count, length, &block);
    NamedLines& lines = stretches.emplace_back();
    lines.t = block.t.front();
    lines.slot.assign(block.slot.begin(), block.slot.end());
    std::vector<std::vector<float>> flux(cameras, std::vector<float>(block.size(), 0.0F));
    ParallelFor(cameras, options_.workers, [&](std::size_t c) {
      for (std::size_t i = 0; i < block.size(); ++i) {
        Spot brightest;
        if (finders_[c].FindAll(block.Line(header_, i, c), none[c], {&brightest, 1}) > 0) {
          flux[c][i] = static_cast<float>(brightest.flux);
        }
      }
    });
    for (std::size_t i = 0; i < block.size(); ++i) {
      std::vector<double> of_line;
      of_line.reserve(cameras);
      for (const std::vector<float>& of_camera : flux) of_line.push_back(of_camera[i]);
      lines.flux.push_back(static_cast<float>(Median(of_line)));
    }
  }
  const RecordSlip slip = FindSlotSlip(stretches, header_.slots, dark);
  if (slip.found()) throw Error(slip.what, trial.path(), slip.remedy);
}

// Of readings what most cameras that read anything in a stretch see is a light.
void Reconstructor::RefuseSlotSlips(const data::TrialReadings& readings) const {
  if (!options_.corrections.empty()) return;
  const std::vector<bool> dark = DarkOf(header_.slots);
  const auto [length, count] = StretchesOf(readings.size(), slots_.size());
  const std::size_t cameras = readings.cameras.size();
  std::vector<NamedLines> stretches;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t first = k * readings.size() / count;
    NamedLines& lines = stretches.emplace_back();
    lines.t = readings.t[first];
    lines.slot.reserve(length);
    lines.flux.reserve(length);
    std::vector<double> of_camera(cameras, 0.0);
    for (std::size_t i = first; i < first + length; ++i) {
      lines.slot.push_back(readings.slot[i]);
      double seen = 0.0;
      for (std::size_t c = 0; c < cameras; ++c) {
        if (std::isnan(readings.Readings(i, c)[0])) continue;
        of_camera[c] = 1.0;
        seen += 1.0;
      }
      lines.flux.push_back(static_cast<float>(seen));
    }
    const double most = std::accumulate(of_camera.begin(), of_camera.end(), 0.0);
    for (float& seen : lines.flux) seen = 2.0F * seen > static_cast<float>(most) ? 1.0F : 0.0F;
  }
  const RecordSlip slip = FindSlotSlip(stretches, header_.slots, dark);
  if (slip.found()) throw Error(slip.what, readings.path, slip.remedy);
}

}  // namespace unfurl::measure
