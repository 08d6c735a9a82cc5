#include "data/set_ups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "base/error.h"
#include "data/h5.h"
#include "data/survey_points.h"
#include "tests/own_folder.h"

namespace unfurl::data::set_ups_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kHead[] = "x [m],y [m],z [m],sx [m],sy [m],sz [m],u1 [px],s1 [px]\n";
constexpr char kRow[] = "1,2,3,1e-4,1e-4,1e-4,1000,0.02\n";

class SetUps : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text) const {
    const std::string path = folder_.File(name);
    std::ofstream(path) << text;
    return path;
  }
  std::string ErrorOf(const std::string& text) const {
    try {
      ReadSurvey(Write("bad.csv", text));
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }
  std::string File(const std::string& name) const { return folder_.File(name); }

 private:
  OwnFolder folder_;
};

TEST_F(SetUps, AreAColumnOfNames) {
  const std::string text =
      std::string("id,set_up,") + kHead + "a,door," + kRow + "b, 2 ," + kRow + "c,door," + kRow;
  const Survey survey = ReadSurvey(Write("named.csv", text));
  EXPECT_THAT(survey.set_up, ElementsAre("door", "2", "door"));
  EXPECT_THAT(SetUpNames(survey), ElementsAre("door", "2"));
  // Of points alone, too.
  EXPECT_THAT(ReadPointsCsv(File("named.csv")).set_up, ElementsAre("door", "2", "door"));
  const Survey without = ReadSurvey(Write("one.csv", std::string("id,") + kHead + "a," + kRow));
  EXPECT_THAT(without.set_up, IsEmpty());
  EXPECT_THAT(SetUpNames(without), IsEmpty());
}

TEST_F(SetUps, GoToFilesAndBack) {
  const std::string text = std::string("set_up,id,") + kHead + "door,a," + kRow + "wall,b," + kRow;
  const Survey survey = ReadSurvey(Write("named.csv", text));
  WriteSurvey(File("named.h5"), survey, {});
  EXPECT_EQ(ReadSurvey(File("named.h5")).set_up, survey.set_up);
  WriteSurveyCsv(File("again.csv"), survey);
  EXPECT_EQ(ReadSurvey(File("again.csv")).set_up, survey.set_up);
}

// A program that knows of no set-ups refuses such a file, and reads what has none.
TEST_F(SetUps, MakeTheFileOfALaterVersion) {
  Survey survey = ReadSurvey(
      Write("named.csv", std::string("id,set_up,") + kHead + "a,door," + kRow + "b,wall," + kRow));
  WriteSurvey(File("named.h5"), survey, {});
  survey.set_up.clear();
  WriteSurvey(File("one.h5"), survey, {});
  EXPECT_THROW(H5Reader(File("named.h5"), kSurveySchema, 2), Error);
  EXPECT_NO_THROW(H5Reader(File("one.h5"), kSurveySchema, 2));
}

TEST_F(SetUps, StayWithTheirPointsWhenReadingsAreJoined) {
  Survey survey = ReadPointsCsv(Write(
      "points.csv", "id,x [m],y [m],z [m],set_up\na,1,2,3,door\nb,1,2,4,wall\nc,1,3,4,door\n"));
  const ReadingTable readings =
      ReadReadingsCsv(Write("readings.csv", "id,u1 [px],s1 [px]\nc,5,0.1\nb,6,0.1\n"));
  JoinReadings(readings, "readings.csv", &survey);
  EXPECT_THAT(survey.id, ElementsAre("b", "c"));
  EXPECT_THAT(survey.set_up, ElementsAre("wall", "door"));
}

TEST_F(SetUps, RefusalsNameTheirPlace) {
  const std::string head = std::string("id,set_up,") + kHead;
  EXPECT_EQ(ErrorOf(head + "a,1," + kRow + "b,2," + kRow), "no error");
  EXPECT_THAT(ErrorOf(head + "a,1," + kRow + "b,," + kRow),
              AllOf(HasSubstr("bad.csv:3:set_up"), HasSubstr("names no set-up")));
  for (const char* name : {"setup", "Set-up", "SETUP"}) {
    EXPECT_THAT(ErrorOf(std::string("id,") + name + "," + kHead + "a,1," + kRow),
                AllOf(HasSubstr(std::string("bad.csv:") + name), HasSubstr("name it 'set_up'")));
  }
}

// Angles, distances and prisms are about one station's place.
TEST_F(SetUps, WhatOneStationMeasuresIsRefused) {
  const std::string polar = "id,set_up,hz [gon],v [gon],d [m],shz [gon],sv [gon],sd [m]\n";
  const auto refusal = [&](const std::string& text) {
    Survey survey;
    try {
      ReadSurveyPoints(CsvTable::Load(Write("polar.csv", text)), &survey);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(refusal(polar + "a,1,10,90,4,0.01,0.01,0.001\nb,1,20,80,4,0.01,0.01,0.001\n"),
            "no error");
  EXPECT_THAT(refusal(polar + "a,1,10,90,4,0.01,0.01,0.001\nb,2,20,80,4,0.01,0.01,0.001\n"),
              AllOf(HasSubstr("polar.csv:hz"), HasSubstr("2 set-ups")));
  EXPECT_THAT(refusal(std::string("# station: 0, 0, 0\n# prism offset: 0.0175\nid,set_up,") +
                      kHead + "a,1," + kRow + "b,2," + kRow),
              AllOf(HasSubstr("prism offset"), HasSubstr("2 set-ups")));
}

}  // namespace
}  // namespace unfurl::data::set_ups_test
