// The elastica: a clamped beam under a moment, and under a force across it, at its end. Source:
// Euler. Quantity: the tip's place at equilibrium. Reference: under a moment, an arc of a circle;
// under a force that keeps its direction, elliptic integrals (Boost.Math) of modulus k, k^2 = (1 +
// sin phi) / 2 at the tip's angle phi, sin psi = 1 / (k sqrt 2):
//   P L^2 / EI = a = (K - F(psi))^2,  w / L = 1 - 2 (E - E(psi)) / sqrt a,  x / L = sqrt(2 sin phi
//   / a).
// Tolerance: second order in the segments, from both sides, and the level that follows. Not
// checked: stretching; the equilibrium search of the program itself.
#include <gtest/gtest.h>

#include <boost/math/special_functions/ellint_1.hpp>
#include <boost/math/special_functions/ellint_2.hpp>
#include <cmath>

#include "linearized.h"
#include "runs.h"

namespace unfurl::sim {
namespace {

struct Place {
  double x, y;
};

Place UnderForce(double a) {
  namespace bm = boost::math;
  const auto of = [](double phi, double* load) {
    const double k = std::sqrt(0.5 * (1.0 + std::sin(phi))), psi = std::asin(M_SQRT1_2 / k);
    *load = std::pow(bm::ellint_1(k) - bm::ellint_1(k, psi), 2);
    const double root = std::sqrt(*load);
    return Place{std::sqrt(2.0 * std::sin(phi)) / root,
                 1.0 - 2.0 * (bm::ellint_2(k) - bm::ellint_2(k, psi)) / root};
  };
  double low = 1e-6, high = M_PI_2 - 1e-9, load = 0.0;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    of(middle, &load);
    (load < a ? low : high) = middle;
  }
  return of(low, &load);
}

// The beam, 1 m long with EI = 1 N m^2, loaded in steps.
Place Found(const std::string& key, double load, int segments) {
  constexpr int kSteps = 8;
  std::vector<double> state;
  Place tip{};
  for (int k = 1; k <= kSteps; ++k) {
    const std::string value = std::to_string(load * k / kSteps);
    const Model model = Compile(data::ParseScene(
        "[scene]\nname = \"elastica\"\nduration = 1.0\n"
        "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 1.0\nsegments = " +
            std::to_string(segments) +
            "\n[weld.clamp]\ninner = \"ground\"\nouter = \"rod.start\"\n"
            "[force.end]\non = \"rod.end\"\n" +
            (key == "torque" ? "torque = " + value : "force = [0.0, " + value + "]") +
            "\n[mark.tip]\non = \"rod.end\"\n",
        "elastica.toml"));
    if (state.empty()) state = model.initial_state;
    EXPECT_LT(FindEquilibrium(model, &state), 1e-5);  // of some n^4 that one radian would give
    const PointMotion p = MotionOf(model, model.marks[0].point, state.data());
    tip = {p.x, p.y};
  }
  return tip;
}

void ExpectSecondOrder(const std::string& key, double load, const Place& exact) {
  double error[3];
  int k = 0;
  for (const int n : {8, 16, 32}) {
    const Place tip = Found(key, load, n);
    error[k++] = std::hypot(tip.x - exact.x, tip.y - exact.y);
  }
  for (int i = 0; i < 2; ++i) {
    const double order = std::log2(error[i] / error[i + 1]);
    std::printf("found: elastica, %s %.4g, order %.3f\n", key.c_str(), load, order);
    EXPECT_GT(order, 1.85);
    EXPECT_LT(order, 2.15);
  }
  ExpectWithin("elastica, " + key + ", 32 segments, tip over the length", error[2], 2e-3);
}

TEST(Elastica, ReferenceHasThePublishedValues) {
  // Mattiasson, Int. J. Numer. Meth. Eng. 17 (1981): P L^2 / EI = 1 and 10.
  EXPECT_NEAR(UnderForce(1.0).y, 0.30172, 5e-6);
  EXPECT_NEAR(1.0 - UnderForce(1.0).x, 0.05643, 5e-6);
  EXPECT_NEAR(UnderForce(10.0).y, 0.81061, 5e-6);
  EXPECT_NEAR(1.0 - UnderForce(10.0).x, 0.55500, 5e-6);
}

TEST(Elastica, EndForce) { ExpectSecondOrder("force", 5.0, UnderForce(5.0)); }

TEST(Elastica, EndMomentBendsItToHalfACircle) {
  ExpectSecondOrder("torque", M_PI, {std::sin(M_PI) / M_PI, (1.0 - std::cos(M_PI)) / M_PI});
}

}  // namespace
}  // namespace unfurl::sim
