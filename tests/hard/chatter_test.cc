// A bar that bounces in a latch with hardly any loss: impacts follow one another ever faster and
// ever smaller. Success: the run ends in bounded time with every impact counted, the list of events
// in memory bounded, and no event lost to the observer.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "data/scene.h"
#include "sim/methods/event_log.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::sim::chatter_test {
namespace {

std::string Rattle(double duration, double damping, double clearance) {
  return fmt::format(
      "[scene]\nname = \"rattle\"\nduration = {}\n"
      "[contact.lock]\nK = 5e9\nC = {}\nQ = 3.0\nepsilon = 5e-6\n"
      "[body.bar]\nmass = 0.5\ninertia = 0.02\n"
      "[joint.hinge]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.3, 0.0]\n"
      "theta = {}\ntheta_rate = -4.0\n"
      "[joint.hinge.spring]\nstiffness = 0.218\npreload = 1.57\n"
      "[joint.hinge.latch]\ntheta_a = {}\ntheta_b = {}\nlever = 0.02\ncontact = \"lock\"\n"
      "[mark.tip]\non = \"bar\"\npoint = [0.3, 0.0]\n",
      duration, damping, clearance, clearance, clearance);
}

struct Counting : Observer {
  void OnEvent(const Event& event) override {
    ++events;
    starts += event.kind == EventKind::kContactStart ? 1 : 0;
    EXPECT_GE(event.t, last);
    last = event.t;
  }
  long events = 0, starts = 0;
  double last = 0.0;
};

TEST(Chatter, LongChatterFinishes) {
  Counting counting;
  SimulateOptions options;
  options.rtol = 1e-5;
  options.track_energy = false;
  const Model model = Compile(data::ParseScene(Rattle(45.0, 0.0, 1e-4), "rattle.toml"));
  const SimulateReport report = Simulate(model, options, &counting);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_EQ(report.Count(EventKind::kContactStart), counting.starts);
  EXPECT_EQ(report.latch_counts[0].upper + report.latch_counts[0].lower, counting.starts);
  EXPECT_GT(counting.events, 2 * EventLog::kKept);
  EXPECT_EQ(report.events.size(), 2u * EventLog::kKept);
  EXPECT_EQ(report.events_left_out, counting.events - 2 * EventLog::kKept);
  EXPECT_EQ(report.events.back().t, counting.last);
}

TEST(Chatter, WithoutClearanceItComesToRest) {
  // Both stops touch at theta = 0: each swing through it ends one contact and begins the other.
  Counting counting;
  SimulateOptions options;
  options.rtol = 1e-6;
  const Model model = Compile(data::ParseScene(Rattle(2.0, 4000.0, 0.0), "rattle.toml"));
  const SimulateReport report = Simulate(model, options, &counting);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_GT(counting.starts, 10);
  // At rest the spring holds it against the lower stop.
  EXPECT_LT(report.events.back().t, 2.0);
  EXPECT_EQ(report.events.back().kind, EventKind::kContactStart);
  EXPECT_FALSE(report.events.back().upper);
}

}  // namespace
}  // namespace unfurl::sim::chatter_test
