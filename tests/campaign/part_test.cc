// Parts, folders, and the record that they make.
#include "campaign/part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "campaign/campaign.h"
#include "campaign/record.h"
#include "campaign/slurm.h"
#include "campaign/slurm_engine.h"
#include "tests/campaign/block.h"

namespace unfurl::campaign::part_test {
namespace {

using ::testing::HasSubstr;

constexpr char kResponses[] =
    "[response.last]\nquantity = \"block.x\"\nof = \"final\"\n"
    "[response.when]\nevent = \"watch\"\nof = \"time\"\n";

TEST(Parts, ShardsAreAllRunsOnce) {
  for (const std::uint64_t runs : {1ULL, 7ULL, 64ULL, 1000ULL, 1'000'003ULL}) {
    for (const std::uint64_t n : {1ULL, 2ULL, 7ULL, 64ULL}) {
      if (n > runs) continue;
      std::uint64_t next = 0;
      for (std::uint64_t i = 1; i <= n; ++i) {
        const RunRange range = ShardRange(runs, i, n);
        EXPECT_EQ(range.first, next);
        EXPECT_GE(range.count, runs / n);
        EXPECT_LE(range.count, runs / n + 1);
        next = range.end();
      }
      EXPECT_EQ(next, runs);
    }
  }
}

TEST(Parts, RangesAreReadStrictly) {
  RunRange range;
  ASSERT_TRUE(ParseRange("3:10", &range));
  EXPECT_EQ(range.first, 3U);
  EXPECT_EQ(range.count, 7U);
  EXPECT_EQ(RangeText(range), "3:10");
  for (const char* wrong : {"3", "3:3", "10:3", ":3", "3:", "-1:3", "a:b", "3:10x"}) {
    EXPECT_FALSE(ParseRange(wrong, &range)) << wrong;
  }
}

TEST(Parts, ATaskListIsAsShortAsItCanBe) {
  EXPECT_EQ(ArrayText({1, 2, 3, 4, 5, 8, 10, 11}), "1-5,8,10-11");
  EXPECT_EQ(ArrayText({7}), "7");
  EXPECT_EQ(ArrayText({}), "");
}

class FolderTest : public ::testing::Test {
 protected:
  OpenCampaign Open(const std::string& name, const std::string& campaign = "runs = 40\n") const {
    return OpenPlan(BlockPlan(folder_, kResponses, campaign), folder_.File(name), {});
  }
  // All runs in `shards` parts, the last first.
  std::string RecordBy(std::uint64_t shards) const {
    const OpenCampaign c = Open("parts-" + std::to_string(shards));
    for (std::uint64_t i = shards; i >= 1; --i) {
      ComputePart(c, ShardRange(c.inputs.runs(), i, shards));
    }
    MergeParts(c.folder, c.inputs, c.files, folder_.File("record.h5"));
    return folder_.Get("record.h5");
  }
  const OwnFolder folder_;
};

TEST_F(FolderTest, TheRecordDoesNotHangOnHowRunsWereCut) {
  const std::string one = RecordBy(1);
  for (const std::uint64_t shards : {2ULL, 7ULL, 40ULL}) {
    EXPECT_TRUE(RecordBy(shards) == one) << shards;
  }
}

TEST_F(FolderTest, TheRecordHoldsEveryRun) {
  RecordBy(3);
  const CampaignRecord record = ReadRecord(folder_.File("record.h5"));
  ASSERT_EQ(record.runs, 40U);
  const Inputs inputs(record.plan);
  double v = 0.0;
  for (std::uint64_t run = 0; run < record.runs; ++run) {
    inputs.Values(run, std::span(&v, 1));
    EXPECT_NEAR(record.responses[0][run], 2.0 * v, 1e-9);
    EXPECT_EQ(std::isnan(record.responses[1][run]), v <= 0.5);
  }
  EXPECT_TRUE(record.failed.empty());
}

TEST_F(FolderTest, WhatIsMissingIsKnownAndPartsMayOverlap) {
  const OpenCampaign c = Open("parts");
  ComputePart(c, {10, 5});
  ComputePart(c, {12, 10});
  ComputePart(c, {30, 10});
  const std::vector<RunRange> missing = c.folder.Missing(40);
  ASSERT_EQ(missing.size(), 2U);
  EXPECT_EQ(RangeText(missing[0]), "0:10");
  EXPECT_EQ(RangeText(missing[1]), "22:30");
  EXPECT_EQ(MissingShards(c.folder, 40, 4), (std::vector<std::uint64_t>{1, 3}));
  try {
    MergeParts(c.folder, c.inputs, c.files, folder_.File("record.h5"));
    FAIL() << "merged";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("18 of 40 runs are missing"));
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.File("record.h5")));
  ComputePart(c, {0, 10});
  ComputePart(c, {22, 8});
  MergeParts(c.folder, c.inputs, c.files, folder_.File("record.h5"));
  const std::string overlapping = folder_.Get("record.h5");
  EXPECT_TRUE(RecordBy(1) == overlapping);
}

