#include "data/trial.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/random.h"
#include "data/h5.h"

namespace unfurl::data::trial_test {
namespace {

TrialHeader SmallHeader() {
  TrialHeader header;
  header.cameras = {"left", "right"};
  header.slots = {"mark1", "dark"};
  header.format.active = 100;
  header.format.bits = 10;
  header.format.electrons_per_count = 58.7;
  header.format.read_noise_counts = 0.6;
  header.line_rate = 500.0;
  return header;
}

TrialBlock RandomBlock(const TrialHeader& header, std::size_t lines, Rng& rng, std::size_t first) {
  TrialBlock block;
  block.Resize(lines, header);
  for (std::size_t i = 0; i < lines; ++i) {
    block.t[i] = (static_cast<double>(first + i) + 0.5) / header.line_rate;
    block.slot[i] = static_cast<std::int32_t>(rng.Integer(2));
  }
  for (auto& count : block.counts) count = static_cast<std::uint16_t>(rng.Integer(1024));
  return block;
}

TEST(Trial, SensorsOfUnlikeLengthShareARecord) {
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "trial_unlike.h5";
  TrialHeader header = SmallHeader();
  header.format.by_camera.assign(2, header.format);
  header.format.by_camera[1].active = 333;
  header.format.by_camera[1].dark = 5;
  header.format.by_camera[1].sensor = "another";
  header.response.assign(433, 1.25F);
  Rng rng(7);
  const TrialBlock all = RandomBlock(header, 20, rng, 0);
  EXPECT_EQ(all.counts.size(), 20U * (175U + 362U));
  TrialWriter writer(path, header, {});
  writer.Append(all);
  writer.Commit();
  const TrialReader reader(path);
  const LineFormats& format = reader.header().format;
  ASSERT_EQ(format.by_camera.size(), 2U);
  EXPECT_EQ(format.Of(0).active, 100);
  EXPECT_EQ(format.Of(1).active, 333);
  EXPECT_EQ(format.Of(1).dark, 5);
  EXPECT_EQ(format.Of(1).sensor, "another");
  EXPECT_EQ(format.Of(1).electrons_per_count, 58.7);
  EXPECT_EQ(reader.header().response, header.response);
  TrialBlock block;
  reader.Read(3, 10, &block);
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t c = 0; c < 2; ++c) {
      const auto line = block.Line(reader.header(), i, c), expected = all.Line(header, 3 + i, c);
      EXPECT_EQ(line.size(), format.Of(c).elements());
      EXPECT_TRUE(std::equal(line.begin(), line.end(), expected.begin(), expected.end()));
    }
  }
  std::remove(path.c_str());
}

TEST(Trial, StreamsBothWaysInAnyBlocks) {
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "trial_stream.h5";
  const TrialHeader header = SmallHeader();
  Rng rng(1);
  TrialBlock all;
  {
    TrialWriter writer(path, header, {.program = "test", .command = "test"});
    for (std::size_t lines : {7U, 1U, 40U, 19U}) {
      const TrialBlock block = RandomBlock(header, lines, rng, all.size());
      writer.Append(block);
      all.t.insert(all.t.end(), block.t.begin(), block.t.end());
      all.slot.insert(all.slot.end(), block.slot.begin(), block.slot.end());
      all.counts.insert(all.counts.end(), block.counts.begin(), block.counts.end());
    }
    EXPECT_FALSE(std::filesystem::exists(path));  // not before it is whole
    writer.Commit();
  }
  const TrialReader reader(path);
  EXPECT_EQ(reader.size(), 67U);
  EXPECT_EQ(reader.header().cameras, header.cameras);
  EXPECT_EQ(reader.header().slots, header.slots);
  EXPECT_EQ(reader.header().format.elements(), header.format.elements());
  EXPECT_EQ(reader.header().format.bits, 10);
  EXPECT_EQ(reader.header().format.electrons_per_count, 58.7);
  EXPECT_EQ(reader.header().line_rate, 500.0);
  TrialBlock block;
  for (std::size_t first = 0; first < 67; first += 10) {
    const std::size_t count = std::min<std::size_t>(10, 67 - first);
    reader.Read(first, count, &block);
    const std::size_t size = header.line_counts();
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(block.t[i], all.t[first + i]);
      EXPECT_EQ(block.slot[i], all.slot[first + i]);
    }
    EXPECT_TRUE(std::equal(block.counts.begin(), block.counts.end(),
                           all.counts.begin() + static_cast<std::ptrdiff_t>(first * size)));
  }
  std::remove(path.c_str());
}

TEST(Trial, AnUnfinishedOneLeavesNothing) {
  const std::filesystem::path folder =
      testing::TempDir() + std::to_string(getpid()) + "trial_unfinished";
  std::filesystem::create_directory(folder);
  {
    Rng rng(1);
    TrialWriter writer((folder / "trial.h5").string(), SmallHeader(), {});
    writer.Append(RandomBlock(SmallHeader(), 20, rng, 0));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  std::filesystem::remove_all(folder);
}

TEST(Trial, RefusesAnotherSchemaAndASlotThatIsNotThere) {
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "trial_bad.h5";
  {
    H5Writer other(path, "unfurl/run", 1, {});
    other.Commit();
  }
  EXPECT_THROW(TrialReader{path}, Error);
  Rng rng(1);
  TrialBlock block = RandomBlock(SmallHeader(), 5, rng, 0);
  block.slot[3] = 2;
  {
    TrialWriter writer(path, SmallHeader(), {});
    writer.Append(block);
    writer.Commit();
  }
  {
    const TrialReader reader(path);
    EXPECT_THROW(reader.Read(0, 5, &block), Error);
    EXPECT_NO_THROW(reader.Read(0, 3, &block));
  }
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  EXPECT_THROW(TrialReader{path}, Error);
  std::remove(path.c_str());
}

}  // namespace
}  // namespace unfurl::data::trial_test
