#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/parameters.h"
#include "calib/tally.h"
#include "data/rig.h"

namespace unfurl::calib {

struct CameraPrior;

/// First of a lens's parameters in a camera's, and how many: f, u0, e and the terms (data/rig.h).
inline constexpr int kFirstOfLens = 6;
inline constexpr int kLensParameters = data::kCameraParameters - kFirstOfLens;

/// A lens as a calibration before knows it: the camera was moved since, not the lens in it.
struct KnownLens {
  data::RigCamera camera;      ///< as it was, and where
  Eigen::MatrixXd covariance;  ///< of all its parameters, 31 x 31; zero rows: held (data/rig.h)

  /// A root of the lens's information: the squared length of root * (lens - camera's) is the
  /// squared distance from it in its sigmas. 1 px^-2 for a term that is held.
  Eigen::MatrixXd Root() const;
};

/// f, u0, e and the terms of a camera.
Eigen::VectorXd LensOf(const data::RigCamera& camera);

/// Of every camera of a rig.
std::vector<KnownLens> KnownLensesOf(const data::Rig& rig);

/// That of a camera by its name; null: it is not among them.
const KnownLens* FindLens(const std::vector<KnownLens>& known, const std::string& camera);

/// That of a camera; Error where it is not among them, has another row than `pixels` (0: not
/// stated), or the calibration before states no uncertainty of it.
const KnownLens& RequireLens(const std::vector<KnownLens>& known, const std::string& camera,
                             int pixels, const std::string& where);

/// The lens in the place of what the prior says of e and the terms.
void KnowLens(const KnownLens& before, CameraPrior* prior);

/// What became of a camera since the calibration that its lens is known from.
struct KnownLensEstimate {
  std::string camera;
  /// Both calibrations are in one frame: `moved` to `turned_sigma` are known, and NaN else.
  bool placed = true;
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();  ///< of its place [m]
  double moved_sigma = 0.0;                         ///< along that, both calibrations' [m]
  /// Of `moved`, both calibrations'. Its length is that of a vector with noise, and longer than the
  /// way that the camera went: the numbers of the vector are not [m^2].
  Eigen::Matrix3d moved_covariance = Eigen::Matrix3d::Zero();
  double turned = 0.0, turned_sigma = 0.0;  ///< [rad]
  /// Of the lens from what was known of it, where it is the same one a chi-square variable.
  double chi_square = 0.0, freedom = 0.0;
  double chance = 1.0;  ///< of that or more
};

/// Of the cameras of `now` that are among the known. Where a camera was is corrected by what is
/// known of its lens now, so that what both calibrations leave open alike drops out. Where they are
/// not in one frame nothing is said of that.
std::vector<KnownLensEstimate> CompareLenses(const std::vector<KnownLens>& known,
                                             const data::Rig& now, bool one_frame = true);

/// How much further from each other cameras stand than in a calibration before.
struct KnownScale {
  double scale = 1.0;  ///< of all their distances, least squares [-]
  double sigma =
      0.0;  ///< of that, were it 1: by how each went by itself, and both calibrations [-]
  double freedom = 0.0;  ///< degrees of freedom of how each went; 0: fewer than three cameras
};
KnownScale CompareScale(const std::vector<KnownLens>& known, const data::Rig& now);

/// Whether each lens is still that, at a chance of `level` for all of them, and where its camera
/// went.
void JudgeLenses(const std::vector<KnownLensEstimate>& lenses, double level, Tally* tally);

}  // namespace unfurl::calib
