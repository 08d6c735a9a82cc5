#include "calib/wand_exchanged.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "calib/wand_search.h"

namespace unfurl::calib {
namespace {

// Three parallel projections fit exchanged ends as well, as another rig.
constexpr int kFewestCameras = 4;
constexpr int kFewTriples = 2, kFewEnds = 2;  // of the search, see WandGuessOptions
constexpr int kPosesPerFewest = 3;  // times as many as three pinholes need at least: enough to tell

// The same readings, those of two marks by one camera exchanged; a mark keeps the times of its
// flashes.
WandData Exchanged(WandData data, const ExchangedMarks& by) {
  std::map<std::pair<int, int>, double> after;
  for (const WandReading& r : data.readings) after[{r.pose, r.mark}] = r.after;
  for (WandReading& r : data.readings) {
    if (r.camera != by.camera || (r.mark != by.first && r.mark != by.second)) continue;
    r.mark = r.mark == by.first ? by.second : by.first;
    const auto flash = after.find({r.pose, r.mark});
    if (flash != after.end()) r.after = flash->second;
  }
  std::sort(data.readings.begin(), data.readings.end(),
            [](const WandReading& a, const WandReading& b) {
              return std::tie(a.pose, a.mark, a.camera) < std::tie(b.pose, b.mark, b.camera);
            });
  return data;
}

}  // namespace

std::string ExchangedMarks::Words(const WandData& data) const {
  return fmt::format(
      "camera \"{}\" has marks \"{}\" and \"{}\" exchanged in every pose: with its readings of the "
      "two exchanged all cameras fit the bar",
      data.cameras[static_cast<std::size_t>(camera)], data.marks[static_cast<std::size_t>(first)],
      data.marks[static_cast<std::size_t>(second)]);
}

ExchangedMarks FindExchanged(const WandData& data, const WandFitOptions& options,
                             const std::string& where) {
  if (data.camera_count() < kFewestCameras) return {};
  WandFitOptions quick = options;
  // As much of the search as suffices where nothing else is wrong.
  quick.start.rounds = 1;
  quick.start.triples = std::min(options.start.triples, kFewTriples);
  quick.start.ends = std::min(options.start.ends, kFewEnds);
  quick.search_poses = std::min(options.search_poses, kPosesPerFewest * options.start.fewest_poses);
  ExchangedMarks by;
  for (by.camera = 0; by.camera < data.camera_count(); ++by.camera) {
    for (by.first = 0; by.first < data.mark_count(); ++by.first) {
      for (by.second = by.first + 1; by.second < data.mark_count(); ++by.second) {
        try {
          if (SearchWand(AtPoseTimes(Exchanged(data, by)), quick, where).fits) return by;
        } catch (const Error&) {  // nor so
        }
      }
    }
  }
  return {};
}

}  // namespace unfurl::calib
