#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/check.h"
#include "calib/joint_test.h"
#include "calib/observations.h"
#include "calib/parameters.h"
#include "data/rig.h"
#include "measure/camera_model.h"

namespace unfurl::calib {

// What a check's n linear combinations of data are from what the rig predicts, their covariance if
// nothing is wrong, and what anything that is wrong adds to them.
struct CheckDesign {
  Eigen::VectorXd misfit;        // n
  GroupedCovariance covariance;  // a group is a point with readings, or a placement of the bar
  // Of the m readings: which camera of the rig, which point (a bar's end).
  std::vector<int> camera, point;
  std::vector<Effect> by_reading;  // m of one column [1/px]
  Eigen::MatrixXd by_camera;       // n x 31 c, of the rig's parameters
  // Of each surveyed point (k = 3) or placement of the bar (k = 1) [1/m].
  std::vector<Effect> by_point;
  // n x 6: all points moved and turned against the rig; n x 1: all lengths [1/m].
  Eigen::MatrixXd by_frame;

  // n x 1 for each camera of the rig: one pixel on all its readings.
  Eigen::MatrixXd Shifts(std::size_t cameras) const;
};

// Cameras of the data, as the rig numbers them. Throws Error for one that the rig does not have.
std::vector<std::size_t> MatchCameras(const data::Rig& rig, const Observations& data,
                                      const std::string& where);

// Of a reading by that camera of the rig, floor included [px^2].
double ReadingVariance(const data::Rig& rig, std::size_t camera, double s_px);

// What the rig's uncertain parameters do to misfits, n x 19 c of their factor: by_camera F with F
// F^T the calibration's covariance.
Eigen::MatrixXd SharedByRig(const data::Rig& rig, const Eigen::MatrixXd& by_camera);

// Readings less what the rig predicts at the surveyed places. Throws Error for a point behind a
// camera.
CheckDesign DesignOfPoints(const data::Rig& rig, const Observations& data,
                           const std::vector<std::size_t>& match, const std::string& where);

// A bar's placements, two points each: what their readings and the length say beyond the two
// places, which are free. `start` (3 x points) is where the search for them begins; NaN: not known.
// A placement that its data do not check adds nothing.
CheckDesign DesignOfBar(const data::Rig& rig, const Observations& data,
                        const std::vector<std::size_t>& match, const Bar& bar,
                        const Eigen::Matrix3Xd& start);

// What may be wrong, with its odds.
std::vector<Hypothesis> HypothesesOf(const data::Rig& rig, const CheckDesign& design,
                                     const CheckOptions& options);

// Cameras that were moved, and surveyed points that lie elsewhere, as far as is known.
struct Moved {
  Eigen::VectorXd parameters;  // 31 c, changes in the order of data/rig.h
  Eigen::VectorXd shift_px;    // c, of all readings of each [px]
  Eigen::Matrix3Xd places;     // of the points, from where they were surveyed; none of a bar's [m]

  bool Any() const { return shift_px.any() || parameters.any() || places.any(); }
};
// A point whose cameras would not see it there is left where it is.
Moved MovedBy(const data::Rig& rig, const Observations& data, const std::vector<std::size_t>& match,
              const std::vector<FoundCause>& causes);

// A design by `make`, of a rig and of readings, about cameras and points that were moved so far
// that what it does is no longer linear: the derivatives are those there. What the move does is in
// the misfits.
template <typename Make>
CheckDesign DesignAbout(const Moved& moved, const data::Rig& rig, const Observations& data,
                        const std::vector<std::size_t>& match, const Make& make) {
  data::Rig there = rig;
  Observations back = data;
  for (std::size_t c = 0; c < there.cameras.size(); ++c) {
    there.cameras[c] = measure::Perturbed(
        rig.cameras[c],
        moved.parameters.segment<kParameters>(kParameters * static_cast<Eigen::Index>(c)));
  }
  for (Reading& r : back.readings) {
    r.u_px -= moved.shift_px(static_cast<Eigen::Index>(match[static_cast<std::size_t>(r.camera)]));
  }
  back.p += moved.places;
  CheckDesign out = make(there, back);
  out.misfit += out.by_camera * moved.parameters + out.Shifts(rig.cameras.size()) * moved.shift_px;
  for (Eigen::Index i = 0; i < moved.places.cols(); ++i) {
    if (moved.places.col(i).isZero(0.0)) continue;
    const Effect& place = out.by_point[static_cast<std::size_t>(i)];
    out.misfit.segment(place.first, place.rows.rows()) += place.rows * moved.places.col(i);
  }
  return out;
}

}  // namespace unfurl::calib
