#include "data/run.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "tests/own_folder.h"

namespace unfurl::data {
namespace {

class RunFile : public ::testing::Test {
 protected:
  // More rows than one buffer of the writer holds.
  static constexpr int kRows = 2500;
  static RunLayout Layout() {
    RunLayout layout;
    layout.quantities = {{"hub.x", "m", "position"}, {"m1.x", "m", "mark"}, {"m1.y", "m", "mark"}};
    layout.marks = {"m1"};
    layout.shapes = {{"beam", {0.0, 0.5, 1.0}}, {"rod", {0.0, 2.0}}};
    layout.event_data = {{"theta_rate", "rad/s", "rate"}, {"restitution", "1", "of the impact"}};
    layout.event_places = {"joint1", "joint2"};
    layout.summary = {{"steps", "1", "steps taken"}, {"late", "s", "never set"}};
    layout.text = {{"scene", std::string(100000, 'x')}};
    return layout;
  }
  static void AppendRows(RunWriter* writer, int rows, double first_value = 0.0) {
    for (int i = 0; i < rows; ++i) {
      const double values[] = {i == 0 ? first_value : std::sqrt(i), 0.1 * i, -0.1 * i};
      writer->Append(1e-3 * i, values);
    }
  }
  void Write(double first_value = 0.0, bool commit = true) {
    RunWriter writer(path_, {.program = "test", .command = "test"}, Layout());
    AppendRows(&writer, kRows, first_value);
    for (int i = 0; i < kRows / 20; ++i) {
      const double points[] = {0, 0, 0.5, 0.1 * i, 1, 0, 7, 8, 9, 1.0 * i};
      writer.AppendShapes(0.02 * i, points);
    }
    writer.AddEvent({0.5, "latch", "joint1", {{"theta_rate [rad/s]", -3.5}}});
    writer.AddEvent({0.7, "contact_end", "joint2", {{"restitution [1]", 0.3}}});
    writer.SetSummary("steps", 1234.0);
    writer.SetText("status", "good");
    if (commit) writer.Commit();
  }
  static std::string Bytes(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }

  OwnFolder folder_;
  std::string path_ = folder_.File("run.h5");
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
  EXPECT_EQ(run.summary.count("late"), 0u);
  EXPECT_EQ(run.text.at("scene").size(), 100000u);
  EXPECT_EQ(run.text.at("status"), "good");
  EXPECT_EQ(run.text.count("message"), 0u);
}

TEST_F(RunFile, HoldsBeamShapesAtTheirOwnTimes) {
  Write();
  const H5Reader file(path_, kRunSchema, kRunVersion);
  EXPECT_EQ(file.Dims("/beam_shape_t"), std::vector<std::size_t>{kRows / 20});
  EXPECT_EQ(file.Dims("/beam_shape/beam"), (std::vector<std::size_t>{kRows / 20, 3, 2}));
  EXPECT_EQ(file.Dims("/beam_shape/rod"), (std::vector<std::size_t>{kRows / 20, 2, 2}));
  EXPECT_EQ(file.ReadDoubles("/beam_place/beam", "m"), (std::vector<double>{0.0, 0.5, 1.0}));
  const std::vector<double> beam = file.ReadDoubles("/beam_shape/beam", "m");
  const std::vector<double> rod = file.ReadDoubles("/beam_shape/rod", "m");
  EXPECT_EQ(beam[100 * 6 + 3], 0.1 * 100);
  EXPECT_EQ(rod[100 * 4 + 3], 100.0);
}

TEST_F(RunFile, SameRunSameBytes) {
  Write();
  const std::string once = Bytes(path_);
  Write();
  EXPECT_EQ(once, Bytes(path_));
}

TEST_F(RunFile, LeavesNothingWithoutCommit) {
  Write(0.0, false);
  EXPECT_FALSE(std::filesystem::exists(path_));
  EXPECT_FALSE(std::filesystem::exists(path_ + ".partial"));
}

TEST_F(RunFile, KeepLeavesThePartial) {
  {
    RunWriter writer(path_, {.program = "test", .command = "test"}, Layout());
    AppendRows(&writer, 10);
    writer.SetText("status", "interrupted");
    writer.Keep();
  }
  EXPECT_FALSE(std::filesystem::exists(path_));
  const data::Run run = ReadRun(path_ + ".partial");
  EXPECT_EQ(run.t.size(), 10u);
  EXPECT_EQ(run.text.at("status"), "interrupted");
}

TEST_F(RunFile, CanBeReadAfterItsWriterWasKilled) {
  constexpr int kFlushed = 1500, kAll = 1700;  // one full buffer, and a part of one
  const pid_t child = fork();
  if (child == 0) {
    RunWriter writer(path_, {.program = "test", .command = "test"}, Layout());
    AppendRows(&writer, kFlushed);
    writer.AddEvent({0.5, "latch", "joint1", {{"theta_rate [rad/s]", -3.5}}});
    writer.Flush();
    for (int i = kFlushed; i < kAll; ++i) {
      const double values[] = {0.0, 0.0, 0.0};
      writer.Append(1e-3 * i, values);
    }
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  const data::Run run = ReadRun(path_ + ".partial");
  ASSERT_EQ(run.t.size(), static_cast<std::size_t>(kFlushed));
  EXPECT_EQ(run.Column("hub.x")[1499], std::sqrt(1499.0));
  ASSERT_EQ(run.events.size(), 1u);
  EXPECT_EQ(run.events[0].data.at("theta_rate [rad/s]"), -3.5);
  EXPECT_EQ(run.text.at("status"), kRunning);
}

TEST_F(RunFile, TwoWritersOfOneNameAreRefused) {
  const RunWriter first(path_, {.program = "test", .command = "test"}, Layout());
  EXPECT_THROW(RunWriter(path_, {.program = "test", .command = "test"}, Layout()), Error);
}

TEST_F(RunFile, SizeIsKnownBefore) {
  // By how much a file grows, so that what is fixed does not count.
  constexpr int kFew = 10'000, kMany = 60'000;
  constexpr double kPart = 0.01;  // of the growth: the indices of chunks grow in blocks
  double size[2];
  for (const bool many : {false, true}) {
    RunWriter writer(path_, {.program = "test", .command = "test"}, Layout());
    AppendRows(&writer, many ? kMany : kFew);
    writer.Commit();
    size[many] = static_cast<double>(std::filesystem::file_size(path_));
  }
  const double expected =
      RunWriter::FileSize(Layout(), kMany, 0.0) - RunWriter::FileSize(Layout(), kFew, 0.0);
  EXPECT_NEAR(size[1] - size[0], expected, kPart * expected);
}

TEST_F(RunFile, RefusesValuesThatAreNotFinite) {
  Write(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW(ReadRun(path_), Error);
}

TEST_F(RunFile, WithoutEvents) {
  {
    RunLayout layout;
    layout.quantities = {{"a.x", "m", "a"}};
    RunWriter writer(path_, {.program = "test", .command = "test"}, layout);
    const double value = 1.0;
    writer.Append(0.0, std::span<const double>(&value, 1));
    writer.Commit();
  }
  EXPECT_TRUE(ReadRun(path_).events.empty());
}

}  // namespace
}  // namespace unfurl::data
