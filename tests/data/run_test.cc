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
#include "data/h5_walk.h"
#include "tests/own_folder.h"

namespace unfurl::data::run_test {
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
  const RunReader run(path_);
  EXPECT_EQ(run.file().Dims(kShapePoints), (std::vector<std::size_t>{kRows / 20, 5, 2}));
  ASSERT_EQ(run.shapes().size(), 2u);
  EXPECT_EQ(run.shapes()[0].name, "beam");
  EXPECT_EQ(run.shapes()[0].at, (std::vector<double>{0.0, 0.5, 1.0}));
  EXPECT_EQ(run.shape_times().at(100), 0.02 * 100);
  std::vector<double> xy;
  run.ReadShapes(100, 2, &xy);
  ASSERT_EQ(xy.size(), 20u);
  EXPECT_EQ(xy[3], 0.1 * 100);
  EXPECT_EQ(xy[6 + 3], 100.0);
  EXPECT_EQ(xy[10 + 6 + 3], 101.0);
  const data::Run whole = ReadRun(path_, true);
  EXPECT_EQ(whole.shapes.at(1).xy.at(100 * 4 + 3), 100.0);
  EXPECT_EQ(whole.shapes.at(1).name, "rod");
}

// Quantities of one kind lie side by side, unless their units or descriptions differ; what they are
// called and their order come back.
TEST_F(RunFile, QuantitiesOfAKindShareATable) {
  const std::vector<Quantity> quantities = {
      {"b.x", "m", "mark"},         {"b.t", "K", "temperature"}, {"a.x", "m", "mark"},
      {"a.x_of", "1", "whose"},     {"error.a.x", "m", "error"}, {"x", "m", "mark"},
      {"rail.x", "rad", "an angle"}};
  RunLayout layout;
  layout.quantities = quantities;
  {
    RunWriter writer(path_, {.program = "test", .command = "test"}, layout);
    for (int i = 0; i < 3; ++i) {
      std::vector<double> row;
      for (std::size_t q = 0; q < quantities.size(); ++q) {
        row.push_back(10.0 * i + static_cast<double>(q));
      }
      writer.Append(i, row);
    }
    writer.Commit();
  }
  const RunReader reader(path_);
  EXPECT_EQ(reader.file().Dims("/series/x"), (std::vector<std::size_t>{3, 3}));
  EXPECT_EQ(reader.file().ReadStrings("/series/x_of"), (std::vector<std::string>{"b", "a", ""}));
  const data::Run run = ReadRun(path_);
  ASSERT_EQ(run.quantities.size(), quantities.size());
  for (std::size_t q = 0; q < quantities.size(); ++q) {
    EXPECT_EQ(run.quantities[q].name, quantities[q].name);
    EXPECT_EQ(run.quantities[q].units, quantities[q].units) << quantities[q].name;
    EXPECT_EQ(run.quantities[q].description, quantities[q].description) << quantities[q].name;
    const auto value = static_cast<double>(q);
    EXPECT_EQ(run.columns[q], (std::vector<double>{value, 10.0 + value, 20.0 + value}));
    std::vector<double> two(2);
    reader.ReadColumn(reader.Find(quantities[q].name), 1, two);
    EXPECT_EQ(two, (std::vector<double>{10.0 + value, 20.0 + value}));
  }
}

// A chain of a thousand beams: the file has some dozens of datasets, whatever their number, and is
// as large as its numbers are.
TEST_F(RunFile, AThousandOwnersMakeNoMoreDatasets) {
  constexpr int kOwners = 1000, kKinds = 12, kSamples = 20;
  RunLayout layout;
  for (int owner = 0; owner < kOwners; ++owner) {
    for (int kind = 0; kind < kKinds; ++kind) {
      layout.quantities.push_back(
          {"beam" + std::to_string(owner) + ".q" + std::to_string(kind), "m", "a quantity"});
    }
    layout.shapes.push_back({"beam" + std::to_string(owner), {0.0, 0.5, 1.0}});
    layout.summary.push_back({"beam" + std::to_string(owner) + ".peak", "N", "its largest"});
  }
  {
    RunWriter writer(path_, {.program = "test", .command = "test"}, layout);
    std::vector<double> row(layout.quantities.size()), points(6 * kOwners, 0.25);
    for (int i = 0; i < kSamples; ++i) {
      for (std::size_t q = 0; q < row.size(); ++q) row[q] = static_cast<double>(q) + 0.01 * i;
      writer.Append(i, row);
    }
    writer.AppendShapes(0.0, points);
    writer.SetSummary("beam999.peak", 7.0);
    writer.Commit();
  }
  EXPECT_LT(H5ListDatasets(path_).size(), 60u);
  const double size = static_cast<double>(std::filesystem::file_size(path_));
  EXPECT_LT(size, 1.1 * RunWriter::FileSize(layout, kSamples, 1.0));
  EXPECT_GT(size, 0.7 * RunWriter::FileSize(layout, kSamples, 1.0));
  const RunReader run(path_);
  std::vector<double> column(kSamples);
  const int last = run.Find("beam999.q11");
  run.ReadColumn(last, 0, column);
  EXPECT_EQ(column[19], static_cast<double>(last) + 0.01 * 19);
  EXPECT_EQ(ReadRun(path_).summary.at("beam999.peak"), 7.0);
}

