#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace unfurl::measure {

// What three flashes tell: y ~ N(0, sum_c k_c^2 part_c part_c^T).
struct Triple {
  Eigen::VectorXd y;     // m [px]
  Eigen::MatrixXd part;  // m x C, sqrt(v_c) n_c, 0 of cameras that do not see it [px]
};

// Sums over the triples that are not wild where the squared factors are `theta`.
struct Sums {
  Eigen::VectorXd along;   // C: what the scatter is along each camera's component, over what is due
  Eigen::MatrixXd fisher;  // C x C: twice the information
  double chi_square = 0.0, numbers = 0.0;
};

// Components of variance by maximum likelihood [Fisher's scoring], one to a camera, as factors
// squared of what is stated. What is beyond chance by any factors, wild readings, is left out.
class Components {
 public:
  // `triples` stay the caller's.
  Components(const std::vector<Triple>& triples, std::size_t cameras);

  // What is wild by factors squared `theta` is left out; covariances are those of `by`.
  Sums Collect(const Eigen::VectorXd& theta, const Eigen::VectorXd& by) const;
  // The one factor squared of all.
  double Common() const;
  // Factors squared by camera, none below `least`, with their covariance: of all alike, of one
  // camera while the others' are 1, or each its own, weighed by their probabilities [BIC]. So what
  // the marks' ways do not tell apart is shared.
  Eigen::VectorXd Each(double common, double least, Eigen::MatrixXd* covariance) const;

 private:
  struct Model {
    Eigen::VectorXd theta;
    Eigen::MatrixXd covariance;
    double loss = 0.0;  // -2 ln of the likelihood, with the price of its numbers [-]
  };
  // Those of `free` cameras, the others' 1; of none: all are `alike`, which is one number, too.
  Model Fit(const Eigen::VectorXd& alike, const std::vector<Eigen::Index>& free,
            double least) const;
  void Score(double level, double least, const std::vector<Eigen::Index>& free, Model* out) const;
  double LossOf(const Eigen::VectorXd& theta, const Eigen::VectorXd& alike) const;

  const std::vector<Triple>& triples_;
  Eigen::Index cameras_;
  std::vector<double> limits_, kept_;  // by how many numbers a triple gives
};

}  // namespace unfurl::measure
