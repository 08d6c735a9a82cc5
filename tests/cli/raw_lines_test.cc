// Raw lines of a frame grabber through the real program.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "data/survey.h"
#include "data/trial.h"
#include "tests/cli/program.h"

namespace unfurl::cli::raw_lines_test {
namespace {

using ::testing::HasSubstr;

class RawLines : public ProgramTest {
 protected:
  // 30 lines of two cameras side by side, 8 bits, element k of line i of camera c: i + k + 100 c.
  void MakeFiles(const std::string& sensor, const std::string& recording) const {
    std::string bytes;
    for (int i = 0; i < 30; ++i) {
      for (int c = 0; c < 2; ++c) {
        for (int k = 0; k < 80; ++k) bytes += static_cast<char>(i + k + 100 * c);
      }
    }
    Put("all.raw", bytes);
    Put("lines.toml",
        "[sensor]\n" + sensor +
            "dummy = 2\ndark = 10\nactive = 64\ndark_after = 4\nparity = 0\n"
            "electrons_per_count = 200.0\nread_noise_counts = 0.3\n[recording]\n"
            "format = \"binary\"\nbytes = 1\nline_rate = 2000.0\nslots = [\"tip\", \"dark\"]\n"
            "cameras = [\"left\", \"right\"]\n" +
            recording);
  }
};

TEST_F(RawLines, BecomeATrial) {
  MakeFiles("bits = 8\n", "files = [\"all.raw\"]\n");
  const Outcome outcome = Run({"convert", "lines.toml", "trial.h5", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["schema"], "unfurl/trial");
  const data::TrialReader trial((folder_ / "trial.h5").string());
  ASSERT_EQ(trial.size(), 30U);
  EXPECT_EQ(trial.header().cameras, (std::vector<std::string>{"left", "right"}));
  EXPECT_EQ(trial.header().line_rate, 2000.0);
  data::TrialBlock block;
  trial.Read(0, 30, &block);
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_NEAR(block.t[i], (static_cast<double>(i) + 0.5) / 2000.0, 1e-12);
    EXPECT_EQ(block.slot[i], static_cast<std::int32_t>(i % 2));
    for (std::size_t c = 0; c < 2; ++c) {
      for (std::size_t k = 0; k < 80; ++k) {
        ASSERT_EQ(block.counts[(i * 2 + c) * 80 + k], i + k + 100 * c);
      }
    }
  }
  const Outcome info = Run({"info", "trial.h5"});
  EXPECT_THAT(info.out, HasSubstr("all.raw"));  // its hash is in the provenance
}

TEST_F(RawLines, WhatDoesNotFitIsRefusedAndLeavesNothing) {
  const std::vector<std::string> before = {"all.raw", "lines.toml"};
  MakeFiles("bits = 8\n", "files = [\"al.raw\"]\n");
  ExpectRefused(Run({"convert", "lines.toml", "trial.h5"}),
                {"lines.toml:16:recording.files", "no file", "check the name"}, before);
  MakeFiles("bits = 8\n", "files = [\"all.raw\"]\nline_hedder = 4\n");
  ExpectRefused(Run({"convert", "lines.toml", "trial.h5"}),
                {"lines.toml:17:recording.line_hedder", "line_header"}, before);
  MakeFiles("bits = 8\n", "files = [\"all.raw\"]\nline_trailer = 7\n");
  ExpectRefused(Run({"convert", "lines.toml", "trial.h5"}), {"all.raw:29", "bytes into line"},
                before);
  MakeFiles("bits = 8\n", "files = [\"all.raw\"]\n");
  ExpectRefused(Run({"convert", "lines.toml", "trial.csv"}), {"trial.csv", "cannot become"},
                before);
}

// The shipped survey's own lines, as a frame grabber would have written them: 20 points, for each
// the lit line `lit` times and then the dark one, a file a camera.
class RawSurvey : public ProgramTest {
 protected:
  static constexpr std::size_t kPoints = 20;

  void SetUp() override {
    ProgramTest::SetUp();
    survey_ = data::ReadSurvey(Shipped("survey.h5"));
  }

  void MakeFiles(int lit, const std::string& which) const {
    const std::size_t elements = survey_.format.elements(), cameras = survey_.cameras.size();
    const data::LineFormat& f = survey_.format;
    std::string text = fmt::format(
        "[sensor]\nbits = {}\nelectrons_per_count = {}\nread_noise_counts = {}\n[survey]\n"
        "points = \"points.csv\"\n{}\n[recording]\nformat = \"binary\"\nslots = [",
        f.bits, f.electrons_per_count, f.read_noise_counts, which);
    for (int k = 0; k < lit; ++k) text += "\"led\", ";
    text += "\"dark\"]\n";
    for (std::size_t c = 0; c < cameras; ++c) {
      std::string bytes;
      const auto add = [&](const std::vector<std::uint16_t>& lines, std::size_t point) {
        for (std::size_t k = 0; k < elements; ++k) {
          const std::uint16_t count = lines[(point * cameras + c) * elements + k];
          bytes += static_cast<char>(count & 0xff);
          bytes += static_cast<char>(count >> 8);
        }
      };
      for (std::size_t i = 0; i < kPoints; ++i) {
        for (int k = 0; k < lit; ++k) add(survey_.lit, i);
        add(survey_.dark, i);
      }
      Put(survey_.cameras[c] + ".raw", bytes);
      text += fmt::format("[camera.{0}]\nfiles = [\"{0}.raw\"]\n", survey_.cameras[c]);
    }
    Put("survey.toml", text);
    std::string points = "id,x [m],y [m],z [m],sx [m],sy [m],sz [m]\n";
    for (std::size_t i = 0; i < kPoints; ++i) {
      const Eigen::Vector3d p = survey_.p.col(static_cast<Eigen::Index>(i));
      points += fmt::format("{},{},{},{},3e-4,3e-4,3e-4\n", survey_.id[i], p.x(), p.y(), p.z());
    }
    Put("points.csv", points);
  }

