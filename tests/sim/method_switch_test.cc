#include "sim/methods/method_switch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace unfurl::sim::method_switch_test {
namespace {

// A scene as the two methods see it: what a right side of each gains at time t, and whether
// stability limits the explicit one.
struct Scene {
  const char* name;
  double (*explicit_speed)(double t);
  double (*implicit_speed)(double t);
  bool (*unstable)(double t);
};
void PrintTo(const Scene& scene, std::ostream* out) { *out << scene.name; }

constexpr double kExplicitCost = 6.0, kImplicitCost = 13.0;  // right sides a step

// Work to go from 0 to `end` by the switch, and by always taking the faster method.
struct Work {
  double ours = 0.0, best_of_two = 0.0, best_at_each = 0.0;
  int changes = 0;
};

Work Spend(const Scene& scene, bool implicit_first, double end) {
  MethodSwitch decide(implicit_first);
  Work work;
  double t = 0.0;
  while (t < end) {
    const bool implicit = decide.implicit();
    const double speed = implicit ? scene.implicit_speed(t) : scene.explicit_speed(t);
    const double cost = implicit ? kImplicitCost : kExplicitCost;
    work.ours += cost;
    work.best_at_each += cost * speed / std::max(scene.explicit_speed(t), scene.implicit_speed(t));
    t += speed * cost;
    if (decide.Note(speed * cost, cost, !implicit && scene.unstable(t))) ++work.changes;
  }
  double alone[2] = {0.0, 0.0};
  constexpr int kParts = 100000;
  for (int k = 0; k < kParts; ++k) {
    const double at = (k + 0.5) * end / kParts;
    alone[0] += end / kParts / scene.explicit_speed(at);
    alone[1] += end / kParts / scene.implicit_speed(at);
  }
  work.best_of_two = std::min(alone[0], alone[1]);
  return work;
}

class Switches : public testing::TestWithParam<Scene> {};

// Whatever method it begins with, a run of 200,000 right sides of the better one costs at most a
// twentieth more than that: the promise of `auto` is twice.
TEST_P(Switches, CostsLittleMoreThanTheBetterMethod) {
  constexpr double kWork = 200000.0, kMore = 1.05;
  for (const bool implicit_first : {false, true}) {
    const double trial = Spend(GetParam(), implicit_first, 1.0).best_of_two;
    const Work work = Spend(GetParam(), implicit_first, kWork / trial);
    EXPECT_LT(work.ours, kMore * work.best_of_two) << implicit_first;
  }
}

double One(double) { return 1.0; }
double Tenth(double) { return 0.1; }
double Thousandth(double) { return 0.001; }
double Third(double) { return 0.3; }
bool Always(double) { return true; }
bool Never(double) { return false; }
// Stiff for a while, now and then.
double Now(double t) { return std::fmod(t, 40000.0) < 8000.0 ? 0.01 : 1.0; }
bool NowAndThen(double t) { return std::fmod(t, 40000.0) < 8000.0; }

INSTANTIATE_TEST_SUITE_P(MethodSwitch, Switches,
                         testing::Values(Scene{"stiff", Thousandth, One, Always},
                                         Scene{"rather stiff", Tenth, One, Always},
                                         Scene{"explicit is better though unstable", One, Third,
                                               Always},
                                         Scene{"not stiff", One, Third, Never},
                                         Scene{"at times", Now, Third, NowAndThen}));

// Stability that does not limit the explicit method is no reason to try the other.
TEST(MethodSwitch, LeavesAStableMethodAlone) {
  EXPECT_EQ(Spend({"", One, One, Never}, false, 1e5).changes, 0);
}

// Where what is stiff comes and goes, both are used, each where it is faster.
TEST(MethodSwitch, FollowsWhatIsStiff) {
  const Work work = Spend({"", Now, Third, NowAndThen}, false, 400000.0);
  EXPECT_GE(work.changes, 10);
  EXPECT_LT(work.ours, 1.2 * work.best_at_each);
}

}  // namespace
}  // namespace unfurl::sim::method_switch_test
