#include "data/run.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "base/error.h"

namespace unfurl::data {
namespace {

class RunFile : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() /
             ("unfurl_run_test_" + std::to_string(::getpid()) + ".h5"))
                .string();
  }
  void TearDown() override { std::filesystem::remove(path_); }

  // More rows than one buffer of the writer holds.
  static constexpr int kRows = 2500;
  void Write(double first_value = 0.0, bool commit = true) {
    RunWriter writer(path_, {.program = "test", .command = "test"},
                     {{"hub.x", "m", "position"}, {"m1.x", "m", "mark"}, {"m1.y", "m", "mark"}},
                     {"m1"});
    for (int i = 0; i < kRows; ++i) {
      const double values[] = {i == 0 ? first_value : std::sqrt(i), 0.1 * i, -0.1 * i};
      writer.Append(1e-3 * i, values);
    }
    writer.AddEvent({0.5, "latch", "joint1", {{"theta_rate [rad/s]", -3.5}}});
    writer.AddEvent({0.7, "contact_end", "joint2", {{"restitution [1]", 0.3}}});
    writer.SetSummary("steps", 1234.0, "1");
    writer.SetText("scene", std::string(100000, 'x'));
    if (commit) writer.Commit();
  }

  std::string path_;
};

TEST_F(RunFile, ReadsBackWhatWasWritten) {
  Write();
  const data::Run run = ReadRun(path_);
  ASSERT_EQ(run.t.size(), static_cast<std::size_t>(kRows));
  ASSERT_EQ(run.quantities.size(), 3u);
  EXPECT_EQ(run.quantities[0].name, "hub.x");  // in the order of writing
  EXPECT_EQ(run.quantities[0].units, "m");
  EXPECT_EQ(run.Column("hub.x")[2400], std::sqrt(2400.0));
  EXPECT_EQ(run.Column("m1.y")[1500], -0.1 * 1500);
  EXPECT_EQ(run.Find("hub.y"), -1);
  EXPECT_THROW(run.Column("hub.y"), Error);
  EXPECT_EQ(run.marks, std::vector<std::string>{"m1"});
  ASSERT_EQ(run.events.size(), 2u);
  EXPECT_EQ(run.events[0].kind, "latch");
  EXPECT_EQ(run.events[0].where, "joint1");
  EXPECT_EQ(run.events[0].data.at("theta_rate [rad/s]"), -3.5);
  EXPECT_EQ(run.events[0].data.count("restitution [1]"), 0u);
  EXPECT_EQ(run.events[1].data.at("restitution [1]"), 0.3);
  EXPECT_EQ(run.summary.at("steps"), 1234.0);
  EXPECT_EQ(run.text.at("scene").size(), 100000u);
}

TEST_F(RunFile, LeavesNothingWithoutCommit) {
  Write(0.0, false);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(RunFile, RefusesValuesThatAreNotFinite) {
  Write(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW(ReadRun(path_), Error);
}

TEST_F(RunFile, WithoutEvents) {
  {
    RunWriter writer(path_, {.program = "test", .command = "test"}, {{"a.x", "m", "a"}}, {});
    const double value = 1.0;
    writer.Append(0.0, std::span<const double>(&value, 1));
    writer.Commit();
  }
  EXPECT_TRUE(ReadRun(path_).events.empty());
}

}  // namespace
}  // namespace unfurl::data