  data::Survey survey_;
};

// Readings as a survey's own lines give them, where it holds the same; of two lit lines, the mean
// with sigma / sqrt(2).
TEST_F(RawSurvey, BecomesASurveyWithReadings) {
  data::Survey some = survey_;
  const std::size_t counts = kPoints * some.cameras.size() * some.format.elements();
  some.id.resize(kPoints);
  some.p = survey_.p.leftCols(kPoints);
  some.cov = survey_.cov.leftCols(kPoints);
  some.lit.resize(counts);
  some.dark.resize(counts);
  data::WriteSurvey((folder_ / "lines.h5").string(), some, {});
  ASSERT_EQ(Run({"convert", "lines.h5", "whole.csv", "--quiet"}).code, 0);
  const data::Survey whole = data::ReadSurvey((folder_ / "whole.csv").string());
  for (const int lit : {1, 2}) {
    MakeFiles(lit, fmt::format("lines_each = {}", lit + 1));
    const Outcome outcome = Run({"convert", "survey.toml", "survey.h5", "--json"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(nlohmann::json::parse(outcome.out)["schema"], "unfurl/survey");
    const data::Survey made = data::ReadSurvey((folder_ / "survey.h5").string());
    ASSERT_EQ(made.size(), kPoints);
    EXPECT_EQ(made.cameras, whole.cameras);
    int seen = 0;
    for (Eigen::Index i = 0; i < made.u_px.rows(); ++i) {
      for (Eigen::Index c = 0; c < made.u_px.cols(); ++c) {
        ASSERT_EQ(std::isnan(made.u_px(i, c)), std::isnan(whole.u_px(i, c)));
        if (std::isnan(made.u_px(i, c))) continue;
        ++seen;
        EXPECT_NEAR(made.u_px(i, c), whole.u_px(i, c), 1e-9);
        EXPECT_NEAR(made.s_px(i, c) * std::sqrt(lit), whole.s_px(i, c), 1e-9);
      }
    }
    EXPECT_GT(seen, 60);
  }
  EXPECT_THAT(Run({"info", "survey.h5"}).out, HasSubstr("points.csv"));
}

// Lines in any order, told by a row each; a point that comes again is a repeat.
TEST_F(RawSurvey, LinesAreTakenByTheirIds) {
  std::string ids = "slot,id\n";
  for (std::size_t i = 0; i < kPoints; ++i) {
    ids += fmt::format("led,{}\ndark,\n", survey_.id[(i + 7) % kPoints]);
  }
  MakeFiles(1, "ids = \"ids.csv\"");
  Put("ids.csv", ids);
  ASSERT_EQ(Run({"convert", "survey.toml", "turned.h5", "--quiet"}).code, 0);
  MakeFiles(1, "lines_each = 2");
  ASSERT_EQ(Run({"convert", "survey.toml", "plain.h5", "--quiet"}).code, 0);
  const data::Survey turned = data::ReadSurvey((folder_ / "turned.h5").string());
  const data::Survey plain = data::ReadSurvey((folder_ / "plain.h5").string());
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(kPoints); ++i) {
    for (Eigen::Index c = 0; c < plain.u_px.cols(); ++c) {
      const double a = turned.u_px((i + 7) % kPoints, c), b = plain.u_px(i, c);
      EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b)));
    }
  }
}

TEST_F(RawSurvey, WhatDoesNotFitIsRefusedAndLeavesNothing) {
  MakeFiles(1, "lines_each = 2");
  std::vector<std::string> before = Files();
  const auto refused = [&](const std::vector<std::string>& words) {
    ExpectRefused(Run({"convert", "survey.toml", "survey.h5"}), words, before);
  };
  MakeFiles(1, "lines_each = 3");
  refused({"survey.toml", "40 lines where 60", "lines_each"});
  MakeFiles(1, "lines_each = 4\nids = \"points.csv\"");
  refused({"survey.toml:8:survey.ids", "one way"});
  MakeFiles(1, "ids = \"nothing.csv\"");
  refused({"survey.toml:7:survey.ids", "no file"});
  MakeFiles(1, "lines_each = 2\nlines_eech = 2");
  refused({"survey.toml:8:survey.lines_eech", "lines_each"});
  Put("points.csv", "id,x [m],y [m],z [m]\np,0,0,0\n");
  Put("survey.toml", [&] {
    std::string text = Get("survey.toml");
    return text.erase(text.find("lines_eech"), 14);
  }());
  refused({"points.csv", "no uncertainty", "sx [m]"});
  MakeFiles(1, "ids = \"ids.csv\"");
  Put("ids.csv", "id\nnobody\n");
  before = Files();
  refused({"ids.csv:2:id", "nobody", "points.csv"});
  Put("ids.csv", "id\n" + survey_.id[0] + "\n");
  refused({"ids.csv", "1 rows", "each line"});
}

}  // namespace
}  // namespace unfurl::cli::raw_lines_test
