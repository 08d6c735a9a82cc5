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
  readings.time.clear();
  EXPECT_FALSE(MakeWandData(readings, bar, nullptr, "wand", "").Moves());
  EXPECT_THROW(MakeWandData(readings, {{0.2, 0.5}, 1e-4}, nullptr, "wand", ""), Error);
}

}  // namespace
}  // namespace unfurl::calib::wand_data_test
