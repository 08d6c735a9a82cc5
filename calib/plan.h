#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "data/lab.h"
#include "data/rig.h"

namespace unfurl::calib {

// Whether a camera sees a place at all.
using Visibility = std::function<bool(std::size_t camera, const Eigen::Vector3d& p)>;

// By the rig's own model: readings between the ends of a row of `pixels`.
Visibility SeenOnRow(const data::Rig& rig, double pixels = 2160.0);

struct MapOptions {
  int columns = 12;  // of x and of y
  int layers = 3;    // of z
  double reading_sigma_px = 0.03;
  // How far the map reaches; the rig's volume where both are equal [m].
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
};

// What a found point's error would be, cell by cell: x fastest, then y, then z.
struct UncertaintyMap {
  Eigen::Vector3d low, high;
  int columns = 0, layers = 0;
  std::vector<double> sigma;           // 3-D, calibration and reading [m]; NaN: not found
  std::vector<double> sigma_readings;  // of the readings alone
  std::vector<int> cameras;            // that see the cell's middle

  Eigen::Vector3d Middle(std::size_t cell) const;
  double Found() const;             // share of the cells
  double Quantile(double p) const;  // of sigma over the cells found; NaN where none is
};

// `without`: a camera that is lost, or -1.
UncertaintyMap MapUncertainty(const data::Rig& rig, const Visibility& sees,
                              const MapOptions& options, int without = -1);

struct PlanOptions {
  int survey_points = 200;
  double reading_sigma_px = 0.03;
  std::uint64_t seed = 1;  // of where the points lie
  CalibrateOptions calibrate;
};

// A laboratory that does not exist yet: its cameras as they are meant to stand, rays through their
// glass to points of the volume, and the calibration of readings and survey without noise but with
// their sigmas: the covariance that a real one would have.
struct Plan {
  data::Rig rig;
  Visibility sees;
  std::vector<WeakDirection> weak;
  std::vector<std::string> advice;
};
Plan PlanLab(const data::Lab& lab, const PlanOptions& options);

}  // namespace unfurl::calib
