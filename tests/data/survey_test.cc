#include "data/survey.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "data/atomic_file.h"

namespace unfurl::data::survey_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Apart from what other processes write.
std::string Path(const std::string& name) {
  return testing::TempDir() + std::to_string(getpid()) + name;
}

Survey WithReadings() {
  Survey survey;
  survey.id = {"a", "b", "c"};
  survey.cameras = {"left", "right"};
  survey.p.resize(3, 3);
  survey.p << 0.1, 1.0 / 3.0, -2.0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9;
  survey.cov.setZero(6, 3);
  survey.cov.row(0).setConstant(9e-8);
  survey.cov.row(1).setConstant(1e-8);
  survey.cov.row(3).setConstant(8e-8);
  survey.cov.row(5).setConstant(2e-7);
  const double none = std::numeric_limits<double>::quiet_NaN();
  survey.u_px.resize(3, 2);
  survey.u_px << 1000.1, 900.7, none, 12.5, 2000.25, none;
  survey.s_px = survey.u_px.array() * 1e-5;
  return survey;
}

void ExpectSame(const Survey& a, const Survey& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.cameras, b.cameras);
  EXPECT_EQ(a.p, b.p);
  EXPECT_EQ(a.cov, b.cov);
  ASSERT_EQ(a.u_px.size(), b.u_px.size());
  for (Eigen::Index i = 0; i < a.u_px.size(); ++i) {
    EXPECT_TRUE(a.u_px(i) == b.u_px(i) || (std::isnan(a.u_px(i)) && std::isnan(b.u_px(i))));
    EXPECT_TRUE(a.s_px(i) == b.s_px(i) || (std::isnan(a.s_px(i)) && std::isnan(b.s_px(i))));
  }
  EXPECT_EQ(a.lit, b.lit);
  EXPECT_EQ(a.dark, b.dark);
}

TEST(Survey, AReadingOnNoPixelIsRefusedByItsLine) {
  const auto refusal = [](const std::string& pixels, const std::string& reading) -> std::string {
    const std::string path = Path("beyond.csv");
    std::ofstream(path) << pixels << "id,x [m],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n"
                        << "a,0,0,0,1e-3,1e-3,1e-3,100,0.1\n"
                        << "b,1,0,0,1e-3,1e-3,1e-3," << reading << ",0.1\n";
    std::string what;
    try {
      ReadSurvey(path);
    } catch (const Error& error) {
      what = error.what();
    }
    std::remove(path.c_str());
    return what;
  };
  EXPECT_THAT(refusal("# pixels: 2160\n", "99999"),
              AllOf(HasSubstr(":4:u1"), HasSubstr("the row has 2160 pixels")));
  EXPECT_THAT(refusal("# pixels: 2160\n", "2160"), HasSubstr(":4:u1"));
  EXPECT_THAT(refusal("", "99999"), AllOf(HasSubstr(":3:u1"), HasSubstr("on no sensor's row")));
  EXPECT_THAT(refusal("", "-20"), HasSubstr(":3:u1"));
  EXPECT_EQ(refusal("# pixels: 2160\n", "2159.4"), "");
  EXPECT_EQ(refusal("# pixels: 2160\n", "-0.4"), "");
  EXPECT_EQ(refusal("", "16384"), "");
  // The same of HDF5.
  for (const double wrong : {99999.0, -20.0, std::numeric_limits<double>::infinity()}) {
    Survey survey = WithReadings();
    survey.u_px(1, 1) = wrong;
    WriteSurvey(Path("beyond.h5"), survey, {});
    EXPECT_THROW(ReadSurvey(Path("beyond.h5")), Error) << wrong;
    std::remove(Path("beyond.h5").c_str());
  }
}

TEST(Survey, ReadingsGoToHdf5AndCsvAndBackExactly) {
  const Survey survey = WithReadings();
  WriteSurvey(Path("survey.h5"), survey, {});
  ExpectSame(ReadSurvey(Path("survey.h5")), survey);
  WriteSurveyCsv(Path("survey.csv"), survey);
  ExpectSame(ReadSurvey(Path("survey.csv")), survey);
  std::remove(Path("survey.h5").c_str());
  std::remove(Path("survey.csv").c_str());
}

