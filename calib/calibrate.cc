#include "calib/calibrate.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "calib/covariance.h"
#include "calib/held_out.h"
#include "calib/model_floor.h"
#include "calib/verdict.h"

namespace unfurl::calib {
namespace {

// Posterior over prior sigma above which a parameter counts as known from its prior.
constexpr double kPriorDominated = 0.5;

std::vector<WeakParameter> FindWeak(const std::vector<CameraPrior>& priors,
                                    const Eigen::MatrixXd& covariance) {
  std::vector<WeakParameter> out;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const CameraPrior& prior = priors[j];
    const auto first = static_cast<Eigen::Index>(j) * data::kCameraParameters;
    const auto add = [&](const std::string& name, const std::string& unit, double variance,
                         double prior_sigma) {
      const double sigma = std::sqrt(std::max(0.0, variance));
      if (sigma > kPriorDominated * prior_sigma) {
        out.push_back({static_cast<int>(j), name, unit, sigma, prior_sigma});
      }
    };
    add("position along the lens axis", "m",
        prior.axis.dot(covariance.block<3, 3>(first + 3, first + 3) * prior.axis),
        prior.along_sigma);
    add("e", "m", covariance(first + 8, first + 8), prior.e_sigma);
    for (std::size_t k = 0; k < data::kCameraTerms.size(); ++k) {
      const Eigen::Index at = first + 9 + static_cast<Eigen::Index>(k);
      add(data::kCameraTerms[k], "px", covariance(at, at), prior.term_sigma_px[k]);
    }
  }
  return out;
}

std::vector<CameraReport> ReportCameras(const std::vector<CameraGuess>& guesses,
                                        const std::vector<ReadingReport>& readings) {
  std::vector<CameraReport> out;
  for (std::size_t j = 0; j < guesses.size(); ++j) {
    CameraReport camera;
    camera.name = guesses[j].camera.name;
    camera.guess_sigma_px = guesses[j].sigma_px;
    double squares = 0.0;
    for (const ReadingReport& r : readings) {
      if (r.camera != static_cast<int>(j)) continue;
      ++camera.readings;
      if (r.weight < 1.0) {
        ++camera.gross;
      } else {
        squares += r.residual_px * r.residual_px;
      }
    }
    camera.residual_rms_px = std::sqrt(squares / std::max(1, camera.readings - camera.gross));
    out.push_back(camera);
  }
  return out;
}

}  // namespace

Calibration Calibrate(const Observations& data, const CalibrateOptions& options,
                      const std::string& where) {
  if (data.camera_count() < 3) {
    throw Error(fmt::format("the survey has readings of {} cameras", data.camera_count()), where,
                "three cameras or more are needed to find a point");
  }
  const std::vector<CameraGuess> guesses = GuessCameras(data, options.guess, where);
  std::vector<CameraPrior> priors;
  BundleState start;
  start.points = data.p;
  double start_floor_px = 0.0;
  for (const CameraGuess& guess : guesses) {
    priors.push_back(guess.prior);
    start.cameras.push_back(guess.camera);
    start_floor_px = std::max(start_floor_px, 2.0 * guess.sigma_px);
  }
  const FlooredBundle full =
      SolveWithFloor(data, priors, start_floor_px, options.bundle, std::move(start));

  Calibration out;
  out.rig.cameras = full.state.cameras;
  out.rig.model_floor_px = full.floor_px;
  out.rig.covariance = CameraCovariance(full.summary.information);
  // The volume of the points that fit; a gross error of the survey may lie anywhere.
  out.rig.volume_low.setConstant(std::numeric_limits<double>::infinity());
  out.rig.volume_high.setConstant(-std::numeric_limits<double>::infinity());
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    if (full.summary.survey_weight[static_cast<std::size_t>(i)] < 1.0) continue;
    out.rig.volume_low = out.rig.volume_low.cwiseMin(data.p.col(i));
    out.rig.volume_high = out.rig.volume_high.cwiseMax(data.p.col(i));
  }

  CalibrationReport& report = out.report;
  report.ids = data.ids;
  report.converged = full.summary.converged;
  report.chi_square = full.summary.chi_square;
  report.degrees_of_freedom = full.summary.degrees_of_freedom;
  report.survey_weight = full.summary.survey_weight;
  report.survey_shift = full.state.points - data.p;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    report.readings.push_back({r.point, r.camera, r.u_px, full.summary.residual_px[k],
                               std::hypot(r.s_px, full.floor_px), full.summary.reading_weight[k]});
  }
  report.cameras = ReportCameras(guesses, report.readings);
  report.weak = FindWeak(priors, out.rig.covariance);
  HeldOutResult held_out =
      CheckHeldOut(data, priors, full, options.bundle, options.folds, options.workers);
  report.held_out = std::move(held_out.points);
  report.held_out_unsolved = held_out.unsolved;
  Judge(report, data, &out.rig);
  return out;
}

}  // namespace unfurl::calib
