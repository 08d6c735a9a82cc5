// The deployment with rigid beams. Source: [paper, sections 3.2 and 5, Table 1], clearance.
// Quantity: the hub's place and angle, all joint angles, all latches and impacts.
// Reference: a second formulation, Lagrange's equations in seven minimal coordinates (the hub's
// place and five absolute angles), written from the table of lengths and masses, with the contact
// law written a second time; Fehlberg 7(8) at 1e-14. Tolerance: 1e-10 of the range before any
// impact; after that as named below. Not checked: the bending (deployment_test.cc).
#include <gtest/gtest.h>

#include <cmath>

#include "angle_tree.h"
#include "contact_law.h"
#include "reference.h"
#include "runs.h"

namespace unfurl::sim::rigid_deployment_test {
namespace {

// The scene with a rigid body in place of each beam.
data::Scene Rigid(data::Scene scene) {
  const auto replace = [&](data::SceneEnd* end) {
    const bool start = end->kind == data::SceneEnd::Kind::kBeamStart;
    if (!start && end->kind != data::SceneEnd::Kind::kBeamEnd) return;
    const data::SceneBeam& beam = scene.beams[end->index];
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
      if (scene.bodies[b].name == beam.name) end->index = static_cast<int>(b);
    }
    end->kind = data::SceneEnd::Kind::kBody;
    end->point = {start ? -0.5 * beam.length : 0.5 * beam.length, 0.0};
  };
  for (const data::SceneBeam& beam : scene.beams) {
    data::SceneBody body;
    body.name = beam.name;
    body.mass = beam.mass;
    body.inertia = beam.mass * beam.length * beam.length / 12.0;
    scene.bodies.push_back(body);
  }
  for (auto& weld : scene.welds) replace(&weld.inner), replace(&weld.outer);
  for (auto& mark : scene.marks) replace(&mark.on);
  scene.beams.clear();
  return scene;
}

constexpr int kHub = 0;
constexpr double kStiffness = 0.218, kPreload = 1.57;

// Which angles make up each joint's: theta = offset + plus - minus.
struct JointAngle {
  int plus, minus;
  double offset;
};
constexpr JointAngle kJoints[4] = {{1, kHub, 0.0}, {1, 2, 0.0}, {kHub, 3, M_PI}, {4, 3, 0.0}};

reference::AngleTree Tree() {
  reference::AngleTree tree(5, true);
  const double half = 0.153, half_inertia = 1.25e-4;  // joint halves
  const auto add = [&](double mass, double inertia, int angle,
                       std::vector<reference::AngleTree::Complex> arm) {
    arm.resize(5);
    tree.bodies.push_back({mass, inertia, angle, arm});
  };
  add(36.0, 0.38, kHub, {});
  for (const int side : {1, -1}) {
    const int root = side > 0 ? 1 : 3, outer = root + 1;
    const double pin = 0.18 * side;
    const auto on = [&](int angle, double from_pin) {
      std::vector<reference::AngleTree::Complex> arm(5);
      arm[kHub] = pin;
      if (angle == outer) arm[root] = 0.84;
      arm[angle] = from_pin;
      return arm;
    };
    add(half, half_inertia, kHub, {0.17 * side});
    add(half, half_inertia, root, on(root, 0.01));
    add(0.424, 0.424 * 0.64 / 12, root, on(root, 0.42));
    add(half, half_inertia, root, on(root, 0.83));
    add(half, half_inertia, outer, on(outer, 0.01));
    const double mass = side > 0 ? 0.424 : 0.382;
    add(mass, mass * 0.64 / 12, outer, on(outer, 0.42));
  }
  return tree;
}

struct Happened {
  double t;
  int joint;
  bool latch, start;
};

TEST(RigidDeployment, TwoFormulationsAgree) {
#ifdef UNFURL_SLOW_TESTS
  constexpr double kDuration = 1.4;  // two latches, some 150 contacts begun or ended
#else
  constexpr double kDuration = 0.8;  // the same latches and the first impacts
#endif
  constexpr int kSamples = 400;
  SimulateOptions options;
  options.rtol = 1e-12;
  options.duration = kDuration;
  options.rate = kSamples / kDuration;
  const Recorder run = Record(Compile(Rigid(ReadSet("deployment/scene_clearance.toml"))), options);

  reference::AngleTree tree = Tree();
  const reference::ContactLaw law = reference::PaperLaw();
  std::vector<bool> latched(4, false);
  std::vector<Happened> happened;
  const auto theta = [&](const auto& y, int j) {
    return kJoints[j].offset + tree.phi(y, kJoints[j].plus) - tree.phi(y, kJoints[j].minus);
  };
  const auto rate = [&](const auto& y, int j) {
    return tree.rate(y, kJoints[j].plus) - tree.rate(y, kJoints[j].minus);
  };
  tree.load = [&](double, const auto& y, reference::AngleTree::Forces& forces) {
    for (int j = 0; j < 4; ++j) {
      const double moment =
          -kStiffness * (theta(y, j) + kPreload) + law.Moment(latched[j], theta(y, j), rate(y, j));
      forces.on_angle[kJoints[j].plus] += moment;
      forces.on_angle[kJoints[j].minus] -= moment;
    }
  };
  reference::Integrator integrator;
  integrator.largest_step = [&](const auto& y) {
    double least = 1e-2;
    for (int j = 0; j < 4; ++j) least = std::min(least, law.LargestStep(theta(y, j), rate(y, j)));
    return least;
  };
  constexpr int kBranches = reference::ContactLaw::kBranches;
  for (int j = 0; j < 4; ++j) {
    for (int b = 0; b < kBranches; ++b) {
      integrator.guards.push_back(
          [&, j, b](double, const auto& y) { return law.Branch(b, theta(y, j), rate(y, j)); });
    }
  }
  integrator.crossing = [&](int guard, bool positive, double t, auto&) {
    const int j = guard / kBranches, branch = guard % kBranches;
    if (branch > 1) return;
    if (branch == 0 && !latched[j]) {
      latched[j] = true;
      happened.push_back({t, j, true, false});
    } else {
      happened.push_back({t, j, false, positive});
    }
  };
  const double up = M_PI_2;  // both root beams; the outer ones are folded back on them
  std::vector<double> y0(14, 0.0);
  y0[3] = up, y0[4] = up - M_PI, y0[5] = M_PI - up, y0[6] = M_PI - up + M_PI;
  const auto states =
      integrator.Run([&](double t, const auto& y, auto& dydt) { tree.RightSide(t, y, dydt); }, y0,
                     reference::EvenTimes(kDuration, kSamples));

  // Before the first impact, and after it.
  double first_impact = kDuration;
  for (const Happened& h : happened) {
    if (!h.latch) first_impact = std::min(first_impact, h.t);
  }
  ASSERT_GT(first_impact, 0.5);
  const std::vector<double> x = run["hub.x"], y = run["hub.y"], phi = run["hub.theta"];
  std::vector<std::vector<double>> angles;
  for (int j = 0; j < 4; ++j) angles.push_back(run["joint" + std::to_string(j + 1) + ".theta"]);
  double before = 0.0, after = 0.0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    const auto& s = states[k];
    double worst =
        std::max({std::fabs(x[k] - s[0]), std::fabs(y[k] - s[1]), std::fabs(phi[k] - s[2])});
    for (int j = 0; j < 4; ++j) worst = std::max(worst, std::fabs(angles[j][k] - theta(s, j)));
    (run.t[k] < first_impact ? before : after) =
        std::max(run.t[k] < first_impact ? before : after, worst);
  }
  ExpectWithin("rigid deployment, before the first impact [m, rad]", before, 1e-10);
  // Every impact multiplies an error by its slope in the time of touching.
  ExpectWithin("rigid deployment, after it [m, rad]", after, 1e-7);
  ASSERT_EQ(run.report.events.size(), happened.size());
  double latch_time = 0.0, event_time = 0.0;
  for (std::size_t k = 0; k < happened.size(); ++k) {
    const Event& e = run.report.events[k];
    EXPECT_EQ(e.joint, happened[k].joint) << k;
    EXPECT_EQ(e.kind == EventKind::kLatch, happened[k].latch) << k;
    double& worst = happened[k].latch ? latch_time : event_time;
    worst = std::max(worst, std::fabs(e.t - happened[k].t));
  }
  ExpectWithin("rigid deployment, times of latching [s]", latch_time, 1e-11);
  ExpectWithin("rigid deployment, times of " + std::to_string(happened.size()) + " events [s]",
               event_time, 1e-6);
}

}  // namespace
}  // namespace unfurl::sim::rigid_deployment_test
