#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/wand_fit.h"

namespace unfurl::calib {

/// Where the frame of a rig comes from. Nothing: the survey's where it has three points or more
/// that are not on one line; else that in which found points move least with what is not known of
/// the cameras, with axes as the first camera's.
struct WandFrame {
  // Three cameras: the origin at the first one's slit, x towards the second's, y towards the
  // third's.
  std::vector<std::string> cameras;
  // A pose in which the bar hangs plumb, the first mark above: z against gravity; and one that
  // gives the origin (the bar's middle) and x (its bearing, from the first mark). Both or none.
  std::string plumb, origin;
  // Where the cameras were meant to stand and to look; empty: not known. The frame is theirs, as
  // closely as a rigid motion makes it, where nothing else gives it; and it tells the rig from its
  // mirror image.
  struct Planned {
    std::string camera;
    Eigen::Vector3d place, look_at;  // [m]
  };
  std::vector<Planned> layout;
};

/// A found point of the volume, and how it moves with the cameras' parameters.
struct WandGridPoint {
  Eigen::Vector3d p;           // [m]
  Eigen::Matrix3d cov;         // of its readings [m^2]
  Eigen::MatrixXd by_cameras;  // 3 x 31 c [m/unit]
};
// Over the box of the bar's places, where three cameras or more see and fix a point.
std::vector<WandGridPoint> WandGrid(const WandFit& fit, int per_side = 5);
// One point; false where too few cameras see it. `use`: which cameras read it; empty: all.
bool PlaceOf(const WandFit& fit, const Eigen::Vector3d& p, const std::vector<char>& use,
             WandGridPoint* out);

/// Frame and covariance as they are given out.
struct FramedWand {
  Eigen::MatrixXd covariance;  // 31 c x 31 c, of the cameras in that frame
  std::string words;           // where the frame comes from
  bool by_points = false;      // it is the survey's
  bool handed = false;         // it is known that the rig is not the mirror image
};

// Moves the fit there, and its covariance: what the frame's definition takes off is taken off
// (S-transformation). [Baarda 1973; Teunissen 1985] Throws Error for names that do not exist, a
// pose that is not found, and cameras on one line.
FramedWand SetFrame(const WandFrame& frame, const std::string& where, WandFit* fit);

}  // namespace unfurl::calib