// Files of the first version, with a dataset for each quantity, shape and number, stay readable.
TEST_F(RunFile, ReadsTheFirstVersion) {
  {
    H5Writer file(path_, kRunSchema, 1, {.program = "test", .command = "test"});
    const std::vector<double> t = {0.0, 0.1, 0.2}, x = {1.0, 2.0, 3.0}, y = {4.0, 5.0, 6.0};
    file.Write({"/marks", "1", "marks"}, std::vector<std::string>{"m1"});
    file.Write({"/t", "s", "time"}, std::span<const double>(t));
    file.Write({"/series/t", "s", "time"}, std::span<const double>(t));
    file.Write({"/series/m1.y", "m", "mark"}, std::span<const double>(y));
    file.Write({"/series/m1.x", "m", "mark"}, std::span<const double>(x));
    const std::vector<double> times = {0.0, 0.2}, pin = {7.0, 8.0, 9.0, 10.0}, at = {0.0, 2.0},
                              beam = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0};
    file.Write({"/beam_shape_t", "s", "time"}, std::span<const double>(times));
    file.Write({"/beam_shape/rod", "m", "x, y"}, std::span<const double>(beam), {2, 2, 2});
    file.Write({"/beam_place/rod", "m", "places"}, std::span<const double>(at));
    file.Write({"/pin/hinge", "m", "x, y"}, std::span<const double>(pin), {2, 1, 2});
    const std::vector<double> when = {0.15}, rate = {-3.5}, steps = {12.0};
    file.Write({"/events/t", "s", "time"}, std::span<const double>(when));
    file.Write({"/events/kind", "1", "what"}, std::vector<std::string>{"latch"});
    file.Write({"/events/where", "1", "where"}, std::vector<std::string>{"hinge"});
    file.Write({"/events/data/theta_rate", "rad/s", "rate"}, std::span<const double>(rate));
    file.Write({"/summary/steps", "1", "steps taken"}, std::span<const double>(steps));
    file.Write({"/text/status", "1", "in words"}, std::vector<std::string>{"good"});
    file.Commit();
  }
  const data::Run run = ReadRun(path_, true);
  ASSERT_EQ(run.quantities.size(), 2u);
  EXPECT_EQ(run.quantities[0].name, "m1.y");  // in the order of writing
  EXPECT_EQ(run.Column("m1.x"), (std::vector<double>{1.0, 2.0, 3.0}));
  ASSERT_EQ(run.shapes.size(), 2u);
  EXPECT_EQ(run.shapes[0].at, (std::vector<double>{0.0, 2.0}));
  EXPECT_EQ(run.shapes[0].xy, (std::vector<double>{0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0}));
  EXPECT_EQ(run.shapes[1].kind, ShapeKind::kPin);
  EXPECT_EQ(run.shapes[1].xy, (std::vector<double>{7.0, 8.0, 9.0, 10.0}));
  EXPECT_EQ(run.events.at(0).data.at("theta_rate [rad/s]"), -3.5);
  EXPECT_EQ(run.summary.at("steps"), 12.0);
  EXPECT_EQ(run.text.at("status"), "good");
  const RunReader reader(path_);
  std::vector<double> column(2);
  reader.ReadColumn(reader.Find("m1.y"), 1, column);
  EXPECT_EQ(column, (std::vector<double>{5.0, 6.0}));
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
}  // namespace unfurl::data::run_test
