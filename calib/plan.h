#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/survey.h"

namespace unfurl::calib {

// Whether a camera sees a place at all.
using Visibility = std::function<bool(std::size_t camera, const Eigen::Vector3d& p)>;

// By the rig's own model: readings between the ends of each camera's row.
Visibility SeenOnRow(const data::Rig& rig);

/// Which cells a map has, and of what readings.
struct MapOptions {
  int columns = 12;                // of x and of y
  int layers = 3;                  // of z
  double reading_sigma_px = 0.03;  // [px]
  // How far the map reaches; the rig's volume where both are equal [m].
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
};

// What a found point's error would be, cell by cell: x fastest, then y, then z.
struct UncertaintyMap {
  Eigen::Vector3d low, high;  // [m]
  int columns = 0, layers = 0;
  std::vector<double> sigma;           // 3-D, calibration and reading [m]; NaN: not found
  std::vector<double> sigma_readings;  // of the readings alone [m]
  // Of the found point, calibration and reading; zero where it is not found [m^2].
  std::vector<Eigen::Matrix3d> covariance;
  std::vector<int> cameras;  // that see the cell's middle

  Eigen::Vector3d Middle(std::size_t cell) const;  // [m]
  double Found() const;                            // share of the cells [-]
  double Within(double need) const;  // share of all cells whose error is at most that [-]
  double Quantile(double p) const;   // of sigma over the cells found [m]; NaN where none is
};

// `without`: a camera that is lost, or -1.
UncertaintyMap MapUncertainty(const data::Rig& rig, const Visibility& sees,
                              const MapOptions& options, int without = -1);

/// What a layout is planned for.
struct PlanOptions {
  int survey_points = 200;
  // The places to survey, with covariances and what their station does to all of them; none:
  // `survey_points` at random, as the laboratory's station measures them.
  std::optional<data::Survey> survey;
  std::uint64_t seed = 1;  // of where the points lie
  MapOptions map;          // its reading_sigma_px is also that of the survey
  CalibrateOptions calibrate;
  // Error of a found point that is aimed at [m]; 0: see NeedOf in calib/verdict.h.
  double need = 0.0;
  double usable = 0.5;  // share of the volume that must reach it for the layout to be of use [-]
  double little_lost = 0.9;  // of that share, what must be left for a camera to be spared [-]

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

// A laboratory that does not exist yet: its cameras as they are meant to stand, rays through their
// glass to points of the volume, and the calibration of readings and survey without noise but with
// their sigmas: the covariance that a real one would have.
struct PlannedRig {
  data::Rig rig;
  Visibility sees;
  std::vector<WeakDirection> weak;
  std::vector<std::string> advice;
};
PlannedRig PlanLab(const data::Lab& lab, const PlanOptions& options);
// The same of cameras as a rig has them, by its own model; options.survey is needed.
PlannedRig PlanRig(const data::Rig& rig, const PlanOptions& options);

/// Good: as needed, and without any one camera too; care: usable, with reasons.
enum class PlanVerdict { kGood, kCare, kNotUsable };

// With all cameras, and with each one lost.
struct PlanCase {
  std::string name;  // "all cameras", "without north_east"
  UncertaintyMap map;
};
std::vector<PlanCase> PlanCases(const data::Rig& rig, const Visibility& sees,
                                const MapOptions& options);

/// What a layout is good for.
struct PlanResult {
  PlannedRig planned;
  std::vector<PlanCase> cases;  // the first with all cameras
  double need = 0.0;            // [m]
  PlanVerdict verdict = PlanVerdict::kGood;
  std::string headline;
  std::vector<std::string> reasons;
};

// How well a proposed layout, or a calibrated rig, finds points, and what the loss of a camera
// does. A rig with options.survey: as calibrated anew by that.
PlanResult Plan(const data::Lab& lab, const PlanOptions& options);
PlanResult Plan(const data::Rig& rig, const PlanOptions& options);

}  // namespace unfurl::calib
