#include "data/tracks_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::data {

namespace {

constexpr double kOff = 1e-3;  // of the step, that a stamp may lie off the grid

using SamplesByMark = std::vector<std::vector<std::size_t>>;

// The usual distance between a mark's samples, refined over the longest record; 0: there is none.
double StepOf(const Tracks& tracks, const SamplesByMark& of) {
  std::vector<double> steps;
  for (const auto& samples : of) {
    for (std::size_t k = 1; k < samples.size(); ++k) {
      steps.push_back(tracks.t[samples[k]] - tracks.t[samples[k - 1]]);
    }
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  double step = *middle;
  if (!(step > 0.0)) return step;
  double longest = 0.0;
  for (const auto& samples : of) {
    if (samples.size() < 2) continue;
    const double span = tracks.t[samples.back()] - tracks.t[samples.front()];
    if (span <= longest) continue;
    longest = span;
    step = span / std::round(span / *middle);
  }
  return step;
}

// Puts a mark's samples into frames; false if they do not lie on the grid.
bool PlaceOnGrid(const Tracks& tracks, const std::vector<std::size_t>& samples, std::size_t m,
                 TracksGrid* grid) {
  const double late = tracks.t[samples.front()] - grid->start;
  grid->delay[m] = late - grid->step * std::floor(late / grid->step + kOff);
  std::vector<std::ptrdiff_t>& sample = grid->sample[m];
  for (std::size_t i : samples) {
    const double at = (tracks.t[i] - grid->start - grid->delay[m]) / grid->step;
    const double frame = std::round(at);
    const auto index = static_cast<std::size_t>(std::max(frame, 0.0));
    if (std::abs(at - frame) > kOff || frame < 0.0 ||
        (index < sample.size() && sample[index] >= 0)) {
      return false;
    }
    if (sample.size() <= index) sample.resize(index + 1, -1);
    sample[index] = static_cast<std::ptrdiff_t>(i);
  }
  return true;
}

}  // namespace

TracksGrid GridOf(const Tracks& tracks) {
  TracksGrid grid;
  const std::size_t marks = tracks.marks.size();
  SamplesByMark of(marks);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    of[static_cast<std::size_t>(tracks.mark[i])].push_back(i);
  }
  grid.delay.assign(marks, 0.0);
  grid.sample.resize(marks);
  const double step = StepOf(tracks, of);
  if (step != 0.0) grid.step = step;
  if (!(step > 0.0)) return grid;
  grid.start = std::numeric_limits<double>::infinity();
  for (const auto& samples : of) {
    if (!samples.empty()) grid.start = std::min(grid.start, tracks.t[samples.front()]);
  }
  for (std::size_t m = 0; m < marks; ++m) {
    if (of[m].empty()) continue;
    if (!PlaceOnGrid(tracks, of[m], m, &grid)) return grid;
    grid.frames = std::max(grid.frames, grid.sample[m].size());
  }
  grid.regular = true;
  for (auto& sample : grid.sample) sample.resize(grid.frames, -1);
  return grid;
}

}  // namespace unfurl::data
