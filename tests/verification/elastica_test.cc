// The elastica: a clamped beam under a moment, and under a force across it, at
// its end. Source: Euler. Quantity: the tip's place at equilibrium. Reference:
// under a moment, an arc of a circle; under a force that keeps its direction,
// elliptic integrals (Boost.Math) of modulus k, k^2 = (1 + sin phi) / 2 at the
// tip's angle phi, sin psi = 1 / (k sqrt 2):
//   P L^2 / EI = a = (K - F(psi))^2,  w / L = 1 - 2 (E - E(psi)) / sqrt a,  x /
//   L = sqrt(2 sin phi / a).
// Tolerance: second order in the segments, from both sides, and the level that
// follows. Not checked: stretching; the equilibrium search of the program
// itself.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <boost/math/special_functions/ellint_1.hpp>
#include <boost/math/special_functions/ellint_2.hpp>
#include <cmath>

#include "runs.h"

namespace unfurl::sim::elastica_test {
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

// Positions that meet every longitudinal constraint, from each station's offset
// across the axis of the one before it and its angle; stations from the clamp
// at the origin. A moment acts on a little plate at the end, half a segment
// further on.
std::vector<int> StationsOf(const Model& model) {
  std::vector<int> bodies;
  for (int k = 0; k < model.beams[0].segments; ++k) bodies.push_back(model.beams[0].first + k);
  for (const Model::Body& body : model.bodies) bodies.push_back(body.centre.body);
  return bodies;
}

std::vector<double> StateOf(const Model& model, const Eigen::VectorXd& u) {
  std::vector<double> state = model.initial_state;
  const Model::Beam& beam = model.beams[0];
  const std::vector<int> bodies = StationsOf(model);
  double x = 0.0, y = 0.0, theta = 0.0;
  for (int k = 0; k < static_cast<int>(bodies.size()); ++k) {
    const bool half = k == 0 || k == beam.segments;
    const double l = half ? 0.5 * beam.segment_length : beam.segment_length;
    x += l * std::cos(theta) - u[2 * k] * std::sin(theta);
    y += l * std::sin(theta) + u[2 * k] * std::cos(theta);
    theta = u[2 * k + 1];
    const int body = bodies[k];
    state[model.index.x(body)] = x;
    state[model.index.y(body)] = y;
    state[model.index.theta(body)] = theta;
  }
  return state;
}

// Newton on what is out of balance, sum over segments of (mass times
// acceleration) . (d place / d u): the constraints' forces do no work on it.
Eigen::VectorXd Imbalance(const Model& model, Dynamics* dynamics, const Eigen::VectorXd& u) {
  constexpr double kStep = 1e-5;
  std::vector<double> state = StateOf(model, u), rate(state.size());
  dynamics->RightSide(0.0, state.data(), rate.data());
  const StateIndex& i = model.index;
  Eigen::VectorXd out(u.size());
  for (Eigen::Index c = 0; c < u.size(); ++c) {
    Eigen::VectorXd more = u, less = u;
    more[c] += kStep, less[c] -= kStep;
    const std::vector<double> a = StateOf(model, more), b = StateOf(model, less);
    double sum = 0.0;
    for (const int s : StationsOf(model)) {
      sum += model.rigid_bodies.mass[s] * (rate[i.vx(s)] * (a[i.x(s)] - b[i.x(s)]) +
                                           rate[i.vy(s)] * (a[i.y(s)] - b[i.y(s)])) +
             model.rigid_bodies.inertia[s] * rate[i.omega(s)] * (a[i.theta(s)] - b[i.theta(s)]);
    }
    out[c] = sum / (2.0 * kStep);
  }
  return out;
}

// The beam, 1 m long with EI = 1 N m^2, loaded in steps.
Place Found(const std::string& key, double load, int segments) {
  constexpr int kSteps = 10;
  Eigen::VectorXd u;
  Place tip{};
  for (int k = 1; k <= kSteps; ++k) {
    char value[32];
    std::snprintf(value, sizeof value, "%.17g", load * k / kSteps);
    const Model model = Compile(data::ParseScene(
        "[scene]\nname = \"elastica\"\nduration = 1.0\n"
        "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 1.0\nsegments = " +
            std::to_string(segments) +
            "\n[weld.clamp]\ninner = \"ground\"\nouter = \"rod.start\"\n" +
            (key == "torque"
                 ? std::string("[body.plate]\nmass = 0.01\ninertia = "
                               "1e-4\n[weld.plate]\n"
                               "inner = \"rod.end\"\nouter = \"plate\"\n"
                               "[force.end]\non = \"plate\"\ntorque = ") +
                       value
                 : std::string("[force.end]\non = \"rod.end\"\nforce = [0.0, ") + value + "]") +
            "\n[mark.tip]\non = \"rod.end\"\n",
        "elastica.toml"));
    if (u.size() == 0) u = Eigen::VectorXd::Zero(2 * static_cast<int>(StationsOf(model).size()));
    Dynamics dynamics(model);
    double last = INFINITY;
    for (int round = 0; round < 30 && last > 1e-10; ++round) {
      const Eigen::VectorXd at = Imbalance(model, &dynamics, u);
      Eigen::MatrixXd slope(u.size(), u.size());
      for (Eigen::Index c = 0; c < u.size(); ++c) {
        constexpr double kStep = 1e-6;
        Eigen::VectorXd more = u, less = u;
        more[c] += kStep, less[c] -= kStep;
        slope.col(c) =
            (Imbalance(model, &dynamics, more) - Imbalance(model, &dynamics, less)) / (2 * kStep);
      }
      const Eigen::VectorXd step = slope.partialPivLu().solve(-at);
      u += step;
      last = step.cwiseAbs().maxCoeff();
    }
    EXPECT_LT(last, 1e-6) << "no equilibrium at " << value;
    std::vector<double> state = StateOf(model, u);
    const PointMotion p = MotionOf(model, model.marks[0].point, state.data());
    tip = {p.x, p.y};
  }
  return tip;
}

void ExpectSecondOrder(const std::string& key, double load, const Place& exact) {
  double error[3];
  int k = 0;
  for (const int n : {6, 12, 24}) {
    const Place tip = Found(key, load, n);
    error[k++] = std::hypot(tip.x - exact.x, tip.y - exact.y);
  }
  for (int i = 0; i < 2; ++i) {
    const double order = std::log2(error[i] / error[i + 1]);
    std::printf("found: elastica, %s %.4g, order %.3f\n", key.c_str(), load, order);
    EXPECT_GT(order, 1.85);
    EXPECT_LT(order, 2.15);
  }
  ExpectWithin("elastica, " + key + ", 24 segments, tip over the length", error[2], 2e-3);
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
}  // namespace unfurl::sim::elastica_test