// In an order that is neither rising nor falling: 617 and the numbers of shards have no common factor.
TEST_F(FolderTest, AThousandShardsGiveTheBytesOfOne) {
  constexpr std::uint64_t kRuns = 1000, kStride = 617;
  std::string first;
  for (const std::uint64_t shards : {1, 8, 64, 1000}) {
    const std::string name = std::to_string(shards);
    const OpenCampaign c = Open(name, "runs = 1000\n");
    for (std::uint64_t i = 0; i < shards; ++i) {
      ComputePart(c, ShardRange(kRuns, (i * kStride) % shards + 1, shards));
    }
    MergeParts(c.folder, c.inputs, c.files, folder_.File(name + ".h5"));
    const std::string record = folder_.Get(name + ".h5");
    if (first.empty()) first = record;
    EXPECT_TRUE(record == first) << shards;
  }
}

TEST_F(FolderTest, ADamagedPartIsMadeAgain) {
  const OpenCampaign c = Open("parts");
  const std::string path = c.folder.PartPath({0, 40});
  ComputePart(c, {0, 40});
  std::ifstream in(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  std::ofstream(path, std::ios::binary) << whole.substr(0, whole.size() / 2);
  ComputePart(c, {0, 40});
  MergeParts(c.folder, c.inputs, c.files, folder_.File("record.h5"));
  const std::string mended = folder_.Get("record.h5");
  EXPECT_TRUE(RecordBy(1) == mended);
}

TEST_F(FolderTest, AnotherPlanOrSceneIsRefused) {
  Open("parts");
  try {
    Open("parts", "runs = 40\nseed = 2\n");
    FAIL() << "taken";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("another plan"));
  }
  folder_.Put("block.toml", std::string(kBlock) + "[mark.m]\non = \"block\"\n");
  try {
    OpenFolder(folder_.File("parts"), {});
    FAIL() << "taken";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("changed since"));
  }
}

TEST_F(FolderTest, RunsCanBeAddedWhereTheDesignAllowsIt) {
  const std::string random = "design = \"random\"\nruns = ";
  OpenCampaign c = Open("grown", random + "10\n");
  ComputePart(c, {0, 10});
  c.Extend(40);
  ComputePart(c, {10, 30});
  MergeParts(c.folder, c.inputs, c.files, folder_.File("grown.h5"));
  const OpenCampaign whole = Open("whole", random + "40\n");
  ComputePart(whole, {0, 40});
  MergeParts(whole.folder, whole.inputs, whole.files, folder_.File("whole.h5"));
  EXPECT_TRUE(folder_.Get("grown.h5") == folder_.Get("whole.h5"));
}

TEST_F(FolderTest, FailedRunsAreKeptWithTheirReasons) {
  folder_.Put("rows.csv", "v\n0.5\n-1\n0.7\n-2\n");
  data::Campaign plan =
      BlockPlan(folder_, kResponses, "design = \"file\"\nfile = \"rows.csv\"\n", "");
  plan.variables[0].keys = {"body.block.mass"};
  const OpenCampaign c = OpenPlan(plan, folder_.File("parts"), {});
  for (std::uint64_t run = 0; run < 4; ++run) ComputePart(c, {run, 1});
  MergeParts(c.folder, c.inputs, c.files, folder_.File("record.h5"));
  const CampaignRecord record = ReadRecord(folder_.File("record.h5"));
  EXPECT_EQ(record.failed, (std::vector<std::uint64_t>{1, 3}));
  EXPECT_THAT(record.messages.at(0), HasSubstr("body.block.mass"));
  EXPECT_TRUE(std::isnan(record.responses[0][1]));
  EXPECT_NEAR(record.responses[0][2], 1.4, 1e-9);
}

}  // namespace
}  // namespace unfurl::campaign::part_test
