#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace unfurl::data {

class H5Reader;
class H5Writer;

/// A change of light or focus, against the record's beginning.
struct TrialLight {
  std::string words;                    ///< what it is
  std::int32_t kind = 0;                ///< 0 LED, 1 gain, 2 focus, 3 all light
  std::int32_t camera = -1, mark = -1;  ///< indices; -1: of all
  std::int32_t certain = 1;             ///< 0: something else explains it as well
  double from = 0.0, to = 0.0;          ///< between which it began [s]
  double until = 0.0;                   ///< when it has its size [s]
  double size = 0.0, sigma = 0.0;       ///< of brightness or width, relative [-]
};

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

  /// Where nothing vouches for the cameras: in words, else empty. And what distances that marks
  /// keep say, empty where nobody named any; whether they are kept.
  std::string unvouched, distances;
  bool distances_kept = true;

  std::vector<std::string> words;     ///< f, what is wrong, in words
  std::vector<std::int32_t> kind;     ///< f: 0 moved, 1 drifting, 2 late
  std::vector<std::int32_t> camera;   ///< f, index into `cameras`
  std::vector<std::int32_t> certain;  ///< f: 1, or 0: it may be another camera
  std::vector<double> from, to;     ///< f, between which it began [s]; -infinity: before the record
  std::vector<double> size, sigma;  ///< f: [px] of a move and of a drift, [lines] of a lag
  std::vector<double> slope, slope_sigma;  ///< f, of a drift [px/s]
  std::vector<double> at;                  ///< f, when a drift has its `size` [s]

  /// How the readings scatter over what is stated: in words; why nothing tells; whether the
  /// tracks' covariances were widened by it; the factor of all readings; by camera where they were
  /// widened, else empty.
  std::string scatter_words, scatter_unknown;
  bool scatter_wide = false;
  double scatter = 0.0, scatter_sigma = 0.0;  ///< 0 where nothing tells [-]
  std::vector<double> camera_scatter, camera_scatter_sigma;
  /// By which the stated sigmas of each mark's readings were multiplied, by camera: marks that are
  /// ever lit alone x c, or empty [-].
  Eigen::MatrixXd mark_scatter;

  /// What readings leave over for flashes on end beyond noise and calibration, by which the tracks'
  /// covariances were widened: in words, empty where there is none; of all, and of each camera's
  /// marks the most [px].
  std::string misfit_words;
  double misfit = 0.0;
  std::vector<double> camera_misfit;

  /// Readings that were left out because they depart from the course of their mark where no other
  /// camera vouches for them: in words, empty where there are none; how many, by camera.
  std::string wrong_words;
  std::vector<std::int32_t> wrong;

  std::vector<std::string> marks;  ///< names
  std::vector<TrialLight> light;   ///< changes of light and focus, in the order of their weight
};

/// Group /health of a tracks file. Reading throws Error for what contradicts itself.
void WriteTrialHealth(const TrialHealth& health, H5Writer* file);
/// Empty `cameras` where the file has none.
TrialHealth ReadTrialHealth(const std::string& path);

}  // namespace unfurl::data
