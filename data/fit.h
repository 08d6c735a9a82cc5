#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "data/provenance.h"

namespace unfurl::data {

// What a fit found, what it is worth, and every evaluation of the model on the way.
struct FitRecord {
  std::string study;   // its name
  std::string status;  // "converged", ...
  std::string message;
  std::string verdict;  // of the whole, in words
  std::vector<std::string> reasons;

  struct Parameter {
    std::string name, unit;
    std::vector<std::string> keys;  // of the scene
    double start = 0.0, low = 0.0, high = 0.0;
    double value = 0.0;
    double sigma = 0.0;        // standard error, all parts
    double sigma_data = 0.0;   // from the samples, residual correlation included
    double sigma_white = 0.0;  // the same for white residuals
    double sigma_model = 0.0;  // from the model's own error
    double model_shift = 0.0;  // what the finer model would change the value by
    double kink = 0.0;         // roughness of the differences [-]
    std::string verdict, reason;
  };
  std::vector<Parameter> parameters;  // p
  Eigen::MatrixXd covariance;         // p x p, in the products of the units

  struct Nuisance {
    std::string name, unit;
    double value = 0.0, sigma = 0.0;
  };
  std::vector<Nuisance> nuisances;

  struct Evaluation {
    std::vector<double> theta;  // p
    std::string purpose, message;
    int stage = 0;
    bool failed = false;
    double cost = -1.0;  // half the sum of squares of whitened residuals; -1: not compared
  };
  std::vector<Evaluation> evaluations;

  // At the estimate, sample by sample (n), in the model's frame.
  std::vector<std::string> marks;
  std::vector<double> t;           // on the tracks' clock [s]
  std::vector<std::int32_t> mark;  // index into marks
  Eigen::Matrix3Xd measured;       // 3 x n [m]
  Eigen::Matrix3Xd sigma;          // 3 x n [m]
  Eigen::Matrix3Xd simulated;      // 3 x n [m]
  Eigen::Matrix3Xd model_error;    // 3 x n, or 3 x 0 [m]

  // Numbers by name with unit: "chi2_per_dof [1]".
  std::map<std::string, double> checks;
};

inline constexpr char kFitSchema[] = "unfurl/fit";
inline constexpr int kFitVersion = 1;

void WriteFit(const std::string& path, const FitRecord& fit, const Provenance& provenance);
FitRecord ReadFit(const std::string& path);

}  // namespace unfurl::data
