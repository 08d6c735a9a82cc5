#include "sim/methods/stepper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "jacobi.h"
#include "scenes.h"
#include "sim/methods/dormand_prince.h"
#include "sim/methods/dormand_prince8.h"
#include "sim/methods/runge_kutta_43.h"

namespace unfurl::sim::stepper_test {
namespace {

constexpr double kTheta0 = 2.8;
const double kOmega = std::sqrt(2.0 * 9.81 * 0.5 / (0.1 + 2.0 * 0.5 * 0.5));  // m g r / I

// The pendulum's angle, from the state of its bar.
double Theta(const Model& model, const double* y) {
  return y[model.index.theta(model.bodies[0].centre.body)] + M_PI / 2;
}

struct Errors {
  double end = 0.0;     // of the angle after the time of two swings [rad]
  double inside = 0.0;  // largest of the dense output within the middle step [rad]
};

// Steps all alike, against the closed form.
template <typename Method>
Errors ErrorsOf(int steps) {
  const Model model = ModelFrom(PendulumScene(kTheta0));
  Dynamics dynamics(model);
  Method method(dynamics, {});
  method.Start(0.0, model.initial_state);
  const double k = std::sin(0.5 * kTheta0);
  const double duration = 2.2 * std::comp_ellint_1(k) / kOmega;
  const double h = duration / steps;
  Errors errors;
  std::vector<double> y(model.index.size());
  double theta, rate;
  for (int i = 0; i < steps; ++i) {
    method.Try(h);
    if (i == steps / 2) {
      for (const double sigma : {0.2, 0.35, 0.5, 0.65, 0.8}) {
        method.Dense(sigma, y.data());
        PendulumAt((i + sigma) * h, kTheta0, kOmega, &theta, &rate);
        errors.inside = std::max(errors.inside, std::fabs(Theta(model, y.data()) - theta));
      }
    }
    method.Accept((i + 1) * h);
  }
  PendulumAt(duration, kTheta0, kOmega, &theta, &rate);
  const double omega = method.state()[model.index.omega(model.bodies[0].centre.body)];
  errors.end = std::hypot(Theta(model, method.state()) - theta, (omega - rate) / kOmega);
  return errors;
}

double Order(double coarse, double fine, double ratio) {
  return std::log(coarse / fine) / std::log(ratio);
}

TEST(Stepper, ClosedFormOfThePendulumIsOne) {
  // Against its own equation: theta'' = -omega^2 sin theta, by differences of the rate.
  constexpr double kStep = 1e-5, kTolerance = 1e-8;  // differences of second order
  for (const double t : {0.0, 0.3, 0.7, 1.9}) {
    double theta, rate, before, after, unused;
    PendulumAt(t, kTheta0, kOmega, &theta, &rate);
    PendulumAt(t - kStep, kTheta0, kOmega, &unused, &before);
    PendulumAt(t + kStep, kTheta0, kOmega, &unused, &after);
    EXPECT_NEAR((after - before) / (2 * kStep), -kOmega * kOmega * std::sin(theta), 1e-6);
    EXPECT_NEAR(0.5 * rate * rate, kOmega * kOmega * (std::cos(theta) - std::cos(kTheta0)),
                kTolerance);
  }
}

TEST(Stepper, FourthOrder) {
  const Errors coarse = ErrorsOf<RungeKutta43>(1600), fine = ErrorsOf<RungeKutta43>(3200);
  EXPECT_GT(Order(coarse.end, fine.end, 2.0), 3.7);
  EXPECT_LT(Order(coarse.end, fine.end, 2.0), 4.3);
  // Dense output of third order: its error falls as h^4.
  const Errors one = ErrorsOf<RungeKutta43>(100), two = ErrorsOf<RungeKutta43>(200);
  EXPECT_GT(Order(one.inside, two.inside, 2.0), 3.5);
  EXPECT_LT(Order(one.inside, two.inside, 2.0), 4.5);
}

TEST(Stepper, FifthOrder) {
  const Errors coarse = ErrorsOf<DormandPrince>(400), fine = ErrorsOf<DormandPrince>(800);
  EXPECT_GT(Order(coarse.end, fine.end, 2.0), 4.6);
  EXPECT_LT(Order(coarse.end, fine.end, 2.0), 5.4);
  // Dense output of fourth order: its error falls as h^5.
  const Errors one = ErrorsOf<DormandPrince>(100), two = ErrorsOf<DormandPrince>(200);
  EXPECT_GT(Order(one.inside, two.inside, 2.0), 4.5);
  EXPECT_LT(Order(one.inside, two.inside, 2.0), 5.5);
}

TEST(Stepper, EighthOrder) {
  // The error's terms of order 8 were made so small that those of order 9 still show.
  const Errors coarse = ErrorsOf<DormandPrince8>(40), fine = ErrorsOf<DormandPrince8>(80);
  EXPECT_GT(Order(coarse.end, fine.end, 2.0), 7.6);
  EXPECT_LT(Order(coarse.end, fine.end, 2.0), 9.4);
  // Dense output of seventh order: its error falls as h^8.
  const Errors one = ErrorsOf<DormandPrince8>(20), two = ErrorsOf<DormandPrince8>(40);
  EXPECT_GT(Order(one.inside, two.inside, 2.0), 7.5);
  EXPECT_LT(Order(one.inside, two.inside, 2.0), 8.5);
}

// A load that depends on time alone, m x'' = F cos(p t): stages, dense output and the right side
// that is carried over to the next step must all be taken at their own times.
template <typename Method>
Errors DrivenErrorsOf(int steps) {
  constexpr double kMass = 2.0, kForce = 3.0, kRate = 4.0, kDuration = 2.0;
  const Model model = ModelFrom(
      "[scene]\nname = 'driven'\nduration = 1.0\n[body.box]\nmass = 2.0\ninertia = 0.1\n"
      "[force.f]\non = 'box'\nforce = ['3 * cos(4 * t)', 0.0]\n");
  Dynamics dynamics(model);
  Method method(dynamics, {});
  method.Start(0.0, model.initial_state);
  const int at = model.index.x(model.bodies[0].centre.body);
  const double x0 = model.initial_state[at], h = kDuration / steps;
  const auto exact = [&](double t) {
    return x0 + kForce / (kMass * kRate * kRate) * (1.0 - std::cos(kRate * t));
  };
  Errors errors;
  std::vector<double> y(model.index.size());
  for (int i = 0; i < steps; ++i) {
    method.Try(h);
    for (const double sigma : {0.3, 0.7}) {
      method.Dense(sigma, y.data());
      errors.inside = std::max(errors.inside, std::fabs(y[at] - exact((i + sigma) * h)));
    }
    method.Accept((i + 1) * h);
    errors.end = std::max(errors.end, std::fabs(method.state()[at] - exact((i + 1) * h)));
  }
  return errors;
}

TEST(Stepper, LoadsOfTimeAreTakenAtTheirTimes) {
  const auto expect = [](const Errors& coarse, const Errors& fine, double order, double dense) {
    EXPECT_GT(Order(coarse.end, fine.end, 2.0), order - 0.5) << order;
    EXPECT_GT(Order(coarse.inside, fine.inside, 2.0), dense - 0.5) << order;
  };
  expect(DrivenErrorsOf<RungeKutta43>(40), DrivenErrorsOf<RungeKutta43>(80), 4.0, 4.0);
  expect(DrivenErrorsOf<DormandPrince>(20), DrivenErrorsOf<DormandPrince>(40), 5.0, 5.0);
  expect(DrivenErrorsOf<DormandPrince8>(8), DrivenErrorsOf<DormandPrince8>(16), 8.0, 8.0);
}

TEST(Stepper, ThePolynomialIsTheDenseOutput) {
  const Model model = ModelFrom(PendulumScene(kTheta0));
  Dynamics dynamics(model);
  RungeKutta43 fourth(dynamics, {});
  DormandPrince fifth(dynamics, {});
  DormandPrince8 eighth(dynamics, {});
  for (Stepper* method : {static_cast<Stepper*>(&fourth), static_cast<Stepper*>(&fifth),
                          static_cast<Stepper*>(&eighth)}) {
    method->Start(0.0, model.initial_state);
    method->Try(0.05);
    method->Accept(0.05);
    method->Try(0.1);
    // Of third, fourth and seventh degree.
    const int degree = method == &fourth ? 3 : method == &fifth ? 4 : 7;
    EXPECT_EQ(method->Polynomial(0).count, degree + 1) << method->name();
    std::vector<double> y(model.index.size());
    constexpr double kRounding = 1e-13;
    for (const double sigma : {0.0, 0.3, 0.77, 1.0}) {
      method->Dense(sigma, y.data());
      for (int i = 0; i < model.index.size(); ++i) {
        EXPECT_NEAR(method->Polynomial(i)(sigma), y[i], kRounding) << method->name();
      }
    }
    for (int i = 0; i < model.index.size(); ++i) {
      EXPECT_NEAR(method->Polynomial(i)(1.0), method->trial()[i], kRounding);
    }
  }
}

TEST(Stepper, TheCubicIsOffByNoMoreThanItSays) {
  const Model model = ModelFrom(PendulumScene(kTheta0));
  Dynamics dynamics(model);
  DormandPrince8 method(dynamics, {});
  method.Start(0.0, model.initial_state);
  constexpr double kStep = 0.15;
  for (int step = 0; step < 10; ++step) {
    method.Try(kStep);
    for (int i = 0; i < 6 * model.index.n; ++i) {
      double margin = 0.0;
      const DensePolynomial cubic = method.Cubic(i, &margin);
      double off = 0.0;
      for (double s = 0.0; s <= 1.0; s += 0.05) {
        off = std::max(off, std::fabs(cubic(s) - method.Polynomial(i)(s)));
      }
      EXPECT_LE(off, margin + 1e-12);
    }
    method.Accept((step + 1) * kStep);
  }
}

TEST(Stepper, ForeseesTheEdgeOfStability) {
  for (const bool eighth : {false, true}) {
    const Model model = ModelFrom(PendulumScene(0.01));
    Dynamics dynamics(model);
    std::unique_ptr<Stepper> method;
    if (eighth) {
      method = std::make_unique<DormandPrince8>(dynamics, ErrorScale{});
    } else {
      method = std::make_unique<DormandPrince>(dynamics, ErrorScale{});
    }
    method->Start(0.0, model.initial_state);
    const double edge = (eighth ? 6.1 : 3.25) / kOmega;
    method->Try(0.1 * edge);
    // Small swings have the frequency omega: h |lambda| = h omega; 2% for what swings are not
    // small.
    EXPECT_NEAR(method->StabilityUse(), 0.1, 0.002) << method->name();
  }
}

// What the dense output of order eight says that its velocities are off by, where steps are long
// for the swing and where they are at the edge of stability: at least a fifth of what they are, and
// at most what h |lambda| makes of it.
TEST(Stepper, DoubtsItsDenseOutput) {
  const Model model = ModelFrom(PendulumScene(0.01));
  const int omega = model.index.omega(model.bodies[0].centre.body);
  ErrorScale scale;
  scale.rtol = 1.0;
  for (const double reach : {1.0, 2.0, 4.0, 6.0}) {
    Dynamics dynamics(model);
    DormandPrince8 method(dynamics, scale);
    method.Start(0.0, model.initial_state);
    const double h = reach / kOmega;
    method.Try(h);
    std::vector<double> y(model.index.size());
    double wrong = 0.0, doubt = 0.0;
    for (const double sigma : {0.15, 0.35, 0.5, 0.65, 0.85}) {
      method.Dense(sigma, y.data());
      double theta, rate;
      PendulumAt(sigma * h, 0.01, kOmega, &theta, &rate);
      // In the norm: x, y and omega of one body, here omega and 0.5 m times it.
      wrong = std::max(wrong, std::fabs(y[omega] - rate) * std::sqrt((1.0 + 0.25) / 6.0));
      doubt = std::max(doubt, method.DenseDoubt(sigma));
    }
    EXPECT_GT(doubt, 0.2 * wrong) << reach;
    EXPECT_LT(doubt, 20.0 * (1.0 + reach) * wrong) << reach;
  }
}

// Of steps that are too long by far a trial says so, and overflows nothing on its way (the tests'
// floating-point traps would end it).
TEST(Stepper, AStepFarBeyondStabilityIsOnlyRejected) {
  for (const char* mesh : {"segments = 6", "model = \"kirchhoff\"\norder = 3"}) {
    const Model model = ModelFrom(fmt::format(
        "[scene]\nname = \"far\"\nduration = 1.0\n[beam.rod]\nlength = 1.0\nmass = 0.5\nEI = 50.0\n"
        "damping = 1e-4\n{}\n[joint.j]\ninner = \"ground\"\nouter = \"rod.start\"\n"
        "theta_rate = 3.0\n[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = \"rod.end\"\n",
        mesh));
    Dynamics dynamics(model);
    RungeKutta43 fourth(dynamics, {});
    DormandPrince fifth(dynamics, {});
    DormandPrince8 eighth(dynamics, {});
    for (Stepper* method : {static_cast<Stepper*>(&fourth), static_cast<Stepper*>(&fifth),
                            static_cast<Stepper*>(&eighth)}) {
      method->Start(0.0, model.initial_state);
      for (const double h : {0.03, 1.0, 1e3, 1e7}) {
        const double error = method->Try(h);
        EXPECT_TRUE(error > 1.0 && std::isfinite(error)) << mesh << " " << h;
      }
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::stepper_test
