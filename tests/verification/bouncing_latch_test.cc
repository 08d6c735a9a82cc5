// The latch of data/sets/bouncing_latch: one arm, one angle. Source: [paper, sections 3.2 and 5].
// Quantity: time of latching, times and rates of all impacts, each one's restitution, the angle;
// and the restitution against the parameter e of eq. (19) and the speed. Reference: the one
// equation of motion with the contact law written a second time, Fehlberg 7(8) at 1e-14, every
// branch of the law bracketed. Tolerance: named below. Not checked: several flexible bodies at once
// (rigid_deployment_ and deployment_test.cc), and whether a real latch obeys this law.
#include <gtest/gtest.h>

#include <cmath>

#include "contact_law.h"
#include "reference.h"
#include "runs.h"

namespace unfurl::sim::bouncing_latch_test {
namespace {

constexpr double kInertia = 0.0226133333333333 + 0.424 * 0.4 * 0.4;
constexpr double kStiffness = 0.218, kPreload = 1.57;

struct Impact {
  double start = 0.0, end = 0.0, rate_start = 0.0, rate_end = 0.0;
  bool upper = false;
};
struct Bounces {
  double latch = NAN;
  std::vector<Impact> impacts;
  std::vector<double> theta;
};

Bounces OneEquation(const reference::ContactLaw& law, double stiffness, double theta, double rate,
                    const std::vector<double>& times) {
  Bounces out;
  bool latched = theta < law.theta_a;
  Impact now[2];
  reference::Integrator integrator;
  integrator.largest_step = [&law](const auto& y) { return law.LargestStep(y[0], y[1]); };
  for (int b = 0; b < reference::ContactLaw::kBranches; ++b) {
    integrator.guards.push_back(
        [&law, b](double, const auto& y) { return law.Branch(b, y[0], y[1]); });
  }
  integrator.crossing = [&](int guard, bool positive, double t, auto& y) {
    if (guard > 1) return;
    if (guard == 0 && !latched) {
      if (!positive) latched = true, out.latch = t;
      return;
    }
    if (positive) {
      now[guard] = {t, 0.0, y[1], 0.0, guard == 0};
    } else {
      now[guard].end = t, now[guard].rate_end = y[1];
      out.impacts.push_back(now[guard]);
    }
  };
  const auto states = integrator.Run(
      [&](double, const auto& y, auto& dydt) {
        dydt[0] = y[1];
        dydt[1] = (-stiffness * (y[0] + kPreload) + law.Moment(latched, y[0], y[1])) / kInertia;
      },
      {theta, rate}, times);
  for (const auto& y : states) out.theta.push_back(y[0]);
  return out;
}

std::vector<Impact> ImpactsOf(const SimulateReport& report) {
  std::vector<Impact> impacts;
  for (const Event& e : report.events) {
    if (e.kind != EventKind::kContactEnd) continue;
    impacts.push_back(
        {e.t - e.duration, e.t, -e.theta_rate / e.restitution, e.theta_rate, e.upper});
  }
  return impacts;
}

TEST(BouncingLatch, AgreesWithItsOneEquation) {
  SimulateOptions options;
  options.rtol = 2e-13;
  const Recorder run = Record(Compile(ReadSet("bouncing_latch/scene.toml")), options);
  const Bounces exact =
      OneEquation(reference::PaperLaw(), kStiffness, M_PI_2, 0.0, reference::EvenTimes(3.0, 3000));
  double latch = NAN;
  for (const Event& e : run.report.events) {
    if (e.kind == EventKind::kLatch) latch = e.t;
  }
  // Rounding over the half second that the swing takes.
  ExpectWithin("bouncing latch, time of latching [s]", std::fabs(latch - exact.latch), 1e-11);
  const std::vector<Impact> found = ImpactsOf(run.report);
  ASSERT_EQ(found.size(), exact.impacts.size());
  ASSERT_GT(found.size(), 20u);
  double time = 0.0, rate = 0.0, restitution = 0.0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Impact &a = found[k], &b = exact.impacts[k];
    EXPECT_EQ(a.upper, b.upper) << k;
    time = std::max({time, std::fabs(a.start - b.start), std::fabs(a.end - b.end)});
    rate = std::max(rate, std::fabs(a.rate_end - b.rate_end));
    restitution =
        std::max(restitution, std::fabs(a.rate_end / a.rate_start - b.rate_end / b.rate_start));
  }
  const std::string count = std::to_string(found.size()) + " impacts, ";
  // Errors of the flights add up, and slow impacts turn an error of speed into one of time.
  ExpectWithin("bouncing latch, " + count + "times [s]", time, 1e-7);
  ExpectWithin("bouncing latch, " + count + "rates [rad/s]", rate, 1e-7);
  ExpectWithin("bouncing latch, " + count + "restitution", restitution, 1e-7);
  ExpectWithin("bouncing latch, angle [rad]", LargestDifference(run["hinge.theta"], exact.theta),
               1e-8);
}

// Fifty bounces hand on what each of them errs by, and some magnify it: a hundred tolerances of the
// angle's range, by every method. A kink of the law that lay within a step was up to 1700.
TEST(BouncingLatch, IsWithinAHundredTolerances) {
  const Bounces exact =
      OneEquation(reference::PaperLaw(), kStiffness, M_PI_2, 0.0, reference::EvenTimes(3.0, 3000));
  const Model model = Compile(ReadSet("bouncing_latch/scene.toml"));
  for (const Method method :
       {Method::kAuto, Method::kProjected, Method::kPartitioned, Method::kImplicit}) {
    for (const double rtol : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
      SimulateOptions options;
      options.method = method;
      options.rtol = rtol;
      const Recorder run = Record(model, options);
      EXPECT_EQ(run.report.status, SimulateStatus::kGood) << run.report.message;
      EXPECT_LT(LargestDifference(run["hinge.theta"], exact.theta), 100.0 * rtol * M_PI_2)
          << static_cast<int>(method) << " " << rtol;
    }
  }
}

// One impact at the lower stop without the spring, for several e and speeds. M in eq. (19) is the
// mass that the contact feels, I / x_p^2, so that e can be held beside what results: the law has a
// linear damper on a Hertz spring, so the two are equal only at e = 1.
class Restitution : public ::testing::TestWithParam<double> {};

TEST_P(Restitution, OfOneImpact) {
  const double speed = GetParam();
  reference::ContactLaw law = reference::PaperLaw();
  const double mass = kInertia / (law.lever * law.lever);
  double last = 0.0;
  for (const double e : {0.3, 0.5, 0.7, 0.85, 0.95, 1.0}) {
    data::Scene scene = ReadSet("bouncing_latch/scene.toml");
    scene.joints[0].spring.reset();
    scene.joints[0].theta = 0.0;
    scene.joints[0].theta_rate = -speed;
    scene.contacts[0].C = law.C = data::ContactDamping(mass, 3.2e9, e);
    const double duration = 0.0052 / speed + 0.3;  // to the stop, and its contact
    const Bounces exact = OneEquation(law, 0.0, 0.0, -speed, {0.0, duration});
    SimulateOptions options;
    options.rtol = 1e-12;
    options.duration = duration;
    options.track_energy = false;
    const SimulateReport report = Simulate(Compile(scene), options, nullptr);
    const std::vector<Impact> found = ImpactsOf(report);
    ASSERT_GE(found.size(), 1u);
    ASSERT_GE(exact.impacts.size(), 1u);
    const double ours = -found[0].rate_end / found[0].rate_start;
    const double theirs = -exact.impacts[0].rate_end / exact.impacts[0].rate_start;
    char name[80];
    std::snprintf(name, sizeof name, "restitution at %.2g rad/s, e = %.2f: %.6f", speed, e, theirs);
    ExpectWithin(name, std::fabs(ours - theirs), 1e-8);
    EXPECT_GT(theirs, last);  // more with e
    last = theirs;
  }
  // Nothing is lost at e = 1.
  ExpectWithin("restitution at e = 1 less 1", std::fabs(last - 1.0), 1e-10);
}
INSTANTIATE_TEST_SUITE_P(Speeds, Restitution, ::testing::Values(0.5, 4.0));

}  // namespace
}  // namespace unfurl::sim::bouncing_latch_test
