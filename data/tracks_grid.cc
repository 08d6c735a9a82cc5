#include "data/tracks_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::data {

TracksGrid GridOf(const Tracks& tracks) {
  constexpr double kOff = 1e-3;  // of the step
  TracksGrid grid;
  const std::size_t marks = tracks.marks.size();
  std::vector<std::vector<std::size_t>> of(marks);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    of[static_cast<std::size_t>(tracks.mark[i])].push_back(i);
  }
  // The step is the usual distance between a mark's samples, refined over the longest record.
  std::vector<double> steps;
  for (const auto& samples : of) {
    for (std::size_t k = 1; k < samples.size(); ++k) {
      steps.push_back(tracks.t[samples[k]] - tracks.t[samples[k - 1]]);
    }
  }
  grid.delay.assign(marks, 0.0);
  grid.sample.resize(marks);
  if (steps.empty()) return grid;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  grid.step = *middle;
  if (!(grid.step > 0.0)) return grid;
  double longest = 0.0;
  for (const auto& samples : of) {
    if (samples.size() < 2) continue;
    const double span = tracks.t[samples.back()] - tracks.t[samples.front()];
    if (span <= longest) continue;
    longest = span;
    grid.step = span / std::round(span / *middle);
  }
  grid.start = std::numeric_limits<double>::infinity();
  for (const auto& samples : of) {
    if (!samples.empty()) grid.start = std::min(grid.start, tracks.t[samples.front()]);
  }
  grid.regular = true;
  for (std::size_t m = 0; m < marks; ++m) {
    if (of[m].empty()) continue;
    const double late = tracks.t[of[m].front()] - grid.start;
    grid.delay[m] = late - grid.step * std::floor(late / grid.step + kOff);
    for (std::size_t i : of[m]) {
      const double at = (tracks.t[i] - grid.start - grid.delay[m]) / grid.step;
      const double frame = std::round(at);
      auto& sample = grid.sample[m];
      const auto index = static_cast<std::size_t>(std::max(frame, 0.0));
      if (std::abs(at - frame) > kOff || frame < 0.0 ||
          (index < sample.size() && sample[index] >= 0)) {
        grid.regular = false;
        return grid;
      }
      if (sample.size() <= index) sample.resize(index + 1, -1);
      sample[index] = static_cast<std::ptrdiff_t>(i);
    }
    grid.frames = std::max(grid.frames, grid.sample[m].size());
  }
  for (auto& sample : grid.sample) sample.resize(grid.frames, -1);
  return grid;
}

}  // namespace unfurl::data
