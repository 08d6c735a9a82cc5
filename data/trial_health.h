#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace unfurl::data {

class H5Reader;
class H5Writer;

/// What a trial said of its cameras, as the file of its tracks keeps it: c cameras, n slices of
/// time, f faults.
struct TrialHealth {
  std::string unknown;               ///< why nothing could be told; empty: it was looked at
  bool corrected = false;            ///< readings were put right; else wrong cameras left out
  std::vector<double> t;             ///< n, middles of the slices [s]
  std::vector<std::string> cameras;  ///< c names
  Eigen::MatrixXd offset_px;         ///< n x c, of readings against what others predict [px]
  Eigen::MatrixXd sigma_px;          ///< n x c, its standard deviation by scatter [px]
  Eigen::MatrixXd gain;              ///< n x c, brightness over the trial's median [-]
  Eigen::MatrixXd width_px;          ///< n x c, of spots [px]; all with NaN where nothing tells

  std::vector<std::string> words;     ///< f, what is wrong, in words
  std::vector<std::int32_t> kind;     ///< f: 0 moved, 1 drifting, 2 late
  std::vector<std::int32_t> camera;   ///< f, index into `cameras`
  std::vector<std::int32_t> certain;  ///< f: 1, or 0: it may be another camera
  std::vector<double> from, to;     ///< f, between which it began [s]; -infinity: before the record
  std::vector<double> size, sigma;  ///< f: [px] of a move and of a drift, [lines] of a lag
  std::vector<double> slope, slope_sigma;  ///< f, of a drift [px/s]
  std::vector<double> at;                  ///< f, when a drift has its `size` [s]
};

/// Group /health of a tracks file. Reading throws Error for what contradicts itself.
void WriteTrialHealth(const TrialHealth& health, H5Writer* file);
/// Empty `cameras` where the file has none.
TrialHealth ReadTrialHealth(const std::string& path);

}  // namespace unfurl::data
