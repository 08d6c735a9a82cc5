#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "calib/bundle.h"
#include "calib/common_error.h"
#include "calib/explain.h"
#include "calib/far_points.h"
#include "calib/initial_guess.h"
#include "calib/known_lens.h"
#include "calib/model_order.h"
#include "calib/observations.h"
#include "calib/open_terms.h"
#include "calib/refine.h"
#include "calib/set_up.h"
#include "calib/trends.h"
#include "calib/verdict_options.h"
#include "calib/weak.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Of every step of a calibration.
struct CalibrateOptions {
  GuessOptions guess;
  BundleOptions bundle;  // of the robust stage
  RefineOptions refine;
  // Index into the orders of the lens model (guess.lens), or one of calib/model_order.h. FitRig
  // takes the one that fits start from for kAutomaticOrder, or the richest where that does not fit.
  int order = kAutomaticOrder;
  OrderOptions choice;
  ExplainOptions explain;
  TrendOptions trends;
  VerdictOptions verdict;
  int folds = 10;           // of the held-out check; at least 2
  std::size_t workers = 0;  // 0: all cores. Changes no result
  // Called between the steps with what is done, 0 to 1; Ctrl-C is heeded there.
  std::function<void(double)> progress;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

// A reading as the fit left it.
struct ReadingReport {
  int point = 0;
  int camera = 0;
  double u_px = 0.0;         // [px]
  double residual_px = 0.0;  // reading less prediction [px]
  double sigma_px = 0.0;     // with the floor [px]
  double weight = 1.0;       // 0: left out as gross [-]
  double redundancy = 0.0;   // share of an error in it that its residual shows [-]
};

/// What a camera's readings came to.
struct CameraReport {
  std::string name;
  int readings = 0;
  int gross = 0;                       // left out
  double residual_rms_px = 0.0;        // of the others [px]
  double floor_px = 0.0;               // its model-error floor [px]
  double low_px = 0.0, high_px = 0.0;  // the part of the sensor that its readings cover [px]
  double guess_sigma_px = 0.0;         // robust scale before the points were free [px]
};

// A surveyed point, left out of the fit of its fold and then found from its readings.
struct HeldOutPoint {
  int point = 0;
  int readings = 0;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();      // found less surveyed [m]
  Eigen::Matrix3d predicted = Eigen::Matrix3d::Zero();  // covariance, the survey's included [m^2]
  double squared = 0.0;                                 // error' predicted^-1 error [-]
};

/// All that a calibration found beside its rig.
struct CalibrationReport {
  std::vector<std::string> ids;  // of the points
  std::vector<CameraReport> cameras;
  std::vector<ReadingReport> readings;
  std::vector<double> survey_weight;   // per point; below 1: left out as gross [-]
  std::vector<HeldOutPoint> held_out;  // of usable points
  int held_out_unsolved = 0;           // points whose readings gave no position
  std::vector<Trend> trends;  // of readings and survey; those that were found make it not good
  std::vector<WeakDirection> weak;
  std::vector<GrossFinding> gross;
  std::vector<FarPoint> far;              // left out beforehand, and not where they were surveyed
  std::vector<std::string> advice;        // on the survey's layout
  int order = 0;                          // index into the lens model's orders, or kOrderByCamera
  std::string lens_model;                 // its name, or one for each camera
  bool order_chosen = false;              // by cross-validation
  std::vector<OrderTrial> orders;         // empty where none were compared
  OpenTerms open_terms;                   // what the order leaves out
  double survey_factor = 1.0;             // on the survey's stated sigmas [-]
  std::vector<CommonEstimate> common;     // those of set-ups too, six each
  std::vector<SetUpEstimate> set_ups;     // of a survey from several, but for the first
  std::vector<KnownLensEstimate> lenses;  // of cameras whose lenses were known before
  double chi_square = 0.0;                // [-]
  double degrees_of_freedom = 0.0;        // [-]
  bool converged = false;
};

/// A rig, and how it came about.
struct Calibration {
  data::Rig rig;  // with checks, verdict and reasons
  CalibrationReport report;
};

// The fit alone: guess per camera, robust bundle, refinement, joint covariance; what Calibrate
// checks and judges, and what a study of many calibrations repeats.
struct RigFit {
  std::vector<CameraGuess> guesses;
  std::vector<CameraPrior> priors;
  int order = 0;  // of the terms that took part
  RefinedBundle bundle;
  data::Rig rig;  // cameras, covariance, floor and volume
};
RigFit FitRig(const Observations& data, const CalibrateOptions& options, const std::string& where);

// From a survey to a rig, without an initial guess: fit, choice of the lens model's order, gross
// errors explained, weak directions, held-out check, verdict. `where` names the survey in errors.
// Throws Error for a survey that cannot determine the cameras (see GuessCameras) or has fewer than
// three cameras.
Calibration Calibrate(const Observations& data, const CalibrateOptions& options,
                      const std::string& where);
}  // namespace unfurl::calib
