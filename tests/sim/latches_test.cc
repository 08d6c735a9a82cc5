#include "sim/effects/latches.h"

#include <gtest/gtest.h>

#include <cmath>

#include "data/scene.h"
#include "scenes.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::latches_test {
namespace {

constexpr double kInertia = 0.02 + 0.5 * 0.3 * 0.3;  // of the latching bar about its hinge
constexpr double kStiffness = 0.218, kPreload = 1.57;

TEST(ContactLaw, PaperConstants) {
  // Values of section 5, worked out by hand from eq. (15), (16) and (19).
  const double K = data::HertzStiffness(0.005, INFINITY, 2.01e11, 0.3, 6.895e10, 0.3);
  const double h = 0.91 / M_PI * (1 / 2.01e11 + 1 / 6.895e10);
  EXPECT_NEAR(K, 4 / (3 * M_PI * h) * std::sqrt(0.005), 1e-6 * K);
  EXPECT_NEAR(K, 5.319e9, 0.001e9);
  EXPECT_NEAR(data::ContactDamping(0.424, 3.2e9, 0.85), 3806.0, 1.0);
}

TEST(ContactLaw, DepthForceAndClamp) {
  Latches latches;
  data::SceneLatch latch;
  latch.theta_a = 0.005, latch.theta_b = 0.004, latch.lever = 0.02;
  data::SceneContact contact;
  contact.K = 5e9, contact.C = 4000.0, contact.Q = 3.0, contact.epsilon = 5e-6;
  latches.Add(Hinge{0, 1, 1.0, 0.0}, latch, contact);
  contact.never_pulls = false;
  latches.Add(Hinge{0, 1, 1.0, 0.0}, latch, contact);
  EXPECT_EQ(latches.At(0, true, 0.005, 1.0).force, 0.0);  // T = 0 at delta = 0
  // Deep: T = 1.
  const Latches::Contact deep = latches.At(0, true, 0.006, 0.5);
  EXPECT_NEAR(deep.depth, 2e-5, 1e-18);
  EXPECT_NEAR(deep.force, 5e9 * std::pow(2e-5, 1.5) + 4000 * 0.01, 1e-9);
  EXPECT_NEAR(deep.stored, 0.4 * 5e9 * std::pow(2e-5, 2.5), 1e-15);
  // Within the transition zone, at the lower stop.
  const Latches::Contact shallow = latches.At(0, false, -0.0041, -0.5);
  EXPECT_NEAR(shallow.depth, 2e-6, 1e-18);
  EXPECT_NEAR(shallow.depth_rate, 0.01, 1e-15);
  const double T = std::exp(2 * (2e-6 - 5e-6) * 3.0 / 5e-6);
  EXPECT_NEAR(shallow.force, 5e9 * std::pow(2e-6, 1.5) + 4000 * T * 0.01, 1e-9);
  // Leaving fast: the printed law pulls, ours lets go.
  const Latches::Contact held = latches.At(0, true, 0.006, -50.0);
  EXPECT_TRUE(held.held);
  EXPECT_EQ(held.force, 0.0);
  EXPECT_LT(latches.At(1, true, 0.006, -50.0).force, 0.0);
}

// The bar's angle by a second way: its one equation in theta, fourth-order Runge-Kutta with steps
// of 0.1 us in contact, the phases switched by hand.
struct Reference {
  double latch = 0.0;  // [s]
  std::vector<double> starts, ends, restitution;
  std::vector<double> theta;  // every millisecond
};
Reference OneDegreeOfFreedom(const data::Scene& scene, double duration) {
  const auto& law = *scene.joints[0].latch;
  const auto& c = scene.contacts[0];
  const auto moment = [&](double th, double w, bool latched) {
    double M = -kStiffness * (th + kPreload);
    for (const double side : {1.0, -1.0}) {
      if (side > 0 && !latched) continue;
      const double d = law.lever * (side * th - (side > 0 ? law.theta_a : law.theta_b));
      if (d <= 0.0) continue;
      const double T = d < c.epsilon ? std::exp(2 * (d - c.epsilon) * c.Q / c.epsilon) : 1.0;
      M -=
          side * law.lever * std::max(0.0, c.K * std::pow(d, 1.5) + c.C * T * law.lever * side * w);
    }
    return M / kInertia;
  };
  Reference r;
  double t = 0.0, th = scene.joints[0].theta, w = 0.0, w_start = 0.0, next = 0.0;
  bool latched = false, in_contact = false;
  const auto step = [&](double h, double* th_new, double* w_new) {
    const double k1 = moment(th, w, latched), l1 = w;
    const double k2 = moment(th + h / 2 * l1, w + h / 2 * k1, latched), l2 = w + h / 2 * k1;
    const double k3 = moment(th + h / 2 * l2, w + h / 2 * k2, latched), l3 = w + h / 2 * k2;
    const double k4 = moment(th + h * l3, w + h * k3, latched), l4 = w + h * k3;
    *th_new = th + h / 6 * (l1 + 2 * l2 + 2 * l3 + l4);
    *w_new = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  };
  // Changes whenever a level is passed.
  const auto zone = [&](double angle) {
    return angle < -law.theta_b ? -1 : angle > law.theta_a ? 1 : 0;
  };
  while (t < duration) {
    if (t >= next - 1e-12) {
      r.theta.push_back(th);
      next += 1e-3;
    }
    double h = std::min(th < law.theta_a + 0.01 ? 2e-7 : 1e-5, next - t);
    double th_new = 0.0, w_new = 0.0;
    step(h, &th_new, &w_new);
    const int from = zone(th);
    if (zone(th_new) != from) {  // land just past the level
      double low = 0.0;
      for (int k = 0; k < 50; ++k) {
        const double middle = 0.5 * (low + h);
        step(middle, &th_new, &w_new);
        (zone(th_new) != from ? h : low) = middle;
      }
      step(h, &th_new, &w_new);
    }
    th = th_new;
    w = w_new;
    t += h;
    if (zone(th) == from) continue;
    if (!latched && zone(th) == 0) {
      latched = true;
      r.latch = t;
      continue;
    }
    if (!in_contact) {
      r.starts.push_back(t);
      w_start = w;
    } else {
      r.ends.push_back(t);
      r.restitution.push_back(-w / w_start);
    }
    in_contact = !in_contact;
  }
  return r;
}

struct Collected : Observer {
  explicit Collected(const Model& m) : model(m) {}
  void OnSample(double, double* state, const std::vector<LatchMode>&) override {
    const Hinge& h = model.latches.hinge(0);
    theta.push_back(h.sign * (state[model.index.theta(h.outer)] - h.zero));
  }
  const Model& model;
  std::vector<double> theta;
};

// Both resolve one contact to some 1e-9 of its restitution; each impact hands its error on to the
// next, about doubling it each time the gap is crossed, and thirty follow within the second.
constexpr double kRatio = 1e-5, kTimes = 1e-7 /* [s] */, kAngle = 1e-6 /* [rad] */;

TEST(LatchingBar, AgreesWithOneDegreeOfFreedom) {
  const data::Scene scene = data::ParseScene(LatchingBarScene(), "bar.toml");
  constexpr double kDuration = 1.0;
  const Reference reference = OneDegreeOfFreedom(scene, kDuration);
  const Model model = Compile(scene);
  Collected collected(model);
  SimulateOptions options;
  options.duration = kDuration;
  options.rtol = 1e-11;
  const SimulateReport report = Simulate(model, options, &collected);
  ASSERT_TRUE(report.Usable()) << report.message;
  std::vector<double> starts, ends, restitution;
  double latch = -1.0;
  for (const Event& e : report.events) {
    if (e.kind == EventKind::kLatch) latch = e.t;
    if (e.kind == EventKind::kContactStart) starts.push_back(e.t);
    if (e.kind == EventKind::kContactEnd) ends.push_back(e.t), restitution.push_back(e.restitution);
  }
  // Until the latch the motion is a cosine: the time is known in closed form.
  const double omega = std::sqrt(kStiffness / kInertia);
  const double expected = std::acos((0.0052 + kPreload) / (M_PI_2 + kPreload)) / omega;
  EXPECT_NEAR(latch, expected, 1e-9);
  EXPECT_NEAR(latch, reference.latch, 1e-9);
  ASSERT_EQ(starts.size(), reference.starts.size());
  ASSERT_EQ(ends.size(), reference.ends.size());
  ASSERT_GT(ends.size(), 3u);
  for (std::size_t k = 0; k < ends.size(); ++k) {
    EXPECT_NEAR(starts[k], reference.starts[k], kTimes) << k;
    EXPECT_NEAR(ends[k], reference.ends[k], kTimes) << k;
    EXPECT_NEAR(restitution[k], reference.restitution[k], kRatio) << k;
    EXPECT_LT(restitution[k], 1.0);
  }
  ASSERT_LE(collected.theta.size(), reference.theta.size() + 1);
  for (std::size_t i = 0; i < std::min(collected.theta.size(), reference.theta.size()); ++i) {
    EXPECT_NEAR(collected.theta[i], reference.theta[i], kAngle) << i;
  }
}

TEST(LatchingBar, StartsClosedBelowThetaA) {
  std::string text = LatchingBarScene();
  text.replace(text.find("theta = 1.5707963267948966"), 26, "theta = 0.001");
  const Model model = ModelFrom(text);
  EXPECT_EQ(model.initial_modes[0].latched, 1);
  SimulateOptions options;
  options.duration = 0.05;
  EXPECT_EQ(Simulate(model, options, nullptr).Count(EventKind::kLatch), 0);
}

TEST(LatchingBar, LatchesOnceAndNeverReopens) {
  const Model model = ModelFrom(LatchingBarScene());
  SimulateOptions options;
  options.duration = 5.0;
  const SimulateReport report = Simulate(model, options, nullptr);
  ASSERT_TRUE(report.Usable());
  EXPECT_EQ(report.Count(EventKind::kLatch), 1);
  // Every contact ends before the next on that stop starts.
  int active[2] = {0, 0};
  double last = 0.0;
  for (const Event& e : report.events) {
    EXPECT_GE(e.t, last);
    last = e.t;
    int& on = active[e.upper ? 0 : 1];
    if (e.kind == EventKind::kContactStart) {
      EXPECT_EQ(on++, 0);
    } else if (e.kind == EventKind::kContactEnd) {
      EXPECT_EQ(on--, 1);
    }
  }
  EXPECT_GT(report.peak_moment[0], 0.0);
}

TEST(LatchingBar, LongChatterFinishes) {
  // Without clearance the two stops lie on each other and the bar rattles to rest between them.
  const Model model = ModelFrom(LatchingBarScene(0.0));
  SimulateOptions options;
  options.duration = 20.0;
  const SimulateReport report = Simulate(model, options, nullptr);
  EXPECT_TRUE(report.Usable()) << report.message;
  EXPECT_EQ(report.t_end, 20.0);
  EXPECT_GT(report.Count(EventKind::kContactStart), 10);
}

TEST(LatchingBar, PrintedLawPullsAndOursDoesNot) {
  std::string printed = LatchingBarScene();
  printed.replace(printed.find("K = 5e9"), 7, "pull = \"printed\"\nK = 5e9");
  struct LeastForce : Observer {
    explicit LeastForce(const Model& m) : model(m) {}
    void OnSample(double, double* y, const std::vector<LatchMode>& modes) override {
      const int n = model.index.n;
      const Motion motion{0.0,       y,         y + n,   y + 2 * n, y + 3 * n,
                          y + 4 * n, y + 5 * n, nullptr, nullptr};
      if (modes[0].lower_contact) {
        least = std::min(least, model.latches.Moment(0, motion, modes[0]));
      }
    }
    const Model& model;
    double least = 0.0;
  };
  for (const bool as_printed : {true, false}) {
    const Model model = ModelFrom(as_printed ? printed : LatchingBarScene());
    LeastForce observer(model);
    SimulateOptions options;
    options.duration = 1.5;
    options.rate = 50000;
    ASSERT_TRUE(Simulate(model, options, &observer).Usable());
    if (as_printed) {
      EXPECT_LT(observer.least, -1e-3);
    } else {
      EXPECT_EQ(observer.least, 0.0);
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::latches_test
