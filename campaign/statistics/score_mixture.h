#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign {

/// A mixture of normal distributions of d normal scores, made to draw where weighted points lie:
/// the proposal of importance sampling by cross-entropy [Rubinstein and Kroese 2004], with two
/// differences. No direction is narrower than the scores' own distribution, so that weights stay
/// bounded; and a direction is wider only where the points show it beyond the noise of a sample
/// covariance, so that a hundred inputs do not spoil the weights.
class ScoreMixture {
 public:
  struct Component {
    double weight = 0.0;
    Eigen::VectorXd mean;
    double variance = 1.0;      // of all directions but the axes, 1 or more
    Eigen::MatrixXd axes;       // orthonormal columns: directions that are wider
    Eigen::VectorXd variances;  // of those
  };

  /// From `points` (one a column, n >= 1) with positive weights; the number of components is that
  /// of the least Bayesian information criterion [Schwarz 1978]. `effective`: how many independent
  /// points they are worth. `wide`: the weight of one more component, of the points' mean square
  /// radius in all directions, which finds what the points have missed.
  ScoreMixture(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights, double effective,
               double wide, std::uint64_t seed);

  const std::vector<Component>& components() const { return components_; }
  /// Point `index` of a stream of random numbers.
  Eigen::VectorXd Draw(const CounterRandom& random, std::uint64_t index) const;
  /// log of the scores' own density over the mixture's: a draw's importance weight.
  double LogWeight(const Eigen::VectorXd& z) const;

 private:
  std::vector<Component> components_;
};

}  // namespace unfurl::campaign
