#pragma once

#include <string>
#include <vector>

#include "data/tracks.h"

namespace unfurl::measure {

struct SmoothOptions {
  // When something kicks the marks [s, on the record's own clock]: there velocity and acceleration
  // start anew and position goes on, so that a kick is not rounded off. Ascending.
  std::vector<double> events;
  // How well those times are known [s]: within so much of one, any sample may already be after it.
  double event_sigma = 0.0;
  // A pause longer than this starts a new stretch: what is missing is not made up [s]. 0: twenty
  // times the median interval between samples of a mark.
  double longest_gap = 0.0;
  // Spectral density of the white jerk [m^2/s^5]; 0: by maximum likelihood, for each mark and each
  // section between events or gaps.
  double jerk = 0.0;
};

// A stretch that was smoothed with one process noise.
struct SmoothSection {
  int mark = 0;
  double from = 0.0, to = 0.0;  // [s]
  std::size_t samples = 0;
  double jerk = 0.0;  // spectral density [m^2/s^5]
  double chi_square =
      0.0;  // of the innovations, per degree of freedom: 1 where model and noise fit
};

struct SmoothReport {
  std::vector<SmoothSection> sections;
  std::vector<double> events;  // that fell into the record [s]
};

// Median interval between usable samples of a mark; 0 where no mark has two [s].
double IntervalOf(const data::Tracks& tracks);

// Rauch, Tung and Striebel's smoother, mark by mark: position, velocity and acceleration driven by
// white jerk, each usable sample with its own covariance and time stamp (continuous-discrete Kalman
// filter forward, RTS backward). The shared factor is put through the same gains, for it moves
// positions linearly. Samples keep their stamps and statuses; unsolvable ones stay unsolvable. What
// comes back is `smoothed`: its errors are correlated in time, and `cov` is that of each sample
// alone.
data::Tracks Smooth(const data::Tracks& tracks, const SmoothOptions& options = {},
                    SmoothReport* report = nullptr);

}  // namespace unfurl::measure
