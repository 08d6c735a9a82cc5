#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "data/provenance.h"

namespace unfurl::data {

/// Readings of a bar of marks that is moved by hand: f flashes, c cameras. A flash is one mark, lit
/// once in one pose of the bar.
struct WandReadings {
  std::vector<std::string> pose, mark;  // f, names
  std::vector<double> time;             // f [s]; empty: the bar stands still in each pose
  std::vector<std::string> cameras;     // c
  std::vector<int> pixels;              // c, of each camera's row; 0, or empty: not stated
  Eigen::MatrixXd u_px, s_px;           // f x c, readings and standard deviations [px]; NaN: unseen

  std::size_t size() const { return pose.size(); }  ///< f
};

inline constexpr char kWandSchema[] = "unfurl/wand";
inline constexpr int kWandVersion = 1;

// By content: HDF5, or CSV with `pose` and `mark` (or `id`: 12a is mark a of pose 12), `time [s]`
// or not, and either `u1 [px]`, `s1 [px]`, ... with a row for each flash, or `camera`, `u [px]`,
// `s [px]` with a row for each reading; comments `cameras:` and `pixels:` as in a survey. Throws
// Error, with file and line, for a flash or reading that comes twice and for what a survey refuses.
WandReadings ReadWand(const std::string& path);
void WriteWand(const std::string& path, const WandReadings& wand, const Provenance& provenance);
void WriteWandCsv(const std::string& path, const WandReadings& wand);

}  // namespace unfurl::data
