#include "data/survey_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "base/error.h"
#include "tests/own_folder.h"

namespace unfurl::data::survey_points_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

class SurveyPoints : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text) const {
    const std::string path = folder_.File(name);
    std::ofstream(path) << text;
    return path;
  }
  Survey Points(const std::string& text, bool expect_sigmas = true) const {
    Survey survey;
    EXPECT_EQ(ReadSurveyPoints(CsvTable::Load(Write("p.csv", text)), &survey), expect_sigmas);
    return survey;
  }
  OwnFolder folder_;
};

TEST_F(SurveyPoints, EastNorthHeightInEitherOrderIsRightHanded) {
  const Survey en = Points("id,E [m],N [m],H [m],sE [m],sN [m],sH [m]\na,1,2,3,0.1,0.2,0.3\n");
  EXPECT_EQ(en.p.col(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(en.notes.empty());
  const Survey ne = Points("id,N [m],E [m],H [m],sN [m],sE [m],sH [m]\na,2,1,3,0.2,0.1,0.3\n");
  EXPECT_EQ(ne.p.col(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(ne.cov.col(0), en.cov.col(0));
  EXPECT_THAT(ne.notes, Contains(HasSubstr("left-handed")));
}

// The same points in metres, and in the units that the header names, column by column.
TEST_F(SurveyPoints, LengthsHaveTheUnitOfTheirColumn) {
  const Survey metres = Points(
      "# station: 4, 5, 6\nid,x [m],y [m],z [m],sx [m],sy [m],sz [m]\n"
      "a,1.5,-0.25,3,0.5,0.25,0.125\n");
  const Survey mixed = Points(
      "# station: 4000, 5000, 6000 [mm]\n"
      "id,x [mm],y [cm],z [m],sx [mm],sy [cm],sz [um]\na,1500,-25,3,500,25,125000\n");
  EXPECT_LT((mixed.p - metres.p).norm(), 1e-12);
  EXPECT_LT((mixed.cov - metres.cov).norm(), 1e-12);
  EXPECT_LT((mixed.station - metres.station).norm(), 1e-12);
  const Survey american = Points("id,x [in],y [ft],z [m],sx [in],sy [ft],sz [m]\na,30,3,1,1,1,1\n");
  EXPECT_LT((american.p.col(0) - Eigen::Vector3d(0.762, 0.9144, 1.0)).norm(), 1e-12);
  const Survey whole = Points(
      "id,x [mm],y [mm],z [mm],cxx [mm^2],cxy [mm^2],cxz [mm^2],cyy [mm^2],cyz [mm^2],"
      "czz [mm^2]\na,1500,-250,3000,250000,0,0,62500,0,15625\n");
  EXPECT_LT((whole.cov - metres.cov).norm(), 1e-12);
  const Survey polar = Points(
      "id,hz [gon],v [gon],d [mm],shz [mgon],sv [mgon],sd [mm]\n"
      "a,100,100,4500,1,1,2\n");
  EXPECT_LT((polar.p.col(0) - Eigen::Vector3d(4.5, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(polar.cov(0, 0), 4e-6, 1e-12);
}

TEST_F(SurveyPoints, WhatAllPointsShareIsStatedInComments) {
  const std::string points = "id,x [m],y [m],z [m],sx [m],sy [m],sz [m]\na,1,2,3,0.1,0.2,0.3\n";
  const Survey survey = Points(
      "# station: 4, 5, 6\n# distance error: 1e-3, 1.5e-6\n# zenith error: 2e-5 [rad]\n" + points);
  EXPECT_EQ(survey.station, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(survey.station_errors.distance_offset, 1e-3);
  EXPECT_EQ(survey.station_errors.distance_scale, 1.5e-6);
  EXPECT_EQ(survey.station_errors.zenith, 2e-5);
  EXPECT_EQ(Points(points).station_errors.distance_offset, 0.0);
  EXPECT_THROW(Points("# distance error: 1e-3\n" + points), Error);
  EXPECT_THROW(Points("# distance error: -1e-3, 0\n" + points), Error);
  EXPECT_THROW(Points("# zenith error: nan\n" + points), Error);
}

// Angles and distances from a station: east of it, north of it, and steeply up, in gon.
TEST_F(SurveyPoints, AnglesAndDistances) {
  const Survey survey = Points(
      "# station: 10, 20, 1\n# prism offset: 0.5 [m]\n# led offset: 0, 0, -0.1 [m]\n"
      "id,hz [gon],v [gon],d [m],shz [mgon],sv [mgon],sd [m]\n"
      "east,100,100,4.5,1,1,0.001\nnorth,0,100,1.5,1,1,0.001\nup,50,50,0.5,1,1,0.001\n");
  EXPECT_LT((survey.p.col(0) - Eigen::Vector3d(15, 20, 0.9)).norm(), 1e-12);
  EXPECT_LT((survey.p.col(1) - Eigen::Vector3d(10, 22, 0.9)).norm(), 1e-12);
  EXPECT_LT((survey.p.col(2) - Eigen::Vector3d(10.5, 20.5, 0.9 + std::sqrt(0.5))).norm(), 1e-12);
  // East: the distance's sigma along x, the angles' across it, 5 m away.
  const double across = 5.0 * std::numbers::pi / 200e3;
  EXPECT_NEAR(survey.cov(0, 0), 1e-6, 1e-12);
  EXPECT_NEAR(survey.cov(3, 0), across * across, 1e-15);
  EXPECT_NEAR(survey.cov(5, 0), across * across, 1e-15);
  EXPECT_EQ(survey.station, Eigen::Vector3d(10, 20, 1));
}

TEST_F(SurveyPoints, PolarDerivativesAgreeWithDifferences) {
  Eigen::Matrix3d J;
  const Eigen::Vector3d at(0.7, 1.2, 4.0);
  FromPolar(at(0), at(1), at(2), &J);
  for (int k = 0; k < 3; ++k) {
    constexpr double kStep = 1e-6;
    Eigen::Vector3d a = at, b = at;
    a(k) += kStep;
    b(k) -= kStep;
    const Eigen::Vector3d slope =
        (FromPolar(a(0), a(1), a(2)) - FromPolar(b(0), b(1), b(2))) / (2.0 * kStep);
    EXPECT_LT((slope - J.col(k)).norm(), 1e-9);  // 4 m times the step squared, and round-off
  }
}

// Coordinates called x, y, z that are really N, E, H: the angles beside them tell.
TEST_F(SurveyPoints, AnglesTellLeftHandedCoordinates) {
  std::string right = "id,x [m],y [m],z [m],sx [m],sy [m],sz [m],hz [rad],v [rad],d [m]\n";
  std::string left = right;
  const std::vector<Eigen::Vector3d> polar = {
      {0.1, 1.2, 4}, {0.5, 1.6, 5}, {0.9, 1.3, 3}, {1.4, 1.9, 4}, {0.3, 1.0, 6}};
  for (std::size_t k = 0; k < polar.size(); ++k) {
    const Eigen::Vector3d p = FromPolar(polar[k](0), polar[k](1), polar[k](2));
    const std::string tail = ",0.1,0.2,0.3," + std::to_string(polar[k](0)) + "," +
                             std::to_string(polar[k](1)) + "," + std::to_string(polar[k](2)) + "\n";
    const auto line = [&](double a, double b) {
      return "p" + std::to_string(k) + "," + std::to_string(a) + "," + std::to_string(b) + "," +
             std::to_string(p.z());
    };
    right += line(p.x(), p.y()) + tail;
    left += line(p.y(), p.x()) + tail;
  }
  const Survey a = Points(right), b = Points(left);
  EXPECT_TRUE(a.notes.empty());
  EXPECT_THAT(b.notes, Contains(HasSubstr("left-handed (N, E, H)")));
  EXPECT_EQ(a.p, b.p);
  EXPECT_DOUBLE_EQ(b.cov(0, 0), 0.04);  // what was the second column's
}

TEST_F(SurveyPoints, RefusesWhatItCannotUse) {
  const auto refuse = [&](const std::string& text, const std::string& words) {
    Survey survey;
    try {
      ReadSurveyPoints(CsvTable::Load(Write("bad.csv", text)), &survey);
      ADD_FAILURE() << words;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(words));
    }
  };
  refuse("id,x [m],y [m]\na,1,2\n", "z");
  refuse("id,hz [furlong],v [gon],d [m]\na,1,2,3\n", "furlong");
  refuse("# prism offset: 0.03\nid,x [m],y [m],z [m]\na,1,2,3\n", "station");
  refuse("# station: 1, 2, 3 [yd]\nid,x [m],y [m],z [m]\na,1,2,3\n", "no length");
  refuse("id,x [m^2],y [m],z [m]\na,1,2,3\n", "[m^2]");
  refuse("# station: 1, 2\nid,x [m],y [m],z [m]\na,1,2,3\n", "2 numbers");
  refuse("id,hz [gon],v [gon],d [m]\na,1,2,0\n", "not positive");
}

TEST_F(SurveyPoints, GsiOfEitherWidth) {
  const std::string narrow =
      Write("a.gsi",
            "110001+0000A110 81..00+00012345 82..00+00067890 83..00-00000500 \r\n"
            "110002+00000P07 81..06+00123456 82..06+00000010 83..08+00100000\n");
  ASSERT_TRUE(LooksLikeGsi(narrow));
  const Survey survey = ReadGsi(narrow, {.coordinate = 3e-4});
  EXPECT_THAT(survey.id, ::testing::ElementsAre("A110", "P07"));
  EXPECT_LT((survey.p.col(0) - Eigen::Vector3d(12.345, 67.890, -0.5)).norm(), 1e-12);
  EXPECT_LT((survey.p.col(1) - Eigen::Vector3d(12.3456, 0.001, 1.0)).norm(), 1e-12);
  EXPECT_NEAR(survey.cov(0, 0), 9e-8, 1e-20);
  const std::string wide =
      Write("b.gsi",
            "*110001+0000000000000T01 21.102+0000000010000000 22.102+0000000010000000 "
            "31..00+0000000000005000\n");
  ASSERT_TRUE(LooksLikeGsi(wide));
  const Survey polar = ReadGsi(wide, {.angle = 1e-5, .distance = 1e-3});
  EXPECT_EQ(polar.id[0], "T01");
  EXPECT_LT((polar.p.col(0) - Eigen::Vector3d(5, 0, 0)).norm(), 1e-9);  // 100 gon: east
  EXPECT_THROW(ReadGsi(wide, {}), Error);
  EXPECT_THROW(ReadGsi(narrow, {}), Error);
  EXPECT_FALSE(LooksLikeGsi(Write("c.csv", "id,x [m]\na,1\n")));
  EXPECT_THROW(ReadGsi(Write("d.gsi", "110001+0000A110 81..00+000123\n"), {.coordinate = 1.0}),
               Error);
}

TEST_F(SurveyPoints, RepeatsAreAveragedAndWidenedWhereTheyScatter) {
  std::string text = "# cameras: door, window\nid,u1 [px],s1 [px],u2 [px],s2 [px]\n";
  for (int k = 0; k < 20; ++k) {
    // Camera 1 repeats as it says (+-0.1 about the mean), camera 2 five times worse.
    const double sign = k % 2 == 0 ? 1.0 : -1.0;
    text += "p" + std::to_string(k / 4) + "," + std::to_string(100.0 + 0.1 * sign) + ",0.1," +
            std::to_string(200.0 + 0.5 * sign) + ",0.1\n";
  }
  const ReadingTable table = ReadReadingsCsv(Write("r.csv", text));
  ASSERT_EQ(table.id.size(), 5U);
  EXPECT_NEAR(table.u_px(0, 0), 100.0, 1e-9);
  EXPECT_NEAR(table.s_px(0, 0), 0.05, 1e-9);
  // Squares sum to 20 * 25 with 15 to spare.
  EXPECT_NEAR(table.s_px(0, 1), 0.05 * std::sqrt(20.0 * 25.0 / 15.0), 1e-9);
  EXPECT_THAT(table.notes, Contains(HasSubstr("camera window")));
  EXPECT_EQ(table.notes.size(), 1U);
}

TEST_F(SurveyPoints, LongReadingsJoinPointsById) {
  const ReadingTable table = ReadReadingsCsv(
      Write("long.csv",
            "id,camera,u [px],s [px]\nb,door,1,0.1\na,door,2,0.1\nb,window,3,0.1\nz,door,4,1\n"));
  Survey survey = Points(
      "id,x [m],y [m],z [m],sx [m],sy [m],sz [m]\na,1,0,0,1,1,1\nb,2,0,0,1,1,1\n"
      "c,3,0,0,1,1,1\n");
  JoinReadings(table, "long.csv", &survey);
  EXPECT_THAT(survey.id, ::testing::ElementsAre("a", "b"));
  EXPECT_THAT(survey.cameras, ::testing::ElementsAre("door", "window"));
  EXPECT_EQ(survey.u_px(0, 0), 2.0);
  EXPECT_TRUE(std::isnan(survey.u_px(0, 1)));
  EXPECT_EQ(survey.u_px(1, 1), 3.0);
  EXPECT_THAT(survey.notes, Contains(HasSubstr("1 surveyed points have no readings")));
  EXPECT_THAT(survey.notes, Contains(HasSubstr("1 ids were not surveyed")));
}

// A wave of a bar is checked as its placements are, and is no survey.
TEST_F(SurveyPoints, ABarsReadingsAreNamedByPoseAndMark) {
  const ReadingTable bar = ReadReadingsCsv(
      Write("bar.csv", "pose,mark,u1 [px],s1 [px]\n12,a,5,0.1\n12,b,6,0.1\n3,a,7,0.1\n"));
  EXPECT_THAT(bar.id, ::testing::ElementsAre("12a", "12b", "3a"));
  const std::string moves =
      Write("moves.csv", "pose,mark,time [s],u1 [px],s1 [px]\n1,a,0,5,0.1\n1,b,0.002,6,0.1\n");
  EXPECT_THROW(ReadReadingsCsv(moves), Error);
  try {
    Points("pose,mark,u1 [px],s1 [px]\n12,a,5,0.1\n");
    ADD_FAILURE() << "taken for a survey";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("holds readings of a bar"));
    EXPECT_THAT(e.what(), HasSubstr("--wand"));
  }
}

}  // namespace
}  // namespace unfurl::data::survey_points_test
