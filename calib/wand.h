#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calib/verdict_options.h"
#include "calib/wand_data.h"
#include "calib/wand_fit.h"
#include "calib/wand_frame.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Of every step of a calibration by a bar.
struct WandOptions {
  WandFitOptions fit;
  WandFrame frame;
  VerdictOptions verdict;
  int folds = 5;            // of the held-out check; at least 2
  std::size_t workers = 0;  // 0: all cores. Changes no result
  // Called between the steps with what is done, 0 to 1; Ctrl-C is heeded there and in every step.
  std::function<void(double)> progress;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

/// A change of shape of the found points that the data leave most open.
struct WandShape {
  std::string name;     // "scale along (0.00, 0.00, 1.00)"
  double sigma = 0.0;   // strain [-]
  double moved = 0.0;   // what one sigma moves points at the volume's edge by [m]
  bool by_bar = false;  // it is the bar's own length that is not known better
};

/// The bar's length between its outer marks, found in a pose that took no part in the fit.
struct WandLength {
  std::string pose;
  double error = 0.0, predicted = 0.0;  // found less stated, its standard deviation [m]
};

/// A camera's part.
struct WandCameraReport {
  std::string name;
  int readings = 0, gross = 0;         // of the bar; left out, with whole poses or alone
  double residual_rms_px = 0.0;        // of the others [px]
  double floor_px = 0.0;               // [px]
  double low_px = 0.0, high_px = 0.0;  // of the row that its readings cover [px]
};

/// All that a calibration by a bar found beside its rig.
struct WandReport {
  std::vector<WandCameraReport> cameras;
  std::vector<std::string> marks;
  Eigen::VectorXd place, place_sigma;   // of the marks along the bar, from the first [m]
  int poses = 0, dropped = 0;           // that took part; that too few cameras saw
  std::vector<std::string> lost_poses;  // that contradict the rest and took no part
  int gross_readings = 0;               // of all poses, the lost ones' among them
  // Of the last poses, when most of them are lost or lost some reading, and chance does not do it:
  // how many they are, of how many that holds, and the first; 0: nothing of the kind.
  int late = 0, late_left_out = 0;
  std::string late_from;
  std::vector<WandRival> rivals;                     // other rigs that explain the readings as well
  std::vector<std::string> gross_points;             // surveyed points that contradict the rest
  int point_readings = 0, gross_point_readings = 0;  // of surveyed points; of these left out
  double chi_square = 0.0, degrees_of_freedom = 0.0;
  bool converged = false;
  std::string frame;              // where it comes from, in words
  bool handed = true;             // false: the rig may be the mirror image of what it states
  std::vector<WandShape> shapes;  // widest first
  std::vector<WandLength> lengths;
  int lengths_unsolved = 0;
  std::vector<KnownLensEstimate> lenses;  // of cameras whose lenses were known before
  KnownScale against_before;              // of their places
  // Of a bar that moves: how far the outer marks' distance is open because of it, and because of
  // the readings, medians over the poses [m]; and its typical speed [m/s].
  double motion_sigma = 0.0, reading_sigma = 0.0, speed = 0.0;
  double distance_sigma = 0.0;  // of the distance of two found points, typical of the volume [m]
};

/// A rig by a bar, and how it came about.
struct WandCalibration {
  data::Rig rig;  // with checks, verdict and reasons
  WandReport report;
  WandFit fit;
};

// From readings of a waved bar, with surveyed points or none, to a rig: first guess from nothing,
// bundle with unknown poses, the frame by words, covariance, held-out lengths, verdict. `where`
// names the readings in errors. Throws Error for data that cannot determine the cameras.
WandCalibration CalibrateWand(const WandData& data, const WandOptions& options,
                              const std::string& where);

}  // namespace unfurl::calib
