// One registry of formats: endings in any case, tracks in every form, any file by one call.
#include "data/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>


#include "base/error.h"
#include "data/atomic_file.h"
#include "tests/own_folder.h"
#include "tests/source_dir.h"

namespace unfurl::data::formats_test {
namespace {

class Formats : public ::testing::Test {
 protected:
  std::string File(const std::string& name) const { return folder_.File(name); }
  OwnFolder folder_;
};

Tracks TwoMarks() {
  Tracks tracks;
  tracks.frame = "rig";
  tracks.marks = {"a", "b"};
  constexpr int kSamples = 12;
  constexpr double kStep = 0.01, kSigma = 2e-4;
  tracks.p.resize(3, kSamples);
  tracks.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, kSamples);
  tracks.shared.resize(3, 0);
  for (int i = 0; i < kSamples; ++i) {
    tracks.t.push_back(kStep * (i / 2));
    tracks.mark.push_back(i % 2);
    tracks.status.push_back(SampleStatus::kGood);
    tracks.p.col(i) << 0.125 * i, 0.5 - 0.25 * i, 0.0625;
    for (int row : {0, 3, 5}) tracks.cov(row, i) = kSigma * kSigma;
  }
  return tracks;
}

TEST(FormatOf, KnowsEndingsInAnyCase) {
  EXPECT_EQ(FormatOf("a/TRACKS.CSV"), FileFormat::kCsv);
  EXPECT_EQ(FormatOf("run.H5"), FileFormat::kHdf5);
  EXPECT_EQ(FormatOf("x.c3D"), FileFormat::kC3d);
  EXPECT_EQ(FormatOf("x.Unv"), FileFormat::kUff);
  EXPECT_EQ(FormatOf("csv"), FileFormat::kUnknown);  // a name, not an ending
  EXPECT_EQ(FormatOf("a.b/c"), FileFormat::kUnknown);
}

TEST_F(Formats, TracksComeBackFromEveryFormUnderAnyCase) {
  const Tracks from = TwoMarks();
  for (const char* name : {"t.h5", "T.CSV", "t.C3D", "t.uff", "T.Unv"}) {
    WriteTracksAny(File(name), from, Provenance{});
    const Tracks to = ReadTracksAny(File(name));
    ASSERT_EQ(to.size(), from.size()) << name;
    EXPECT_EQ(to.marks, from.marks) << name;
    const auto any = Load(File(name));
    ASSERT_TRUE(std::holds_alternative<Tracks>(any)) << name;
    for (std::size_t m = 0; m < 2; ++m) {
      const auto a = from.SamplesOf(static_cast<std::int32_t>(m));
      const auto b = to.SamplesOf(static_cast<std::int32_t>(m));
      ASSERT_EQ(a.size(), b.size()) << name;
      for (std::size_t i = 0; i < a.size(); ++i) {
        // C3D holds millimetres as 32-bit floats; these are dyadic fractions of a metre.
        EXPECT_LT((from.p.col(static_cast<Eigen::Index>(a[i])) -
                   to.p.col(static_cast<Eigen::Index>(b[i])))
                      .norm(),
                  1e-6)
            << name;
      }
    }
  }
}

TEST_F(Formats, AnyFileIsLoadedByWhatItIs) {
  const std::string sets = UNFURL_SOURCE_DIR "/data/sets/";
  EXPECT_TRUE(std::holds_alternative<Scene>(Load(sets + "bouncing_latch/scene.toml")));
  EXPECT_TRUE(std::holds_alternative<Study>(Load(sets + "deployment/study.toml")));
  EXPECT_TRUE(std::holds_alternative<Study>(Load(sets + "deployment/study_smooth.toml")));
}

TEST_F(Formats, WhatIsNoRecordIsRefusedWithARemedy) {
  auto where = [&](const std::string& path, auto read) {
    try {
      read(path);
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), ::testing::StartsWith(path));
      return std::string(e.what());
    }
    return std::string("no error");
  };
  WriteTextFile(File("a.toml"), "x = 1\n");
  EXPECT_THAT(where(File("a.toml"), [](const std::string& p) { Load(p); }),
              ::testing::HasSubstr("not one record"));
  EXPECT_THAT(where(File("a.toml"), [](const std::string& p) { ReadTracksAny(p); }),
              ::testing::HasSubstr("no file of tracks"));
}

}  // namespace
}  // namespace unfurl::data::formats_test