TEST(Survey, LinesGoToHdf5AndBack) {
  Survey survey = WithReadings();
  survey.u_px.resize(0, 0);
  survey.s_px.resize(0, 0);
  survey.format.active = 50;
  survey.format.electrons_per_count = 14.0;
  for (std::size_t i = 0; i < 3 * 2 * survey.format.elements(); ++i) {
    survey.lit.push_back(static_cast<std::uint16_t>(i % 4096));
    survey.dark.push_back(static_cast<std::uint16_t>(i % 77));
  }
  WriteSurvey(Path("lines.h5"), survey, {});
  const Survey back = ReadSurvey(Path("lines.h5"));
  ExpectSame(back, survey);
  EXPECT_TRUE(back.has_lines());
  EXPECT_EQ(back.format.electrons_per_count, 14.0);
  EXPECT_THROW(WriteSurveyCsv(Path("lines.csv"), survey), Error);
  std::remove(Path("lines.h5").c_str());
}

TEST(Survey, CamerasHaveTheirOwnPixels) {
  Survey survey = WithReadings();
  survey.pixels = {2160, 4096};
  WriteSurvey(Path("pixels.h5"), survey, {});
  EXPECT_EQ(ReadSurvey(Path("pixels.h5")).pixels, survey.pixels);
  WriteSurveyCsv(Path("pixels.csv"), survey);
  EXPECT_EQ(ReadSurvey(Path("pixels.csv")).pixels, survey.pixels);
  survey.pixels.clear();
  WriteSurveyCsv(Path("pixels.csv"), survey);
  EXPECT_TRUE(ReadSurvey(Path("pixels.csv")).pixels.empty());
  std::remove(Path("pixels.h5").c_str());
  std::remove(Path("pixels.csv").c_str());
}

TEST(Survey, LinesOfUnlikeSensorsGoToHdf5AndBack) {
  Survey survey = WithReadings();
  survey.u_px.resize(0, 0);
  survey.s_px.resize(0, 0);
  survey.format.electrons_per_count = 14.0;
  survey.format.by_camera.assign(2, survey.format);
  survey.format.by_camera[0].active = 50;
  survey.format.by_camera[1].active = 80;
  for (std::size_t i = 0; i < survey.size() * survey.line_counts(); ++i) {
    survey.lit.push_back(static_cast<std::uint16_t>(i % 4096));
    survey.dark.push_back(static_cast<std::uint16_t>(i % 77));
  }
  WriteSurvey(Path("unlike.h5"), survey, {});
  const Survey back = ReadSurvey(Path("unlike.h5"));
  ExpectSame(back, survey);
  EXPECT_EQ(back.format.Of(0).active, 50);
  EXPECT_EQ(back.format.Of(1).active, 80);
  EXPECT_EQ(back.LineAt(2, 1), 2 * (125U + 155U) + 125U);
  std::remove(Path("unlike.h5").c_str());
}

std::string ErrorOfCsv(const std::string& text) {
  const std::string path = Path("bad.csv");
  std::ofstream(path) << text;
  std::string message = "no error";
  try {
    ReadSurvey(path);
  } catch (const Error& error) {
    message = error.what();
  }
  std::remove(path.c_str());
  return message;
}

TEST(Survey, CsvErrorsNameTheirPlace) {
  const std::string head = "id,x [m],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n";
  EXPECT_EQ(ErrorOfCsv(head + "a,1,2,3,1e-4,1e-4,1e-4,1000,0.02\n"), "no error");
  EXPECT_THAT(ErrorOfCsv("id,x,y,z,sx,sy,sz,u1,s1\na,1,2,3,1,1,1,1,1\n"), HasSubstr("no unit"));
  EXPECT_THAT(ErrorOfCsv("id,x [yd],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n"
                         "a,1,2,3,1,1,1,1,1\n"),
              HasSubstr("[yd]"));
  EXPECT_THAT(ErrorOfCsv(head + "a,1,2,3,1e-4,1e-4,1e-4,1000,0.02\na,1,2,4,1e-4,1e-4,1e-4,,\n"),
              HasSubstr("bad.csv:3:id"));
  EXPECT_THAT(ErrorOfCsv(head + "a,1,2,3,0,1e-4,1e-4,1000,0.02\n"), HasSubstr("bad.csv:2:sx"));
  EXPECT_THAT(ErrorOfCsv(head + "a,1,2,3,1e-4,1e-4,1e-4,1000,\n"), HasSubstr("bad.csv:2:s1"));
  EXPECT_THAT(ErrorOfCsv(head + "a,1,two,3,1e-4,1e-4,1e-4,1000,0.1\n"), HasSubstr("bad.csv:2:y"));
  EXPECT_THAT(ErrorOfCsv(head), HasSubstr("no point"));
  const std::string row = "a,1,2,3,1e-4,1e-4,1e-4,1000,0.02\n";
  EXPECT_EQ(ErrorOfCsv("# pixels: 2160\n" + head + row), "no error");
  EXPECT_THAT(ErrorOfCsv("# pixels: 2160, 2160\n" + head + row), HasSubstr("pixels of 2 cameras"));
  EXPECT_THAT(ErrorOfCsv("# pixels: 2.5\n" + head + row), HasSubstr("'2.5' is not a number"));
  EXPECT_THAT(ErrorOfCsv("id,x [m],y [m],z [m],u1 [px],s1 [px]\na,1,2,3,5,1\n"),
              HasSubstr("no uncertainty"));
  EXPECT_THAT(ErrorOfCsv("id,x [m],y [m],z [m],sx [m],sy [m],sz [m]\na,1,2,3,1,1,1\n"),
              HasSubstr("no readings"));
  EXPECT_THAT(ErrorOfCsv("id,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],"
                         "czz [m^2],u1 [px],s1 [px]\na,1,2,3,1,2,0,1,0,1,5,1\n"),
              HasSubstr("positive definite"));
}

