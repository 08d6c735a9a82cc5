// Raw lines of a frame grabber through the real program.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "data/trial.h"
#include "tests/cli/program.h"

namespace unfurl::cli {
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

}  // namespace
}  // namespace unfurl::cli
