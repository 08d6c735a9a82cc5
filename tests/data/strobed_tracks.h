#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <limits>
#include <string>

#include "data/tracks.h"

namespace unfurl::data {

// Three marks strobed at 200 Hz, 1 ms apart, as reconstructed; sample 7 of the second is missing.
inline Tracks Strobed() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  Tracks tracks;
  tracks.frame = "rig";
  tracks.marks = {"mark1", "mark2", "mark3"};
  tracks.cameras = {"a", "b", "c", "d"};
  constexpr int kFrames = 20;
  tracks.p.resize(3, 3 * kFrames);
  tracks.cov.resize(6, 3 * kFrames);
  tracks.shared.resize(3, 0);
  for (int f = 0; f < kFrames; ++f) {
    for (int m = 0; m < 3; ++m) {
      const Eigen::Index i = 3 * f + m;
      const bool missing = f == 7 && m == 1;
      tracks.t.push_back(0.0005 + 0.005 * f + 0.001 * m);
      tracks.mark.push_back(m);
      tracks.status.push_back(missing  ? SampleStatus::kUnsolvable
                              : m == 2 ? SampleStatus::kThreeCameras
                                       : SampleStatus::kGood);
      tracks.used.push_back(missing ? 0U : m == 2 ? 7U : 15U);
      tracks.left_out.push_back(0);
      tracks.reason.push_back(missing ? SampleReason::kTooFew : SampleReason::kNone);
      tracks.p.col(i) = Eigen::Vector3d(0.1 * m - 1.0, 0.01 * f, 1e-4 * f * m);
      tracks.cov.col(i) << 4e-10, 1e-10, 0.0, 5e-10, -1e-10, 9e-10;
      if (!missing) continue;
      tracks.p.col(i).setConstant(kNan);
      tracks.cov.col(i).setConstant(kNan);
    }
  }
  return tracks;
}

// A file of this process in the tests' folder.
inline std::string ExchangePath(const std::string& ending) {
  return testing::TempDir() + std::to_string(getpid()) + "exchange" + ending;
}

// As `read` gives back what `write` has written to a file of this process.
template <typename Write, typename Read>
Tracks ThereAndBack(const std::string& ending, const Tracks& tracks, Write write, Read read) {
  const std::string path = ExchangePath(ending);
  write(path, tracks);
  Tracks back = read(path, 0.0);
  std::remove(path.c_str());
  return back;
}

}  // namespace unfurl::data
