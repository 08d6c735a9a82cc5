#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "measure/health.h"

namespace unfurl::measure {

// What three flashes of a mark tell: y ~ N(0, sum_c k_c^2 part_c part_c^T).
struct Triple {
  std::size_t mark = 0;
  Eigen::VectorXd y;     // m [px]
  Eigen::MatrixXd part;  // m x C, sqrt(v_c) n_c, 0 of cameras that do not see it [px]
};

// The squared factor of a cell (the readings of one camera of one mark, mark x C + camera), with
// how many independent numbers it was found from (0: none).
struct CellSquare {
  double square = 0.0, numbers = 0.0;  // [-]
};

// Sums over all that is not wild where the squared factors are `theta`.
struct Sums {
  Eigen::VectorXd along;  // by cell: what the scatter is along its component, over what is due
  std::vector<Eigen::MatrixXd> fisher;  // by mark, C x C: twice the information
  double chi_square = 0.0, numbers = 0.0;
};

// Components of variance by maximum likelihood [Fisher's scoring], one to a cell, as factors
// squared of what is stated. What is beyond chance by any factors, wild readings, is left out.
class Components {
 public:
  // `cells` marks x cameras; a mark of which some cell is known has no triples. Both stay the
  // caller's.
  Components(const std::vector<Triple>& triples, std::span<const CellSquare> cells,
             std::size_t cameras);

  // What is wild by factors squared `theta` is left out; covariances are those of `by`.
  Sums Collect(const Eigen::VectorXd& theta, const Eigen::VectorXd& by) const;
  // The one factor squared of all.
  double Common() const;
  // Of cells, then of cameras and of marks (means over their cells), by their probabilities [BIC]:
  // all alike; one camera's or one mark's or one cell's own, while the others are 1; each camera,
  // mark or cell its own. So what the record does not tell apart is shared.
  struct Found {
    Eigen::VectorXd square, sigma;
    ScatterOwner owner = ScatterOwner::kAll;  // the likeliest
  };
  // No factor squared is below `least`.
  Found Each(double common, double least) const;
  std::size_t cells() const { return known_.size(); }
  double numbers() const { return numbers_; }  // that tell, of all

 private:
  // By cell, which number of a model it has; -1: 1.
  using Shared = std::vector<int>;
  struct Model {
    ScatterOwner owner = ScatterOwner::kAll;
    Eigen::VectorXd theta;   // by cell
    Eigen::MatrixXd spread;  // numbers x numbers
    Shared shared;
    double loss = 0.0;  // -2 ln of the likelihood, with the price of its numbers [-]
  };
  std::vector<Model> Models() const;
  void Fit(double level, double least, Model* model) const;
  void Score(double level, double least, Model* out) const;
  double LossOf(const Eigen::VectorXd& theta, const Eigen::VectorXd& alike) const;
  Eigen::MatrixXd Means() const;

  const std::vector<Triple>& triples_;
  std::span<const CellSquare> given_;
  Eigen::Index cameras_, marks_;
  std::vector<bool> known_;            // by cell
  std::vector<double> limits_, kept_;  // by how many numbers a triple gives
  double numbers_ = 0.0;
};

}  // namespace unfurl::measure
