#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "correlate/design/planned_record.h"
#include "correlate/design/standard_errors.h"

namespace unfurl::correlate {

/// What of a PlannedContent is recorded.
struct Choice {
  std::vector<std::vector<int>> slots;  ///< by mark: in which slots it is lit, ascending
  std::vector<bool> instruments;        ///< channels, then switches: it is recorded
};

/// A fit's trial, in whose manner others are planned. All must outlive what is planned.
struct PlanBasis {
  const FitProblem* problem = nullptr;
  const FitResult* fit = nullptr;
  const FitOptions* options = nullptr;
  std::size_t trial = 0;
};

/// A trial that has not been recorded: what each part of it would tell of the parameters, frame,
/// clock, instruments and the calibration's draw being unknown in it. Differences about the fit's
/// values, noise as the fit found it.
class PlannedTrial {
 public:
  /// `model`: with the marks and quantities of the content. `weight`: of every row's information,
  /// where the content has only one of so many lines [-]. Throws Error where the model fails.
  PlannedTrial(const PlanBasis& basis, const Model& model, const PlannedContent& content,
               double weight = 1.0);

  /// Normal matrix of [parameters, nuisances] of what is chosen, what is known of the nuisances
  /// beforehand included, of the parameters not.
  Eigen::MatrixXd Normal(const Choice& choice) const;
  Eigen::Index nuisances() const { return rows_.cols() - parameters_; }  ///< how many
  /// Of these the last are of the calibration's draw.
  Eigen::Index draws() const { return record_.shared_rank; }

 private:
  Eigen::MatrixXd MarkRows(std::size_t mark, const std::vector<int>& slots) const;
  Eigen::MatrixXd InstrumentRows(std::size_t instrument) const;

  Observations record_;
  std::vector<std::vector<int>> slot_;  // by mark and sample
  SeriesNoise noise_;                   // by axis of the marks, then of the channels
  std::vector<double> step_;            // by mark: to which its noise's rho belongs [s]
  std::vector<double> usable_;          // by mark: part of its samples that is expected to be found
  std::size_t channels_ = 0, instruments_ = 0;
  double weight_ = 1.0;
  Eigen::Index parameters_ = 0;
  Eigen::MatrixXd rows_;   // whitened by the samples' covariances: [parameters, nuisances]
  Eigen::MatrixXd fixed_;  // normal matrix of priors and events
  mutable std::map<std::pair<std::size_t, std::vector<int>>, Eigen::MatrixXd> known_;
};

/// Normal matrix of what a fit has: [parameters, nuisances of its trials], priors included.
Eigen::MatrixXd NormalOf(const FitResult& fit);

/// Standard errors of the parameters by a planned trial. `together`: with what the fit has; else
/// by the planned one and the parameters' priors alone.
Eigen::VectorXd PlannedErrors(const PlanBasis& basis, const PlannedTrial& plan,
                              const Choice& choice, bool together);

}  // namespace unfurl::correlate