TEST(Survey, ReadingsAndSigmasThatStandForEachOther) {
  const auto table = [](const std::string& first, const std::string& second) {
    std::string text = "id,x [m],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n";
    for (int k = 0; k < 10; ++k) {
      text += "p" + std::to_string(k) + ",1,2,3,1e-4,1e-4,1e-4," + first + "," + second + "\n";
    }
    return ErrorOfCsv(text);
  };
  EXPECT_EQ(table("812.5", "0.02"), "no error");
  EXPECT_EQ(table("0.5", "0.02"), "no error");
  EXPECT_THAT(table("0.02", "812.5"),
              AllOf(HasSubstr("bad.csv:u1"), HasSubstr("'s1'"), HasSubstr("exchange")));
}

// Points that a spreadsheet has sorted by their names come in the order in which they were
// measured, each with its own readings, and errors name the line of the file.
TEST(Survey, AColumnTimeSaysTheOrderOfMeasuring) {
  const std::string head = "id,time [s],x [m],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n";
  std::ofstream(Path("timed.csv")) << head << "a,30,1,0,0,1e-4,1e-4,1e-4,101,0.02\n"
                                   << "b,10.5,2,0,0,2e-4,1e-4,1e-4,102,0.02\n"
                                   << "c,20,3,0,0,1e-4,1e-4,1e-4,,\n"
                                   << "d,10.5,4,0,0,1e-4,1e-4,1e-4,104,0.02\n";
  const Survey survey = ReadSurvey(Path("timed.csv"));
  EXPECT_THAT(survey.id, ::testing::ElementsAre("b", "d", "c", "a"));
  EXPECT_EQ(survey.p.row(0), Eigen::RowVector4d(2.0, 4.0, 3.0, 1.0));
  EXPECT_EQ(survey.cov(0, 0), 4e-8);
  EXPECT_EQ(survey.u_px(1, 0), 104.0);
  EXPECT_TRUE(std::isnan(survey.u_px(2, 0)));
  EXPECT_EQ(survey.u_px(3, 0), 101.0);
  EXPECT_EQ(ReadPointsCsv(Path("timed.csv")).id, survey.id);
  std::remove(Path("timed.csv").c_str());
  EXPECT_THAT(ErrorOfCsv(head + "a,2,1,2,3,1e-4,1e-4,1e-4,1000,0.02\n" +
                         "b,1,1,2,3,0,1e-4,1e-4,1000,0.02\n"),
              HasSubstr("bad.csv:3:sx"));
  EXPECT_THAT(ErrorOfCsv(head + "a,,1,2,3,1e-4,1e-4,1e-4,1000,0.02\n"),
              HasSubstr("bad.csv:2:time"));
  EXPECT_THAT(ErrorOfCsv("id,time,x [m],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n"
                         "a,1,1,2,3,1e-4,1e-4,1e-4,1000,0.02\n"),
              HasSubstr("no unit"));
}

TEST(Survey, PointsAloneMayHaveNoSigmas) {
  std::ofstream(Path("points.csv")) << "# places\nid,x [m],y [m],z [m]\np1,0.1,0.2,0.3\n";
  const Survey points = ReadPointsCsv(Path("points.csv"));
  EXPECT_EQ(points.size(), 1U);
  EXPECT_EQ(points.p(1, 0), 0.2);
  EXPECT_TRUE(points.cov.isZero(0.0));
  std::remove(Path("points.csv").c_str());
}

}  // namespace
}  // namespace unfurl::data::survey_test
