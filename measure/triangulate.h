#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "data/rig.h"

namespace unfurl::measure {

struct TriangulateOptions {
  // Chance that four good readings fail the residual test [-].
  double residual_level = 1e-4;
  // What one pixel in the worst combination of readings may move the point [m/px]. A sound layout
  // has 1 to 3 mm; above this the planes count as parallel.
  double max_dilution = 0.02;
  // How far beyond the surveyed box a point is still believed, in sizes of the box [-].
  double volume_margin = 0.5;
  // Share of the calibration's variance that the reduction of its factor may lose [-].
  double shared_tolerance = 1e-6;
};

// Why there is no point, or that there is one.
enum class PointOutcome {
  kSolved,
  kTooFew,    // fewer than three usable readings
  kParallel,  // their planes are too near to parallel
  kOutside,   // no point in or near the volume explains them
  kDisagree,  // four readings that one point cannot explain: one is wrong, unknown which
};
const char* Name(PointOutcome outcome);

struct PointSolution {
  PointOutcome outcome = PointOutcome::kTooFew;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();    // in W [m]
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  // of the readings' errors [m^2]
  double chi_square = 0.0;                        // with `readings` - 3 degrees of freedom
  double dilution = 0.0;                          // [m/px]
  int readings = 0;                               // that entered
  std::uint32_t cameras = 0;                      // bit c: camera c entered
};

// A point from the surfaces that its readings stand for: weighted least squares by Gauss-Newton,
// each reading weighted by 1 / (s^2 + model_floor^2). Nothing is allocated in Solve.
class Triangulator {
 public:
  explicit Triangulator(const data::Rig& rig, const TriangulateOptions& options = {});

  std::size_t cameras() const { return rig_.cameras.size(); }
  const data::Rig& rig() const { return rig_; }
  Eigen::Vector3d centre() const { return centre_; }  // of the volume: a start that always serves

  // `u_px`, `s_px` one entry per camera; only those in the bit set `use` and not NaN enter.
  PointSolution Solve(std::span<const double> u_px, std::span<const double> s_px,
                      const Eigen::Vector3d& start, std::uint32_t use = ~0U) const;

  // What the calibration's uncertainty does to points: the point's error is F z with z ~ N(0, 1) of
  // `shared_rank` entries, the same z for all points of the rig. `F` is 3 x shared_rank [m]; `s_px`
  // as in Solve.
  int shared_rank() const { return static_cast<int>(factor_.cols()); }
  void SharedFactor(const PointSolution& point, std::span<const double> s_px,
                    Eigen::Ref<Eigen::Matrix3Xd> F) const;

 private:
  void ReduceFactor();

  data::Rig rig_;
  TriangulateOptions options_;
  Eigen::Vector3d centre_;
  Eigen::Vector3d low_, high_;  // where a point is believed
  std::vector<double> limit_;   // of chi-square, by degrees of freedom
  Eigen::MatrixXd factor_;      // 19 c x k: covariance of the rig = factor factor^T, reduced
};

}  // namespace unfurl::measure
