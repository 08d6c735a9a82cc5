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

  // The estimate of one parameter.
  struct Parameter {
    std::string name, unit;
    std::vector<std::string> keys;              // of the scene
    double start = 0.0, low = 0.0, high = 0.0;  // where the search began; bounds [unit]
    double value = 0.0;                         // estimate [unit]
    double sigma = 0.0;                         // standard error, all parts [unit]
    double sigma_data = 0.0;   // from the samples, residual correlation included [unit]
    double sigma_white = 0.0;  // the same for white residuals [unit]
    double sigma_model = 0.0;  // from the model's own error [unit]
    double sigma_doubt = 0.0;  // of that, what lies to either side of the value [unit]
    double model_shift = 0.0;  // what the finer model would change the value by [unit]
    double kink = 0.0;         // roughness of the differences [-]
    double sigma_alone = 0.0;  // of the data, were all other parameters known [unit]
    double imitated = 0.0;     // share of its effect that frame, offset, calibration imitate [-]
    double low95 = 0.0, high95 = 0.0;            // 95%, all parts [unit]; NaN: open on that side
    double low95_data = 0.0, high95_data = 0.0;  // the data alone [unit]
    double dispersion = 1.0;  // what deviances are divided by before 3.84 ends the interval [-]
    std::string verdict, reason;
    std::vector<std::string> with;  // what it is determined only in combination with
  };
  std::vector<Parameter> parameters;  // p
  Eigen::MatrixXd covariance;         // p x p [product of the units]

  // What was estimated along with the parameters: frame, time offset, calibration.
  struct Nuisance {
    std::string name, unit;
    double value = 0.0, sigma = 0.0;  // estimate and standard error [unit]
    std::int32_t trial = 0;
  };
  std::vector<Nuisance> nuisances;

  // What an instrument recorded beside the marks, and the model at the estimate as it would show
  // it.
  struct Channel {
    std::string name, quantity, unit;
    std::int32_t trial = 0;
    std::vector<double> t;                           // k, on the channel's clock [s]
    std::vector<double> measured, sigma, simulated;  // k [unit]; NaN: the model has none
    // Readings that were found to be gross errors and put aside: stamps as in t [s], and how far
    // each lies from its neighbours' residuals, in sigmas [-].
    std::vector<double> gross_t = {}, gross_sigmas = {};
  };
  std::vector<Channel> channels;

  // Profile likelihoods: a parameter held, all others at their best.
  struct ProfilePoint {
    std::int32_t parameter = 0;
    double deviance = 0.0;  // twice the rise of the cost [-]
    bool settled = false;
    std::vector<double> theta;  // p [units]
  };
  std::vector<ProfilePoint> profiles;

  // The ladder: versions of the model, the lowest first, and the looks at the finest.
  struct Rung {
    std::string name;
    std::int32_t runs = 0;  // evaluations
  };
  std::vector<Rung> rungs;
  // One look at the finest rung.
  struct Round {
    std::int32_t base = 0;      // the rung that led there
    double fine_cost = -1.0;    // half the finest rung's sum of squares there [-]; -1: it failed
    double step = 0.0;          // from the round before, in standard errors [-]; NaN: the first
    double contraction = 0.0;   // that step over the one before it [-]; NaN: none
    bool counted = true;        // the cost fell
    bool slope = false;         // the difference's slope took it in
    std::vector<double> theta;  // p [units]
  };
  std::vector<Round> rounds;

  // Where the search began and ended, best first.
  struct Start {
    std::vector<double> from, to;  // p [units]
    double screened = 0.0;         // mean square of the residuals over the first horizon [-]
    double cost = -1.0;            // half the sum of squares over the whole record [-]; -1: failed
    std::string message;
  };
  std::vector<Start> starts;

  // One run of the model.
  struct Evaluation {
    std::vector<double> theta;  // p [units]
    std::string purpose, message;
    int stage = 0;
    bool failed = false;
    std::int32_t start = -1;  // which of several; -1: not of one
    std::int32_t trial = 0;
    std::int32_t fidelity = 0;  // 0 the model, 1 with a tighter tolerance, 2 with a finer mesh,
                                // 3.. rungs of the ladder above the lowest
    double cost = -1.0;  // half the sum of squares of whitened residuals [-]; -1: not compared
  };
  std::vector<Evaluation> evaluations;

  std::vector<std::string> trials;  // names

  // Noise found in the residuals, series by series: variance ((1 - share) I + share R), R of a
  // first-order Markov process, in units of the samples' own variance.
  struct Noise {
    std::int32_t trial = 0, mark = 0, axis = 0;
    double variance = 1.0, share = 0.0, rho = 0.0;  // rho: correlation of neighbours [-]
  };
  std::vector<Noise> noise;
  // Parts of the record that count less, for the solver's noise there.
  struct LessWeight {
    std::int32_t trial = 0, mark = 0;
    double from = 0.0, to = 0.0;  // on the tracks' clock [s]
    double noise = 0.0;           // of a coordinate [m]
    double weight = 1.0;          // in (0, 1) [-]
  };
  std::vector<LessWeight> less_weight;

  // Samples that were found to be gross errors, and count for next to nothing.
  struct Gross {
    std::int32_t trial = 0, mark = 0;
    double t = 0.0;       // on the tracks' clock [s]
    double sigmas = 0.0;  // RMS of a coordinate, from its neighbours' residuals [-]
  };
  std::vector<Gross> gross;

  // At the estimate, sample by sample (n), in the model's frame.
  std::vector<std::string> marks;
  std::vector<double> t;            // on the tracks' clock [s]
  std::vector<std::int32_t> mark;   // index into marks
  std::vector<std::int32_t> trial;  // index into trials
  Eigen::Matrix3Xd measured;        // 3 x n [m]
  Eigen::Matrix3Xd sigma;           // 3 x n [m]
  Eigen::Matrix3Xd simulated;       // 3 x n [m]
  Eigen::Matrix3Xd model_error;     // 3 x n, or 3 x 0 [m]
  Eigen::Matrix3Xd band;            // 3 x n: standard error of `simulated` by the parameters' [m]

  /// What the trials of a structure whose deployments differ say together, by docs/study.md; empty:
  /// the fit took one value for all. Of a parameter on a logarithmic scale the scatter is that of
  /// the logarithm [-].
  struct Repeat {
    /// Of one parameter.
    struct Parameter {
      bool scatters = true, log = false;
      double scatter = 0.0, scatter_low95 = 0.0, scatter_high95 = 0.0;  // standard deviation [unit]
      double visible = 0.0;  // a scatter that the trials' own errors let be seen [unit]
      double next_low95 = 0.0, next_high95 = 0.0;  // the next trial's value [unit]
      double alike_p = 1.0;                        // of Cochran's Q [-]
    };
    std::vector<Parameter> parameters;  // p
    std::vector<std::string> trials;    // k names, of those that count
    // Each p x k. Of a parameter of one value: the trial's own, NaN in what follows it.
    Eigen::MatrixXd estimate, low95, high95;              // of the trial by itself [unit]
    Eigen::MatrixXd effect, effect_low95, effect_high95;  // and by what the others say [unit]
    Eigen::MatrixXd left_out_p;                           // by the others alone [-]
    Eigen::MatrixXd left_out_log_density;                 // of its estimate [-]
    std::vector<double> unlike_p;  // k: the least of its p, times their number [-]
    double alike_p = 1.0;          // of all parameters [-]
    // The next trial's marks in the model's frame, with 95% intervals, n samples.
    std::vector<std::string> marks;
    std::vector<std::int32_t> mark;      // index into marks
    std::vector<double> t;               // on the model's clock [s]
    Eigen::Matrix3Xd middle, low, high;  // 3 x n [m]
    bool empty() const { return trials.empty(); }
  };
  Repeat repeat;

  // Numbers by name with unit: "chi2_per_dof [1]".
  std::map<std::string, double> checks;
};

inline constexpr char kFitSchema[] = "unfurl/fit";
inline constexpr int kFitVersion = 3;

void WriteFit(const std::string& path, const FitRecord& fit, const Provenance& provenance);
FitRecord ReadFit(const std::string& path);

}  // namespace unfurl::data
