#include "sim/methods/pair_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <complex>
#include <vector>

#include "sim/methods/dormand_prince8_table.h"

namespace unfurl::sim::pair_choice_test {
namespace {

using Complex = std::complex<double>;

// What a step does to y' = lambda y, z = h lambda.
Complex Fifth(Complex z) {
  Complex sum = 1.0, term = 1.0;
  for (int k = 1; k <= 5; ++k) sum += term *= z / static_cast<double>(k);
  return sum + term * z / 5.0;  // z^6 / 600: Hairer, Norsett and Wanner, Solving ODEs I, II.4
}

template <std::size_t N>
Complex Sum(const dop853::Terms<N>& terms, const std::vector<Complex>& k) {
  Complex sum = 0.0;
  for (const dop853::Term& term : terms) {
    sum += term.weight * k[static_cast<std::size_t>(term.stage)];
  }
  return sum;
}

Complex Eighth(Complex z) {
  std::vector<Complex> k = {z};
  const auto stage = [&](const auto& terms) { k.push_back(z * (1.0 + Sum(terms, k))); };
  stage(dop853::kA1);
  stage(dop853::kA2);
  stage(dop853::kA3);
  stage(dop853::kA4);
  stage(dop853::kA5);
  stage(dop853::kA6);
  stage(dop853::kA7);
  stage(dop853::kA8);
  stage(dop853::kA9);
  stage(dop853::kA10);
  stage(dop853::kA11);
  return 1.0 + Sum(dop853::kB, k);
}

// The first h |lambda| along a direction at which a vibration grows.
double Edge(Complex (*step)(Complex), Complex direction) {
  constexpr double kFine = 1e-3, kRounding = 1e-9;
  double z = kFine;
  while (std::abs(step(z * direction)) <= 1.0 + kRounding) z += kFine;
  return z;
}

// The header's table, from the methods' coefficients.
TEST(PairChoice, EdgesAreAsStated) {
  constexpr double kPrinted = 0.01;
  EXPECT_NEAR(Edge(Fifth, {-1.0, 0.0}), 3.31, kPrinted);
  EXPECT_NEAR(Edge(Fifth, {0.0, 1.0}), 1.00, kPrinted);
  EXPECT_NEAR(Edge(Eighth, {-1.0, 0.0}), 6.40, kPrinted);
  EXPECT_NEAR(Edge(Eighth, {0.0, 1.0}), 5.97, kPrinted);
}

// Work to go through `end` periods of 1 / |lambda|: by PairChoice, and by the better pair alone. A
// step is `motion` long where accuracy limits it (order five; order eight 1.5 times), and else ends
// at the pair's edge.
struct Work {
  double ours = 0.0, better = 0.0;
};
Work Spend(double motion_lambda, double edge5, double edge8, double end) {
  const double step5 = std::min(motion_lambda, edge5), step8 = std::min(1.5 * motion_lambda, edge8);
  constexpr double kCost5 = 6.0, kCost8 = 12.0;
  PairChoice choice(false);
  Work work;
  for (double t = 0.0; t < end;) {
    const double step = choice.at_edge() ? step8 : step5, cost = choice.at_edge() ? kCost8 : kCost5;
    t += step;
    work.ours += cost;
    choice.Note(step, cost);
  }
  work.better = std::min(kCost5 / step5, kCost8 / step8) * end;
  return work;
}

// Nowhere dearer than by what order eight is where it is of no use, a third in this model.
TEST(PairChoice, CostsLittleMoreThanTheBetterPair) {
  constexpr double kMore = 1.35, kWork = 20000.0;
  for (const double motion : {0.1, 0.5, 0.9, 2.0, 8.0, 100.0}) {
    for (const bool damped : {false, true}) {
      const double edge5 = damped ? 3.31 : 1.0, edge8 = damped ? 6.4 : 5.97;
      const Work one = Spend(motion, edge5, edge8, 1.0);
      const Work work = Spend(motion, edge5, edge8, kWork / one.better);
      EXPECT_LT(work.ours, kMore * work.better) << motion << " " << damped;
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::pair_choice_test
