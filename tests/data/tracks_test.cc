#include "data/tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "base/random.h"
#include "strobed_tracks.h"

namespace unfurl::data::tracks_test {
namespace {

using ::testing::HasSubstr;

// Apart from what other processes write.
std::string Path(const std::string& name) {
  return testing::TempDir() + std::to_string(getpid()) + name;
}

Tracks Sample(std::size_t n, int rank) {
  Rng rng(3);
  Tracks tracks;
  tracks.frame = "rig";
  tracks.marks = {"mark1", "mark2"};
  tracks.shared_rank = rank;
  const auto cols = static_cast<Eigen::Index>(n);
  tracks.p.resize(3, cols);
  tracks.cov.resize(6, cols);
  tracks.shared.resize(3, cols * rank);
  for (Eigen::Index i = 0; i < tracks.shared.size(); ++i) tracks.shared(i) = rng.Normal();
  for (std::size_t i = 0; i < n; ++i) {
    tracks.t.push_back(static_cast<double>(i) / 3.0);
    tracks.mark.push_back(static_cast<std::int32_t>(i % 2));
    tracks.status.push_back(static_cast<SampleStatus>(i % 4));
    const auto col = static_cast<Eigen::Index>(i);
    const bool usable = Usable(tracks.status.back());
    for (int k = 0; k < 3; ++k) {
      tracks.p(k, col) = usable ? rng.Normal() : std::numeric_limits<double>::quiet_NaN();
    }
    for (int k = 0; k < 6; ++k) {
      tracks.cov(k, col) = usable ? rng.Uniform() : std::numeric_limits<double>::quiet_NaN();
    }
  }
  return tracks;
}

// The shared part is stored in single precision.
Eigen::Matrix3Xd InFile(const Eigen::Matrix3Xd& shared) {
  return shared.cast<float>().cast<double>();
}

void ExpectSame(const Tracks& a, const Tracks& b) {
  EXPECT_EQ(a.frame, b.frame);
  EXPECT_EQ(a.marks, b.marks);
  EXPECT_EQ(a.smoothed, b.smoothed);
  EXPECT_EQ(a.t, b.t);
  EXPECT_EQ(a.mark, b.mark);
  EXPECT_EQ(a.status, b.status);
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    if (Usable(a.status[i])) {
      EXPECT_EQ(a.p.col(col), b.p.col(col));
      EXPECT_EQ(a.cov.col(col), b.cov.col(col));
    } else {
      EXPECT_TRUE(b.p.col(col).array().isNaN().all());
    }
  }
}

TEST(Tracks, GoToHdf5AndBackWithTheSharedPart) {
  for (const int rank : {0, 3}) {
    Tracks tracks = Sample(41, rank);
    tracks.smoothed = rank == 3;
    WriteTracks(Path("tracks.h5"), tracks, {});
    const Tracks back = ReadTracks(Path("tracks.h5"));
    ExpectSame(tracks, back);
    EXPECT_EQ(back.shared_rank, rank);
    EXPECT_EQ(back.shared, InFile(tracks.shared));
  }
  std::remove(Path("tracks.h5").c_str());
}

TEST(Tracks, StreamedBlocksAreTheWhole) {
  const Tracks tracks = Sample(24, 2);
  TracksWriter writer(Path("blocks.h5"), tracks, {});
  for (std::size_t first = 0; first < 24; first += 8) {
    Tracks block;
    block.shared_rank = 2;
    const auto at = static_cast<Eigen::Index>(first);
    block.p = tracks.p.middleCols(at, 8);
    block.cov = tracks.cov.middleCols(at, 8);
    block.shared = tracks.shared.middleCols(2 * at, 16);
    for (std::size_t i = first; i < first + 8; ++i) {
      block.t.push_back(tracks.t[i]);
      block.mark.push_back(tracks.mark[i]);
      block.status.push_back(tracks.status[i]);
    }
    writer.Append(block);
  }
  writer.Commit();
  const Tracks back = ReadTracks(Path("blocks.h5"));
  ExpectSame(tracks, back);
  EXPECT_EQ(back.shared, InFile(tracks.shared));
  std::remove(Path("blocks.h5").c_str());
}

TEST(Tracks, GoToCsvAndBack) {
  const Tracks tracks = Sample(20, 0);
  WriteTracksCsv(Path("tracks.csv"), tracks);
  ExpectSame(tracks, ReadTracksCsv(Path("tracks.csv")));
  std::remove(Path("tracks.csv").c_str());
}

TEST(Tracks, SamplesOfAMarkAreTheUsableOnes) {
  const Tracks tracks = Sample(16, 0);
  for (std::size_t i : tracks.SamplesOf(1)) {
    EXPECT_EQ(tracks.mark[i], 1);
    EXPECT_TRUE(Usable(tracks.status[i]));
  }
  // Samples 3, 7, 11, 15 are unsolvable, all of mark2.
  EXPECT_EQ(tracks.SamplesOf(0).size(), 8U);
  EXPECT_EQ(tracks.SamplesOf(1).size(), 4U);
  EXPECT_EQ(tracks.FindMark("mark2"), 1);
  EXPECT_EQ(tracks.FindMark("mark3"), -1);
}

TEST(Tracks, AnEmptyStatusInACsvIsGoodWhereThereIsAPosition) {
  std::ofstream(Path("plain_tracks.csv"))
      << "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
         "[m^2],status\n0,m,1,2,3,1,0,0,1,0,1,\n1,m,,,,,,,,,,\n2,m,1,2,3,1,0,0,1,0,1,three_"
         "cameras\n";
  const Tracks tracks = ReadTracksCsv(Path("plain_tracks.csv"));
  EXPECT_EQ(tracks.status,
            (std::vector<SampleStatus>{SampleStatus::kGood, SampleStatus::kUnsolvable,
                                       SampleStatus::kThreeCameras}));
  std::remove(Path("plain_tracks.csv").c_str());
}

TEST(Tracks, ACsvCellThatIsWrongIsNamed) {
  const std::string head =
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz [m^2],"
      "status\n";
  const auto error = [&](const std::string& row) {
    std::ofstream(Path("bad_tracks.csv")) << head << row;
    try {
      ReadTracksCsv(Path("bad_tracks.csv"));
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(error("0,m,1,2,3,1,0,0,1,0,1,good\n"), "no error");
  EXPECT_EQ(error("0,m,,,,,,,,,,unsolvable\n"), "no error");
  // An empty status is what a missing column is: good where there is a position.
  EXPECT_EQ(error("0,m,1,2,3,1,0,0,1,0,1,\n0,m,,,,,,,,,,\n"), "no error");
  EXPECT_THAT(error("0,m,1,2,,1,0,0,1,0,1,\n"), HasSubstr("bad_tracks.csv:2:z"));
  EXPECT_THAT(error("0,m,1,2,3,1,0,0,1,0,1,fine\n"), HasSubstr("bad_tracks.csv:2:status"));
  EXPECT_THAT(error("0,m,1,,3,1,0,0,1,0,1,good\n"), HasSubstr("bad_tracks.csv:2:y"));
  EXPECT_THAT(error("0,,1,2,3,1,0,0,1,0,1,good\n"), HasSubstr("mark"));
  EXPECT_THAT(error("nan,m,1,2,3,1,0,0,1,0,1,good\n"), HasSubstr("bad_tracks.csv:2:t"));
  std::remove(Path("bad_tracks.csv").c_str());
}

TEST(Tracks, HowSamplesCameAboutGoesThroughTheFile) {
  const Tracks tracks = Strobed();
  const std::string path = Path("reasons.h5");
  WriteTracks(path, tracks, {});
  const Tracks back = ReadTracks(path);
  std::remove(path.c_str());
  EXPECT_EQ(back.cameras, tracks.cameras);
  EXPECT_EQ(back.used, tracks.used);
  EXPECT_EQ(back.left_out, tracks.left_out);
  EXPECT_EQ(back.reason, tracks.reason);
}

}  // namespace
}  // namespace unfurl::data::tracks_test
