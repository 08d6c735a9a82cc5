#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/refine.h"
#include "data/rig.h"

namespace unfurl::calib {

// What went wrong with data that were left out, as far as they tell.
enum class GrossKind {
  kSwappedPoints,    // two points' places, exchanged
  kShiftedLabels,    // a ring of points, each with the next one's place
  kMislabelled,      // the readings belong to another point's place
  kExchangedAxes,    // two coordinates exchanged
  kMirroredAxis,     // one coordinate with the wrong sign
  kAlongOneAxis,     // off along one coordinate alone: a slip of the pen, a height
  kPrismConstant,    // the same distance too long or too short, as the station sees it
  kDisplacedPoint,   // wrong, and none of the above
  kSwappedReadings,  // of two points in one camera
  kSwappedCameras,   // of two cameras at one point
  kMirroredReading,  // counted from the sensor's other end
  kSameOffset,       // several readings of a camera, off by the same
  kWildReading,      // wrong, and none of the above
};
const char* Name(GrossKind kind);

/// One gross error, explained.
struct GrossFinding {
  GrossKind kind = GrossKind::kDisplacedPoint;
  std::vector<int> points;
  int camera = -1;    // of readings; -1: the survey
  double size = 0.0;  // of the error: [m] of a survey's, [px] of a reading's
  std::string text;   // a sentence with the points' ids
  bool sure = true;   // false: at this point another datum may be the wrong one
};

/// What else is known of the survey.
struct ExplainOptions {
  // Where the total station stood, in the survey's frame; NaN: found from the errors themselves,
  // which takes four points or more.
  Eigen::Vector3d station = Eigen::Vector3d::Constant(NAN);  // [m]
  // What places are told from: that much is added to those in words.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // [m]
};

// Explains every reading and surveyed point that the bundle left out, the most telling kinds first;
// a datum has one explanation.
std::vector<GrossFinding> ExplainGross(const Observations& data, const RefinedBundle& bundle,
                                       const ExplainOptions& options);

// A distance that all of `shift` (3 x n: where points are found, less where they were surveyed)
// have along their lines to one station. Needs three points with a known station and four without.
struct RangeOffset {
  bool found = false;
  double offset = 0.0;  // of the true distance over the surveyed one [m]
  double sigma = 0.0;   // [m]
  Eigen::Vector3d station = Eigen::Vector3d::Zero();  // [m]
  std::vector<int> members;                           // indices into the columns
};
RangeOffset FindRangeOffset(const Eigen::Matrix3Xd& p, const Eigen::Matrix3Xd& shift,
                            const std::vector<Eigen::Matrix3d>& cov,
                            const Eigen::Vector3d& station);

// Which prisms' constants differ by it, as words to add to a sentence; empty: none that are known.
std::string PrismsThatDiffer(const RangeOffset& found);

}  // namespace unfurl::calib
