#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "campaign/statistics/least_of_planes.h"

namespace unfurl::campaign {

/// A function of normal scores fitted to margins: a polynomial, linear, with squares or with all
/// products; one such for each region of failures (the points nearest to its centre); or the least
/// of several linear ones; whichever has the least leave-one-out error near margin zero.
class MarginSurrogate {
 public:
  /// Of `points` (one a column) with their margins; those with margin <= `near` decide. `centres`:
  /// of regions, one a column. None where points are fewer than three for each coefficient of a
  /// linear one.
  static std::optional<MarginSurrogate> Fit(const Eigen::MatrixXd& points,
                                            std::span<const double> margins, double near,
                                            const Eigen::MatrixXd& centres);

  double Margin(const Eigen::VectorXd& z) const;
  double error() const { return error_; }  // root mean square of leave-one-out residuals, near zero

 private:
  void TryRegions(const Eigen::MatrixXd& points, const Eigen::VectorXd& margins, double near,
                  const Eigen::MatrixXd& centres);

  struct Piece {
    int degree = 1;  // 1: linear, 2: and squares, 3: and products
    Eigen::VectorXd coefficients;
  };

  Eigen::MatrixXd centres_;  // one a column
  std::vector<Piece> pieces_;
  std::optional<LeastOfPlanes> planes_;  // in the place of pieces
  double error_ = 0.0;
};

/// The scores' distribution weighted by a surrogate's probability of failure h(z) =
/// Phi(-margin(z) / width): a proposal for importance sampling that many inputs do not spoil
/// [Dubourg, Sudret and Deheeger 2013]. The width is twice the surrogate's error, so that weights
/// 1 / h of failures which the surrogate misses do not decide the estimate.
class SurrogateProposal {
 public:
  /// `draws` points, from subset simulations of the surrogate with `evaluations` of it a level in
  /// all, which cost no run of the model. None where it finds no failures.
  static std::optional<SurrogateProposal> Make(MarginSurrogate surrogate, int dimensions, int draws,
                                               int evaluations, std::uint64_t seed);

  const Eigen::MatrixXd& draws() const { return draws_; }  // one a column
  /// Its density over that of the scores.
  double Ratio(const Eigen::VectorXd& z) const;
  double variation() const { return variation_; }  // of its normalisation [-]
  /// Replicates whose scatter that is: its degrees of freedom are one less.
  static constexpr int kReplicates = 10;

 private:
  explicit SurrogateProposal(MarginSurrogate surrogate) : surrogate_(std::move(surrogate)) {}

  MarginSurrogate surrogate_;
  Eigen::MatrixXd draws_;
  double width_ = 0.0, mass_ = 1.0, variation_ = 0.0;
};

}  // namespace unfurl::campaign
