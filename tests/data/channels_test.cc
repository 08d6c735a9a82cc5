// Channels of instruments in every form that they come in.
#include "data/channels.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <numbers>

#include "data/atomic_file.h"
#include "data/h5.h"
#include "data/units.h"
#include "tests/data/errors.h"

namespace unfurl::data::channels_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<Channel> ReadText(const std::string& text, const std::string& ending = ".csv") {
  const std::string path = fmt::format("{}channels-{}{}", ::testing::TempDir(), getpid(), ending);
  WriteTextFile(path, text);
  std::vector<Channel> out;
  try {
    out = ReadChannels(path);
  } catch (...) {
    std::remove(path.c_str());
    throw;
  }
  std::remove(path.c_str());
  return out;
}

TEST(Channels, AWideTableWithGapsAndTimesInMilliseconds) {
  const auto all = ReadText(
      "t [ms],encoder [deg],gyro [deg/s],gyro.sigma [deg/s]\n"
      "0,1.5,,\n10,1.6,20,0.5\n20,1.8,21,0.5\n");
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].name, "encoder");
  EXPECT_EQ(all[0].unit, "deg");
  EXPECT_THAT(all[0].t, ElementsAre(0.0, 0.01, 0.02));
  EXPECT_TRUE(all[0].sigma.empty());
  EXPECT_THAT(all[1].t, ElementsAre(0.01, 0.02));
  EXPECT_THAT(all[1].y, ElementsAre(20.0, 21.0));
  EXPECT_THAT(all[1].sigma, ElementsAre(0.5, 0.5));
}

TEST(Channels, ALongTable) {
  const auto all = ReadText(
      "t [s],channel,value,unit,sigma\n"
      "0,a,1,V,0.1\n0.5,b,7,m/s^2,\n1,a,2,V,0.1\n1.5,b,8,m/s^2,\n");
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].unit, "V");
  EXPECT_THAT(all[0].y, ElementsAre(1.0, 2.0));
  EXPECT_THAT(all[0].sigma, ElementsAre(0.1, 0.1));
  EXPECT_THAT(all[1].t, ElementsAre(0.5, 1.5));
  EXPECT_TRUE(all[1].sigma.empty());
}

TEST(Channels, BadTablesAreNamed) {
  auto message = [](const std::string& text) { return ErrorOf([&] { ReadText(text); }); };
  EXPECT_THAT(message("t [kg],a [V]\n0,1\n"), HasSubstr("t"));
  EXPECT_THAT(message("a [V],b [V]\n0,1\n"), HasSubstr("t"));
  EXPECT_THAT(message("t [s],a [V]\n0,1\n0,2\n"), HasSubstr("do not ascend at 0 s"));
  EXPECT_THAT(message("t [s],a [V]\n0,1\n1,nan\n"), HasSubstr(":3"));
  EXPECT_THAT(message("t [s],a [V],a.sigma [V]\n0,1,0.1\n1,2,\n"), HasSubstr("1 of 2"));
  EXPECT_THAT(message("t [s],a [V],a.sigma [V]\n0,1,0.1\n1,2,-1\n"), HasSubstr("not positive"));
  EXPECT_THAT(message("t [s],channel,value,unit\n0,a,1,V\n1,a,1,mV\n"), HasSubstr("one unit"));
  EXPECT_THAT(message("t [s],a [V]\n"), HasSubstr("no readings"));
  EXPECT_THAT(ErrorOf([] { ReadText("x", ".mat"); }), HasSubstr(".csv, .uff"));
}

