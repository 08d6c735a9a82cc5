// Edges of a switch that bounces, by contacts written down by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.h"
#include "correlate/residual/timed_events.h"
#include "study/trial_observations.h"
#include "tests/study/swing.h"

namespace unfurl::study::switch_test {
namespace {

class Switch : public SwingTest {
 protected:
  // A line a millisecond, from 0 to 1 s: closed within each of the intervals [ms].
  void Record(const std::vector<std::pair<int, int>>& closed) const {
    std::string text = "t [s],contact [V]\n";
    for (int i = 0; i <= 1000; ++i) {
      bool on = false;
      for (const auto& [from, to] : closed) on = on || (i >= from && i < to);
      text += fmt::format("{:.4f},{}\n", 1e-3 * i, on ? 4.9 : 0.1);
    }
    Put("switch.csv", text);
    Put("angle.csv", "t [s],angle [rad]\n0,0.1\n0.3,0.2\n0.6,0.4\n0.9,0.3\n1,0.1\n");
  }
  std::vector<correlate::TimedEvent> Edges(const std::string& more) const {
    Put("scene.toml", Scene(Laws{}));
    const data::Study study = data::ReadStudy(
        Put("study.toml",
            "[study]\nscene = \"scene.toml\"\n[trial]\noffset = 0.0\n[trial.channel.angle]\n"
            "file = \"angle.csv\"\nquantity = \"hinge.theta\"\n[trial.channel.contact]\n"
            "file = \"switch.csv\"\nevent = \"latch\"\njoint = \"hinge\"\n" +
                more +
                "[parameter.start]\nkeys = [\"joint.hinge.theta\"]\nstart = 0.5\n"
                "bounds = [0.1, 1.0]\n"));
    correlate::Observations out;
    AddChannels(study.trials[0], nullptr, &out);
    return dynamic_cast<const correlate::TimedEvents&>(*out.others.at(1)).events();
  }
};

TEST_F(Switch, BouncesWithinTheStatedTimeAreOneEdge) {
  // Closes at 200 ms with three bounces, opens at 600 with two, and closes again at 800; something
  // disturbs it at 400.
  Record({{200, 201}, {203, 204}, {206, 600}, {602, 603}, {400, 401}, {800, 1001}});
  EXPECT_EQ(Edges("").size(), 5U);
  const auto edges = Edges("bounce = 5e-3\n");
  ASSERT_EQ(edges.size(), 2U);
  constexpr double kRounding = 1e-12;  // of stamps below a second [s]
  EXPECT_NEAR(edges[0].t, 0.1995, kRounding);
  EXPECT_NEAR(edges[1].t, 0.7995, kRounding);
  EXPECT_EQ(edges[1].count, 2);
  EXPECT_NEAR(edges[0].sigma, 1e-3 / std::sqrt(12.0), kRounding);
  const auto opens = Edges("bounce = 5e-3\nedge = \"falling\"\n");
  ASSERT_EQ(opens.size(), 1U);
  EXPECT_NEAR(opens[0].t, 0.5995, kRounding);
}

TEST_F(Switch, ADisturbanceThatLeavesTheLevelAsItWasIsNoEdge) {
  Record({{300, 302}, {500, 1001}});
  const auto edges = Edges("bounce = 5e-3\n");
  ASSERT_EQ(edges.size(), 1U);
  EXPECT_NEAR(edges[0].t, 0.4995, 1e-12);
}

TEST_F(Switch, OneEdgeByItsNumber) {
  Record({{200, 300}, {500, 600}, {800, 1001}});
  const auto edges = Edges("count = 2\n");
  ASSERT_EQ(edges.size(), 1U);
  EXPECT_EQ(edges[0].count, 2);
  EXPECT_NEAR(edges[0].t, 0.4995, 1e-12);
  EXPECT_THROW(Edges("count = 4\n"), Error);
}

}  // namespace
}  // namespace unfurl::study::switch_test
