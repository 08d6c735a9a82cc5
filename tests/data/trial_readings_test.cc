#include "data/trial_readings.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/data/errors.h"

namespace unfurl::data::trial_readings_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class ReadingsFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("unfurl_readings_" + std::to_string(getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  TrialReadings Read(const std::string& text) const {
    std::ofstream(Path("r.csv")) << text;
    return ReadTrialReadings(Path("r.csv"));
  }
  std::string Refusal(const std::string& text) const {
    return ErrorOf([&] { Read(text); });
  }
  std::filesystem::path folder_;
};

constexpr char kTall[] = "time [s],mark,camera,u [px],s [px]\n";

void ExpectSame(const TrialReadings& a, const TrialReadings& b) {
  EXPECT_EQ(a.cameras, b.cameras);
  EXPECT_EQ(a.pixels, b.pixels);
  EXPECT_EQ(a.slots, b.slots);
  EXPECT_EQ(a.t, b.t);
  EXPECT_EQ(a.slot, b.slot);
  ASSERT_EQ(a.u_px.size(), b.u_px.size());
  for (std::size_t k = 0; k < a.u_px.size(); ++k) {
    EXPECT_EQ(std::isnan(a.u_px[k]), std::isnan(b.u_px[k]));
    if (std::isnan(a.u_px[k])) continue;
    EXPECT_EQ(a.u_px[k], b.u_px[k]);
    EXPECT_EQ(a.s_px[k], b.s_px[k]);
  }
}

TEST_F(ReadingsFile, RowsOfFlashesAndRowsOfReadingsSayTheSame) {
  const TrialReadings wide = Read(
      "# cameras: door, window\n# pixels: 2160, 1024\n"
      "time [s],mark,u1 [px],s1 [px],u2 [px],s2 [px]\n"
      "0.1,tip,100.5,0.04,200,0.05\n0.2,root,,,900.25,0.06\n");
  EXPECT_THAT(wide.cameras, ElementsAre("door", "window"));
  EXPECT_THAT(wide.slots, ElementsAre("tip", "root"));
  EXPECT_THAT(wide.t, ElementsAre(0.1, 0.2));
  EXPECT_THAT(wide.slot, ElementsAre(0, 1));
  EXPECT_EQ(wide.Readings(0, 1)[0], 200.0);
  EXPECT_TRUE(std::isnan(wide.Readings(1, 0)[0]));
  EXPECT_EQ(wide.Sigmas(1, 1)[0], 0.06);
  // In no order: flashes go by their times.
  ExpectSame(Read(std::string("# pixels: 2160, 1024\n") + kTall +
                  "0.1,tip,door,100.5,0.04\n0.2,root,window,900.25,0.06\n"
                  "0.1,tip,window,200,0.05\n"),
             wide);
}

TEST_F(ReadingsFile, UnknownMarksAreAllThatAreLit) {
  const TrialReadings r = Read(std::string("# marks: tip, root\n") + kTall +
                               "0.1,,door,5,0.1\n0.1,,door,7,0.1\n0.1,,window,3,0.1\n"
                               "0.2,tip,door,6,0.1\n0.3,tip+hub,door,6,0.1\n0.4,dark,,,\n");
  EXPECT_THAT(r.slots, ElementsAre("tip+root", "tip", "tip+hub", "dark"));
  EXPECT_EQ(r.most, 2U);
  EXPECT_EQ(r.Readings(0, 0)[1], 7.0);
  EXPECT_TRUE(std::isnan(r.Readings(0, 1)[1]));
  // Without a column of marks.
  const TrialReadings bare =
      Read("# marks: tip\ntime [s],camera,u [px],s [px]\n0.5,door,1,0.1\n0.6,door,2,0.1\n");
  EXPECT_THAT(bare.slots, ElementsAre("tip"));
}

TEST_F(ReadingsFile, ThereAndBack) {
  const TrialReadings r = Read(std::string("# marks: tip, root\n# pixels: 1024, 2160\n") + kTall +
                               "0.1,,door,5,0.1\n0.1,,door,7.125,0.1\n0.1,,window,3,0.1\n"
                               "0.2,tip,window,6,0.30000000000000004\n0.4,dark,,,\n");
  WriteTrialReadings(Path("r.h5"), r, {});
  WriteTrialReadingsCsv(Path("again.csv"), r);
  ExpectSame(ReadTrialReadings(Path("r.h5")), r);
  ExpectSame(ReadTrialReadings(Path("again.csv")), r);
}

TEST_F(ReadingsFile, BadCellsAreRefusedByLineAndColumn) {
  const std::string head = kTall;
  EXPECT_THAT(Refusal(head), HasSubstr("r.csv: holds no flashes"));
  EXPECT_THAT(Refusal(head + "0.1,,door,5,0.1\n"),
              HasSubstr("r.csv:2:mark: a flash without its mark; name it, or state"));
  EXPECT_THAT(Refusal(head + "soon,a,door,5,0.1\n"), HasSubstr("r.csv:2:time"));
  EXPECT_THAT(Refusal(head + "0.1,a,door,5,0\n"), HasSubstr("r.csv:2:s: a sigma of 0"));
  for (const char* sigma : {"1e-09", "1e+300"}) {
    EXPECT_THAT(
        Refusal(head + "0.1,a,door,5," + sigma + "\n"),
        HasSubstr(std::string("r.csv:2:s: a sigma of ") + sigma + " px, which no reading has"));
  }
  EXPECT_THAT(Refusal(head + "0.1,a,door,5,\n"), HasSubstr("r.csv:2:s: a reading without"));
  EXPECT_THAT(Refusal(head + "0.1,a,,5,0.1\n"), HasSubstr("names a camera twice, or not at all"));
  EXPECT_THAT(Refusal(head + "0.1,a+a,door,5,0.1\n"),
              HasSubstr("r.csv:2:mark: 'a+a' names a mark twice"));
  EXPECT_THAT(Refusal(head + "0.1,a,door,5,0.1\n0.1,a,door,5,0.2\n"),
              HasSubstr("r.csv:3:u: a reading of camera 'door' comes twice"));
  EXPECT_THAT(Refusal("# marks: a\n" + head + "0.1,a,door,5,0.1\n0.1,,door,6,0.2\n"),
              HasSubstr("r.csv:4:mark: at 0.1 s some readings have a mark and some have none"));
  EXPECT_THAT(Refusal("# marks: a, a\n" + head + "0.1,,door,5,0.1\n"),
              HasSubstr("r.csv: # marks: names a mark twice"));
  EXPECT_THAT(Refusal("# pixels: 100\n" + head + "0.1,a,door,100,0.1\n"),
              HasSubstr("camera 'door' reads 100 px at 0.1 s, but its row has 100 pixels"));
  EXPECT_THAT(Refusal("time [ms],mark,u1 [px],s1 [px]\n1,a,5,0.1\n"), HasSubstr("time"));
  EXPECT_THAT(Refusal("time [s],mark\n1,a\n"), HasSubstr("add columns 'u1 [px]'"));
  std::string nine = head;
  for (int k = 0; k < 9; ++k) nine += "0.1,a,door," + std::to_string(k) + ",0.1\n";
  EXPECT_THAT(Refusal(nine), HasSubstr("r.csv:10:u: camera 'door' has more than 8 readings"));
}

TEST_F(ReadingsFile, BadDatasetsAreRefusedByName) {
  const TrialReadings good =
      Read(std::string(kTall) + "0.1,a,door,5,0.1\n0.2,a,door,6,0.1\n0.2,a,window,7,0.1\n");
  const auto refusal = [&](const TrialReadings& wrong) {
    return ErrorOf([&] {
      WriteTrialReadings(Path("wrong.h5"), wrong, {});
      ReadTrialReadings(Path("wrong.h5"));
    });
  };
  TrialReadings wrong = good;
  wrong.t[1] = 0.05;
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/t: flash 2 is at 0.05 s"));
  wrong = good;
  wrong.t[0] = NAN;
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/t: flash 1"));
  wrong = good;
  wrong.slot[1] = 1;
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/slot: flash 2 names slot 1 of 1"));
  wrong = good;
  wrong.s_px[0] = -1.0;
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/s: flash 1, camera 'door': reading"));
  wrong = good;
  wrong.pixels = {1};
  EXPECT_THAT(refusal(wrong), HasSubstr("wrong.h5:/pixels: does not have the size"));
  wrong = good;
  wrong.cameras[1] = "door";
  EXPECT_THAT(refusal(wrong), HasSubstr("names a camera twice"));
}

}  // namespace
}  // namespace unfurl::data::trial_readings_test
