#include "data/wand.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <string>

#include "data/h5.h"
#include "tests/data/errors.h"
#include "tests/own_folder.h"

namespace unfurl::data::wand_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class WandFile : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.File(name); }
  WandReadings Read(const std::string& text) const {
    std::ofstream(Path("wand.csv")) << text;
    return ReadWand(Path("wand.csv"));
  }
  std::string Refusal(const std::string& text) const {
    return ErrorOf([&] { Read(text); });
  }
  OwnFolder folder_;
};

constexpr char kHead[] = "# cameras: door, window\npose,mark,u1 [px],s1 [px],u2 [px],s2 [px]\n";

TEST_F(WandFile, ARowForEachFlash) {
  const WandReadings wand = Read(
      "# cameras: door, window\n# pixels: 2160, 1024\n"
      "pose,mark,time [s],u1 [px],s1 [px],u2 [px],s2 [px]\n"
      "7,a,0.5,100.5,0.04,,\n7,b,0.6,101.5,0.05,900.25,0.06\n");
  EXPECT_THAT(wand.pose, ElementsAre("7", "7"));
  EXPECT_THAT(wand.mark, ElementsAre("a", "b"));
  EXPECT_THAT(wand.time, ElementsAre(0.5, 0.6));
  EXPECT_THAT(wand.cameras, ElementsAre("door", "window"));
  EXPECT_THAT(wand.pixels, ElementsAre(2160, 1024));
  EXPECT_EQ(wand.u_px(0, 0), 100.5);
  EXPECT_TRUE(std::isnan(wand.u_px(0, 1)));
  EXPECT_EQ(wand.s_px(1, 1), 0.06);
}

TEST_F(WandFile, ARowForEachReadingAndIdsSayTheSame) {
  const WandReadings wide = Read(std::string(kHead) + "1,a,10,0.1,20,0.2\n1,b,30,0.3,,\n");
  const WandReadings tall =
      Read("pose,mark,camera,u [px],s [px]\n1,a,door,10,0.1\n1,b,door,30,0.3\n1,a,window,20,0.2\n");
  const WandReadings ids = Read(
      "# cameras: door, window\nid,u1 [px],s1 [px],u2 [px],s2 [px]\n1a,10,0.1,20,0.2\n"
      "1b,30,0.3,,\n");
  for (const WandReadings& other : {tall, ids}) {
    EXPECT_EQ(other.pose, wide.pose);
    EXPECT_EQ(other.mark, wide.mark);
    EXPECT_EQ(other.cameras, wide.cameras);
    EXPECT_THAT(other.time, IsEmpty());
    EXPECT_EQ(other.u_px(1, 0), 30.0);
    EXPECT_EQ(other.u_px(0, 1), 20.0);
    EXPECT_TRUE(std::isnan(other.s_px(1, 1)));
  }
}

TEST_F(WandFile, ThereAndBack) {
  const WandReadings wand = Read(
      "# cameras: door, window\n# pixels: 2160, 1024\n"
      "pose,mark,time [s],u1 [px],s1 [px],u2 [px],s2 [px]\n"
      "7,a,0.5,100.5,0.04,,\n7,b,0.6,101.5,0.05,900.25,0.06\n");
  WriteWand(Path("wand.h5"), wand, {});
  WriteWandCsv(Path("again.csv"), wand);
  for (const char* name : {"wand.h5", "again.csv"}) {
    const WandReadings back = ReadWand(Path(name));
    EXPECT_EQ(back.pose, wand.pose);
    EXPECT_EQ(back.mark, wand.mark);
    EXPECT_EQ(back.time, wand.time);
    EXPECT_EQ(back.cameras, wand.cameras);
    EXPECT_EQ(back.pixels, wand.pixels);
    EXPECT_EQ(back.u_px(1, 1), 900.25);
    EXPECT_TRUE(std::isnan(back.u_px(0, 1)));
    EXPECT_EQ(back.s_px(0, 0), 0.04);
  }
}

TEST_F(WandFile, BadCellsAreRefusedByLineAndColumn) {
  const std::string head = kHead;
  EXPECT_THAT(Refusal(head + "1,a,10,0.1,20,0.2\n1,a,10,0.1,20,0.2\n"),
              HasSubstr("wand.csv:4:pose: mark 'a' of pose '1' comes twice; give"));
  EXPECT_THAT(Refusal(head + "1,,10,0.1,20,0.2\n"),
              HasSubstr("wand.csv:3:pose: a flash without its pose or its mark; name both"));
  EXPECT_THAT(Refusal(head + "1,a,ten,0.1,20,0.2\n"), HasSubstr("wand.csv:3:u1: "));
  EXPECT_THAT(Refusal(head + "1,a,10,0,20,0.2\n"), HasSubstr("wand.csv:3:s1: "));
  EXPECT_THAT(Refusal(head + "1,a,10,,20,0.2\n"), HasSubstr("wand.csv:3:s1: "));
  EXPECT_THAT(Refusal(head), HasSubstr("wand.csv: holds no "));
  EXPECT_THAT(Refusal("pose,mark\n1,a\n"), HasSubstr("add columns 'u1 [px]'"));
  EXPECT_THAT(Refusal("pose,u1 [px],s1 [px]\n1,10,0.1\n"), HasSubstr("mark"));
  EXPECT_THAT(Refusal("id,u1 [px],s1 [px]\na,10,0.1\n"),
              HasSubstr("wand.csv:2:id: 'a' is not a pose and a mark; give ids as 12a"));
  EXPECT_THAT(Refusal("pose,mark,time [s],u1 [px],s1 [px]\n1,a,,10,0.1\n"),
              HasSubstr("wand.csv:2:time"));
  EXPECT_THAT(
      Refusal("pose,mark,camera,u [px],s [px]\n1,a,door,10,0.1\n1,a,door,11,0.1\n"),
      HasSubstr("wand.csv:3:u: camera 'door' has two readings of mark 'a' in pose '1'; give"));
}

TEST_F(WandFile, BadDatasetsAreRefusedByName) {
  WandReadings wand = Read(
      "# cameras: door, window\npose,mark,time [s],u1 [px],s1 [px],u2 [px],s2 [px]\n"
      "7,a,0.5,100.5,0.04,,\n7,b,0.6,101.5,0.05,900.25,0.06\n");
  const auto refusal = [&](const WandReadings& wrong) {
    WriteWand(Path("wrong.h5"), wrong, {});
    return ErrorOf([&] { ReadWand(Path("wrong.h5")); });
  };
  WandReadings wrong = wand;
  wrong.mark.pop_back();
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/mark: does not have the size"));
  wrong = wand;
  wrong.time.push_back(0.7);
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/time: does not have the size"));
  wrong = wand;
  wrong.time[1] = INFINITY;
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/time: flash 2 is at inf s; give"));
  wrong = wand;
  wrong.s_px(1, 0) = -0.05;
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/s: flash 2, camera 'door': reading"));
  wrong = wand;
  wrong.u_px.conservativeResize(2, 1);
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/u: does not have the size"));
  wrong = wand;
  wrong.mark[1] = "a";
  wrong.time[1] = wrong.time[0];
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/pose: mark 'a' of pose '7' comes twice; make"));
}

}  // namespace
}  // namespace unfurl::data::wand_test
