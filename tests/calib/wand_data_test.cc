#include "calib/wand_data.h"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "base/error.h"

namespace unfurl::calib::wand_data_test {
namespace {

TEST(WandData, BarsAreReadStrictly) {
  const WandBar bar = ParseBar("0.7501m+-0.1mm", "--bar");
  ASSERT_EQ(bar.places.size(), 1U);
  EXPECT_DOUBLE_EQ(bar.places[0], 0.7501);
  EXPECT_DOUBLE_EQ(bar.sigma, 1e-4);
  EXPECT_EQ(ParseBar("25cm,0.75m+/-0.1mm", "--bar").places.size(), 2U);
  for (const char* wrong : {"0.75m", "m+-0.1mm", "0.75m+-0", "0.75m+-2m", "0+-1mm", ""}) {
    EXPECT_THROW(ParseBar(wrong, "--bar"), Error) << wrong;
  }
}

TEST(WandData, PosesComeInTheOrderOfTime) {
  data::WandReadings readings;
  readings.pose = {"2", "2", "1", "1"};
  readings.mark = {"b", "a", "a", "b"};
  readings.time = {0.31, 0.30, 0.10, 0.11};
  readings.cameras = {"x"};
  readings.u_px.setConstant(4, 1, 100.0);
  readings.s_px.setConstant(4, 1, 0.1);
  const WandBar bar{{0.5}, 1e-4};
  const WandData data = MakeWandData(readings, bar, nullptr, "wand", "");
  EXPECT_EQ(data.poses, (std::vector<std::string>{"1", "2"}));
  EXPECT_NEAR(data.time[1], 0.305, 1e-12);
  EXPECT_NEAR(data.readings[0].after, -0.005, 1e-12);
  EXPECT_TRUE(data.Moves());
  readings.time = {0.105, 0.30, 0.10, 0.11};
  EXPECT_THROW(MakeWandData(readings, bar, nullptr, "wand", ""), Error);  // they overlap
  readings.time.assign(4, 0.0);
  try {
    MakeWandData(readings, bar, nullptr, "wand", "");
    ADD_FAILURE() << "a column of one number was taken for times";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("all flashes have the same time"));
  }
  readings.time.clear();
  EXPECT_FALSE(MakeWandData(readings, bar, nullptr, "wand", "").Moves());
  EXPECT_THROW(MakeWandData(readings, {{0.2, 0.5}, 1e-4}, nullptr, "wand", ""), Error);
}

// A recording that was pasted twice would halve the variances.
TEST(WandData, PosesThatAreCopiesAreRefused) {
  data::WandReadings readings;
  readings.cameras = {"x", "y", "z"};
  readings.u_px.resize(6, 3);
  for (int pose = 0; pose < 3; ++pose) {
    for (int mark = 0; mark < 2; ++mark) {
      readings.pose.push_back(std::to_string(pose));
      readings.mark.push_back(mark == 0 ? "a" : "b");
      readings.u_px.row(2 * pose + mark) << 100.25 + 7.0 * pose, 300.5 + mark, 900.125 + mark;
    }
  }
  readings.s_px.setConstant(6, 3, 0.1);
  const WandBar bar{{0.5}, 1e-4};
  EXPECT_NO_THROW(MakeWandData(readings, bar, nullptr, "wand.csv", ""));
  readings.u_px.bottomRows(2) = readings.u_px.topRows(2);
  try {
    MakeWandData(readings, bar, nullptr, "wand.csv", "");
    ADD_FAILURE() << "a copy was taken for a measurement";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(
                                  "pose \"2\" has the readings of pose \"0\" to the last digit"));
  }
  readings.u_px(5, 2) += 1e-5;
  EXPECT_NO_THROW(MakeWandData(readings, bar, nullptr, "wand.csv", ""));
}

}  // namespace
}  // namespace unfurl::calib::wand_data_test
