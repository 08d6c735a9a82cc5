#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "measure/camera_model.h"

namespace unfurl::calib {

/// Functions of the readings and of the surveyed places that no model parameter makes, m of them.
struct Columns {
  Eigen::MatrixXd on_readings;  // n x m [px]; empty: none
  Eigen::MatrixXd on_survey;    // 3 m x points, function by function [m]; empty: none
};

/// The normal equations of a bundle at its least squares, with points eliminated, for testing
/// columns that the fit does not have. Holds references: data and bundle outlive it.
class ScoreTest {
 public:
  ScoreTest(const Observations& data, const std::vector<CameraPrior>& priors,
            const RefinedBundle& bundle);

  /// Whether a reading takes part in the fit.
  bool Uses(std::size_t reading) const { return rows_[reading].used; }

  /// The score V^T W r of m columns V, and what the fit leaves of their information.
  struct Score {
    Eigen::VectorXd value;       // m [1/unit of the columns' coefficients]
    Eigen::MatrixXd covariance;  // of it after the fit, m x m [likewise, squared]
    Eigen::MatrixXd whole;       // the same were cameras and points known [likewise]
    Eigen::MatrixXd on_cameras;  // how a unit of each column moves the fitted cameras [SI, px]
  };
  /// Of these columns, all tested together.
  Score Of(const Columns& columns) const;

  /// By how much the mean squared error of points found with this rig exceeds what it predicts, in
  /// units of the prediction, where the columns take part with coefficients of the second moment
  /// `moment` (m x m) and the rig does not know: the mean over the surveyed places of
  /// tr(C^-1 E moment E^T) / 3, with C the covariance that the rig states there and E (3 x m) what
  /// each column does to the point, through its readings (`at_use`, n x m; empty: they are without
  /// it) and through the fitted cameras (`on_cameras`) [-]. Infinite where no place can be found.
  double RiseOfError(const Eigen::MatrixXd& at_use, const Eigen::MatrixXd& on_cameras,
                     const Eigen::MatrixXd& moment) const;
  /// The same for coefficients z of any size: z^T H z is the rise, H m x m. Empty where no place
  /// can be found.
  Eigen::MatrixXd HarmOf(const Eigen::MatrixXd& at_use, const Eigen::MatrixXd& on_cameras) const;

 private:
  struct Row {
    bool used = false;
    double weight = 0.0;  // [px^-2]
    measure::Projection h;
  };
  Eigen::Matrix3d SurveyInformation(int i) const;

  const Observations& data_;
  const RefinedBundle& bundle_;
  Eigen::MatrixXd covariance_;  // of cameras and common errors [SI, px]
  std::vector<Row> rows_;
  std::vector<Eigen::Matrix3d> inverse_;  // of each point's information, survey included [m^2]
};

}  // namespace unfurl::calib
