#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "data/survey.h"
#include "data/wand.h"

namespace unfurl::calib {

/// One number that one camera gave for one flash of one mark of the bar.
struct WandReading {
  int pose = 0, mark = 0, camera = 0;
  double u_px = 0.0, s_px = 0.0;  // reading and its standard deviation [px]
  double after = 0.0;             // time of the flash, less the pose's [s]
};

/// Marks on a straight bar at known places, read in many unknown poses by c cameras; and some
/// surveyed points, or none.
struct WandData {
  std::vector<std::string> cameras;   // c
  std::vector<int> pixels;            // c, of each sensor's row; 0, or empty: not stated
  std::vector<double> pitch;          // c, of the pixels [m]; 0, or empty: not stated
  std::vector<std::string> marks;     // m, at least 2
  Eigen::VectorXd place;              // m, of the marks along the bar, the first at 0 [m]
  double place_sigma = 0.0;           // of each but the first, the same in every pose [m]
  std::vector<std::string> poses;     // n, in the order of time
  std::vector<double> time;           // n, ascending, of each pose [s]; all 0 where none is stated
  std::vector<WandReading> readings;  // by pose, then by mark, then by camera
  // Surveyed points with the same cameras in the same order; no points, or as many as there are.
  Observations points;

  int camera_count() const { return static_cast<int>(cameras.size()); }  ///< c
  int mark_count() const { return static_cast<int>(marks.size()); }      ///< m
  int pose_count() const { return static_cast<int>(poses.size()); }      ///< n
  // The marks flash one after another, so that the bar moves between.
  bool Moves() const;
  // Of the bar, from the first mark to the farthest [m].
  double Length() const { return place.maxCoeff() - place.minCoeff(); }
};

/// A bar: where its marks stand along it.
struct WandBar {
  // Distances from the first mark to the others, in the order of their names [m].
  std::vector<double> places;
  double sigma = 0.0;  // standard deviation of each [m]
};
// "0.7501m+-0.0001m", or for more than two marks "0.25m,0.75m+-0.1mm". Throws Error, with `where`,
// for anything else and where it is not said how well the lengths are known.
WandBar ParseBar(const std::string& text, const std::string& where);

// Readings and bar, and surveyed points (none: null) with readings of the same cameras, in any
// order. Poses in the order of time, or of the file where no time is stated. Throws Error, naming
// the file, for other marks than the bar has, cameras that differ, and poses that overlap in time.
WandData MakeWandData(const data::WandReadings& readings, const WandBar& bar,
                      const data::Survey* points, const std::string& where,
                      const std::string& points_where);

// The readings as an Observations of points that nobody surveyed, one for each mark of each pose
// (pose * m + mark): places at the origin, to be filled in. `spread` is their stated sigma [m].
Observations AsPoints(const WandData& data, double spread);

// The same readings as if all marks had flashed at their poses' times: each moved along the line
// through its camera's readings of the mark in the poses before and after. What the bar's
// acceleration does is left.
WandData AtPoseTimes(const WandData& data);

// Poses `keep` (ascending), renumbered, with their readings; all surveyed points.
WandData SelectPoses(const WandData& all, const std::vector<int>& keep);

}  // namespace unfurl::calib