TEST(Channels, FunctionsOfAUniversalFile) {
  // By hand, after the format's description: accelerations over time, even spacing.
  auto function = [](const char* title, int node, const char* unit) {
    std::string text = "    -1\n    58\n" + std::string(title) + "\nNONE\nNONE\nNONE\nNONE\n";
    char line[100];
    std::snprintf(line, sizeof line, "%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n", 1, 0, 0, 0,
                  "NONE", node, 1, "NONE", 0, 0);
    text += line;
    text += "         2         3         1  0.00000E+00  1.00000E-02  0.00000E+00\n";
    text += "        17    0    0    0 NONE                 s                   \n";
    text += "        12    0    0    0 NONE                 " + std::string(unit) + "\n";
    text += "         0    0    0    0 NONE                 NONE                \n";
    text += "         0    0    0    0 NONE                 NONE                \n";
    return text + "  1.00000E+00  2.00000E+00  4.00000E+00\n    -1\n";
  };
  const auto all = ReadText(function("hub x", 1, "m/s^2") + function("NONE", 7, "g"), ".uff");
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].name, "hub x");
  EXPECT_EQ(all[0].unit, "m/s^2");
  EXPECT_THAT(all[0].t, ElementsAre(0.0, 0.01, 0.02));
  EXPECT_THAT(all[0].y, ElementsAre(1.0, 2.0, 4.0));
  EXPECT_EQ(all[1].name, "7+x");
}

TEST(Channels, GroupsOfAnHdf5FileOfAnyone) {
  const std::string path = fmt::format("{}channels-{}.h5", ::testing::TempDir(), getpid());
  {
    H5Writer writer(path, "somebody/else", 1, {});
    const std::vector<double> t = {0.0, 0.5, 1.0}, y = {3.0, 4.0, 5.0};
    writer.Write({"/strain/t", "s", "stamps"}, t, {3});
    writer.Write({"/strain/value", "um/m", "readings"}, y, {3});
    writer.Commit();
  }
  const auto all = ReadChannels(path);
  std::remove(path.c_str());
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].name, "strain");
  EXPECT_EQ(all[0].unit, "um/m");
  EXPECT_THAT(all[0].y, ElementsAre(3.0, 4.0, 5.0));
}

TEST(Channels, OneThatIsNotThereIsNamedWithTheNearest) {
  const auto all = ReadText("t [s],encoder [deg],gyro [deg/s]\n0,1,2\n");
  EXPECT_EQ(FindChannel(all, "gyro", "study.toml:3").y[0], 2.0);
  EXPECT_THAT(ErrorOf([&] { FindChannel(all, "encodr", "study.toml:3"); }),
              HasSubstr("did you mean 'encoder'?"));
}

TEST(Units, OfTheSameMeasure) {
  EXPECT_DOUBLE_EQ(UnitsPer("mm", "m").value(), 1000.0);
  EXPECT_DOUBLE_EQ(UnitsPer("deg", "rad").value(), 180.0 / std::numbers::pi);
  EXPECT_DOUBLE_EQ(UnitsPer("deg/s", "rad/s").value(), 180.0 / std::numbers::pi);
  EXPECT_DOUBLE_EQ(UnitsPer("rpm", "rad/s").value(), 30.0 / std::numbers::pi);
  EXPECT_DOUBLE_EQ(UnitsPer("gn", "m/s^2").value(), 1.0 / 9.80665);
  EXPECT_DOUBLE_EQ(UnitsPer("N mm", "N m").value(), 1000.0);
  EXPECT_DOUBLE_EQ(UnitsPer("mN*m", "N m").value(), 1000.0);
  EXPECT_DOUBLE_EQ(UnitsPer("um/m", "1").value(), 1e6);
  EXPECT_DOUBLE_EQ(UnitsPer("1/mm", "1/m").value(), 1e-3);
  EXPECT_DOUBLE_EQ(UnitsPer("kg m/s^2", "N").value(), 1.0);
  EXPECT_DOUBLE_EQ(UnitsPer("V", "V").value(), 1.0);
}

TEST(Units, OthersAreNotGuessed) {
  EXPECT_FALSE(UnitsPer("V", "rad"));
  EXPECT_FALSE(UnitsPer("deg", "rad/s"));
  EXPECT_FALSE(UnitsPer("g", "m/s^2"));  // grams
  EXPECT_FALSE(UnitsPer("m/s/s", "m/s^2"));
  EXPECT_FALSE(UnitsPer("m^", "m"));
  EXPECT_FALSE(UnitsPer("m^99999999999", "m"));
  EXPECT_FALSE(UnitsPer("", "m"));
}

}  // namespace
}  // namespace unfurl::data::channels_test
