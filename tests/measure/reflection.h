#pragma once

// Reflections as second spots, through glass.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure {

struct ReflectionScore {
  std::size_t samples = 0, second_spots = 0, right = 0, unsolved = 0, silent = 0;
  double worst = 0.0;                  // of what is claimed [m]
  std::vector<double> errors, stated;  // of the same; standard deviations of readings [m]
  void Add(const ReflectionScore& other) {
    samples += other.samples;
    second_spots += other.second_spots;
    right += other.right;
    unsolved += other.unsolved;
    silent += other.silent;
    worst = std::max(worst, other.worst);
  }
  void Print() const {
    std::printf(
        "reflection through glass: %zu samples, %zu second spots, %zu right, %zu unsolved, %zu off "
        "by more than 5 mm, worst %.3f mm\n",
        samples, second_spots, right, unsolved, silent, 1e3 * worst);
  }
};

// The shipped laboratory with a mirror, `duration` seconds of swinging marks: traced through glass
// and painted line by line, reconstructed with a rig that is fitted to what its cameras see
// without the mirror.
inline ReflectionScore Reflected(const data::LabReflection& mirror, double duration,
                                 std::uint64_t seed) {
  data::Lab lab = ShippedLab({"seed=" + std::to_string(seed)});
  data::Rig rig = FitRig(MakeVirtualRig(lab), lab.volume_low, lab.volume_high);
  rig.model_floor_px = 0.008;  // spots, and more than FitCamera leaves
  lab.reflections = {mirror};
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "reflected.h5";
  data::Tracks truth;
  {
    data::TrialWriter writer(path, HeaderOf(lab), {});
    ExposeTrial(lab, SwingingRun(duration), writer, {}, &truth);
    writer.Commit();
  }
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(data::TrialReader(path), rig, {}, &summary);
  std::remove(path.c_str());
  ReflectionScore score;
  score.samples = tracks.size();
  for (const auto& flags : summary.flags) score.second_spots += flags[4];  // kSpotSecond
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) {
      ++score.unsolved;
      continue;
    }
    const auto col = static_cast<Eigen::Index>(i);
    const double error = (tracks.p.col(col) - truth.p.col(col)).norm();
    score.worst = std::max(score.worst, error);
    score.right += error < 1e-3;
    score.errors.push_back(error);
    score.stated.push_back(std::sqrt(tracks.cov(0, col) + tracks.cov(3, col) + tracks.cov(5, col)));
    score.silent += error > 5e-3;
  }
  return score;
}

}  // namespace unfurl::measure
