// Records whose cameras or lines are named wrongly are refused before they are read.
#include <algorithm>

#include "base/error.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

void Reconstructor::RefuseCameraSlips(const std::string& path,
                                      std::span<const FlashReadings> flashes) const {
  if (!options_.corrections.empty()) return;  // it was looked at before
  const RecordSlip slip = FindCameraSlip(flashes, triangulator_);
  if (slip.found()) throw Error(slip.what, path, slip.remedy);
}

void Reconstructor::RefuseSlotSlips(const data::TrialReader& trial) {
  constexpr std::size_t kStretches = 32, kRounds = 4;  // rounds of slots in each
  constexpr std::size_t kMostLines = 128;              // of a stretch
  if (!options_.corrections.empty() || trial.size() == 0) return;
  std::vector<bool> dark;
  for (const Slot& slot : slots_) dark.push_back(slot.marks.empty());
  const std::size_t cameras = header_.cameras.size();
  const std::size_t length = std::min({kRounds * slots_.size(), kMostLines, trial.size()});
  const std::size_t count = std::min(kStretches, trial.size() / length);
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

}  // namespace unfurl::measure
