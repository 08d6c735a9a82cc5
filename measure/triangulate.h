#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "data/rig.h"
#include "data/tracks.h"
#include "measure/camera_bank.h"

namespace unfurl::measure {

/// When readings give a point.
struct TriangulateOptions {
  // Throws Error that names a value which makes no sense.
  void Check() const;

  // Chance that four good readings fail the residual test, the calibration's errors included [-].
  double residual_level = 1e-3;
  // Planes count as parallel where a displacement in the direction that they fix least changes the
  // readings this much less than one in the direction that they fix best [-]: planes that meet at
  // 2/25 rad or less, under 5 degrees. A sound layout has 2 to 5.
  double max_condition = 25.0;
  // How far beyond the surveyed box a point is still believed, in sizes of the box [-].
  double volume_margin = 0.5;
  // How far beyond the surveyed box one of two solutions of three readings is as likely as the one
  // inside, in sizes of the box [-].
  double twin_margin = 0.1;
  // Share of the calibration's variance that the reduction of its factor may leave out of what is
  // common to samples, at any point it is made for [-].
  double shared_tolerance = 1e-6;
};

// Why there is no point, or that there is one; in the order of data::SampleReason.
enum class PointOutcome {
  kSolved,
  kTooFew,
  kParallel,
  kOutside,
  kDisagree,
  kTwoFit,
  kAmbiguous,
  kOffPath,
};
inline data::SampleReason ReasonOf(PointOutcome outcome) {
  return static_cast<data::SampleReason>(outcome);
}
const char* Name(PointOutcome outcome);

/// A point, or why there is none.
struct PointSolution {
  PointOutcome outcome = PointOutcome::kTooFew;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();    // in W [m]
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  // of the readings' errors [m^2]
  // With `readings` - 3 degrees of freedom: of the readings' errors, or, where those alone would
  // fail the residual test, of these and the calibration's [-].
  double chi_square = 0.0;
  double dilution = 0.0;      // what one pixel in the worst combination moves the point by [m/px]
  double condition = 0.0;     // as TriangulateOptions::max_condition [-]
  int readings = 0;           // that entered
  std::uint32_t cameras = 0;  // bit c: camera c entered
};

// A point from the surfaces that its readings stand for: weighted least squares by Gauss-Newton,
// each reading weighted by 1 / (s^2 + model_floor^2). Readings that leave more than their own
// errors make are held against what the calibration's errors do to readings, too: such as are
// better than the survey's would else contradict each other wherever a mark goes. Nothing is
// allocated in Solve.
class Triangulator {
 public:
  explicit Triangulator(const data::Rig& rig, const TriangulateOptions& options = {});

  /// Of the rig.
  std::size_t cameras() const { return rig_.cameras.size(); }
  const data::Rig& rig() const { return rig_; }
  Eigen::Vector3d centre() const { return centre_; }  // of the volume: a start that always serves
  double size() const { return size_; }               // of the volume, from corner to corner [m]

  // `u_px`, `s_px` one entry per camera; only those in the bit set `use` and not NaN enter.
  PointSolution Solve(std::span<const double> u_px, std::span<const double> s_px,
                      const Eigen::Vector3d& start, std::uint32_t use = ~0U) const;

  // Three surfaces that bend may meet in a second point, as good as the first. True when there is
  // one in or near the volume, within `twin_margin` of the box or as far out as `point` is; `twin`
  // then gets it. Only for points of three readings.
  bool SecondSolution(std::span<const double> u_px, std::span<const double> s_px,
                      const PointSolution& point, PointSolution* twin) const;
  // Within the surveyed box and `twin_margin` around it.
  bool NearVolume(const Eigen::Vector3d& p) const;

  // Readings less those of the point, NaN for cameras that did not enter; `out` one per camera
  // [px].
  void Residuals(std::span<const double> u_px, const PointSolution& point,
                 std::span<double> out) const;
  // The reading that each camera would have of a point; `u_px` of bank().lanes() entries, NaN where
  // the point is not in front.
  const CameraBank& bank() const { return bank_; }

  // What the calibration's uncertainty does to points: the point's error is F z with z ~ N(0, 1) of
  // `shared_rank` entries, the same z for all points of the rig. `F` is 3 x shared_rank [m]; `s_px`
  // as in Solve. `rest`, when not null, gets the covariance of what the reduction left out: with it
  // the point's own covariance is whole, and only its correlation with other points is cut [m^2].
  int shared_rank() const { return static_cast<int>(rank_); }
  // Covariance of the rig's parameters = factor factor^T, 31 c x r; empty: it is known exactly.
  const Eigen::MatrixXd& rig_factor() const { return whole_; }
  void SharedFactor(const PointSolution& point, std::span<const double> s_px,
                    Eigen::Ref<Eigen::Matrix3Xd> F, Eigen::Matrix3d* rest = nullptr) const;
  // The directions of the rig's uncertainty that move these points (solved ones), strongest first,
  // and as few as leave out no more than `shared_tolerance` at any of them. Before that, the
  // factor is made for the whole volume.
  void ReduceShared(std::span<const PointSolution> points);

 private:
  std::vector<PointSolution> GridOfVolume() const;
  void Weights(std::span<const double> u_px, std::span<const double> s_px, std::uint32_t use,
               double* u, double* w, PointSolution* point) const;
  double ChiSquareWithCalibration(const double* u, const double* w, const PointSolution& point,
                                  double limit) const;
  void FindReadingVariances(std::span<const PointSolution> points);

  data::Rig rig_;
  TriangulateOptions options_;
  Eigen::Vector3d centre_;                // of the rig's volume [m]
  double size_;                           // its diagonal [m]
  Eigen::Vector3d low_, high_;            // where a point is believed [m]
  Eigen::Vector3d near_low_, near_high_;  // where a second solution is as likely as the first [m]
  CameraBank bank_;
  std::vector<double> limit_;  // of chi-square, by degrees of freedom [-]
  // By camera: the variance that the calibration's errors give a reading, nowhere more [px^2].
  std::vector<double> reading_variance_;
  std::size_t parameters_ = 0;  // of a camera, up to the last that is not known
  Eigen::MatrixXd whole_;       // 31 c x r: covariance of the rig = whole whole^T [unit]
  // whole_ turned so that the first `rank_` columns are what is kept; row after row [unit].
  std::vector<double> rows_;
  std::size_t columns_ = 0, rank_ = 0;
};

}  // namespace unfurl::measure
