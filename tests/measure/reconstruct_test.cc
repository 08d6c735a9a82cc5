#include "measure/reconstruct.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "base/error.h"
#include "base/statistics.h"
#include "measure/expose.h"
#include "measure/survey_readings.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::reconstruct_test {
namespace {

// One second of the shipped lab, recorded once, and a rig laid through what its cameras truly see.
struct Recorded {
  data::Lab lab = ShippedLab();
  VirtualRig truth_rig = MakeVirtualRig(lab);
  data::Rig rig = FitRig(truth_rig, lab.volume_low, lab.volume_high);
  data::Tracks truth;
  std::string path = testing::TempDir() + std::to_string(getpid()) + "recorded.h5";

  Recorded() {
    // FitCamera leaves 0.0004 px at most; what spots are biased by is more.
    rig.model_floor_px = 0.002;
    data::TrialWriter writer(path, HeaderOf(lab), {});
    ExposeTrial(lab, SwingingRun(1.0), writer, {}, &truth);
    writer.Commit();
  }
  ~Recorded() { std::remove(path.c_str()); }
};

const Recorded& Shared() {
  static const Recorded recorded;
  return recorded;
}

// The recorded trial again, with the lines changed by `edit(line, slot name, camera, active
// pixels)`.
template <typename Edit>
std::string Edited(const std::string& name, const Edit& edit) {
  const data::TrialReader trial(Shared().path);
  const data::TrialHeader& header = trial.header();
  data::TrialBlock block;
  trial.Read(0, trial.size(), &block);
  const std::size_t elements = header.format.elements();
  for (std::size_t i = 0; i < block.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      std::uint16_t* line = &block.counts[(i * 4 + c) * elements];
      edit(i, header.slots[static_cast<std::size_t>(block.slot[i])], c,
           std::span<std::uint16_t>(line + header.format.first_active(),
                                    static_cast<std::size_t>(header.format.active)));
    }
  }
  const std::string path = testing::TempDir() + std::to_string(getpid()) + name;
  data::TrialWriter writer(path, header, {});
  writer.Append(block);
  writer.Commit();
  return path;
}

// As if a hand were before the lens: every pixel counts what most count.
void Blind(std::span<std::uint16_t> active) {
  std::vector<std::uint16_t> sorted(active.begin(), active.end());
  std::sort(sorted.begin(), sorted.end());
  std::fill(active.begin(), active.end(), sorted[sorted.size() / 2]);
}

TEST(Reconstruct, ThroughGlassEveryMarkIsFoundWithinItsErrorBars) {
  const data::TrialReader trial(Shared().path);
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(trial, Shared().rig, {}, &summary);
  ASSERT_EQ(tracks.size(), Shared().truth.size());
  EXPECT_EQ(summary.samples(), tracks.size());
  EXPECT_EQ(summary.usable(), tracks.size());
  std::vector<double> distance;
  double nees = 0.0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_EQ(tracks.t[i], Shared().truth.t[i]);
    EXPECT_EQ(tracks.marks[static_cast<std::size_t>(tracks.mark[i])],
              Shared().truth.marks[static_cast<std::size_t>(Shared().truth.mark[i])]);
    ASSERT_EQ(tracks.status[i], data::SampleStatus::kGood);
    const Eigen::Vector3d e = tracks.p.col(col) - Shared().truth.p.col(col);
    distance.push_back(e.norm());
    nees += e.dot(tracks.Covariance(i).inverse() * e) / static_cast<double>(tracks.size());
  }
  // A rig known as well as its model can be: what is left is spots and model, some 10 um each.
  EXPECT_LT(Rms(distance), 40e-6);
  EXPECT_LT(Quantile(distance, 1.0), 200e-6);
  // The floor's part is smooth, not noise, so this is no test of distribution; but an error bar
  // that is half, or twice, the error would show.
  EXPECT_GT(nees, 3.0 / 4.0);
  EXPECT_LT(nees, 3.0 * 4.0);
}

TEST(Reconstruct, BlocksAndWorkersChangeNothing) {
  const data::TrialReader trial(Shared().path);
  const data::Tracks whole = Reconstruct(trial, Shared().rig, {.workers = 1});
  Reconstructor streamed(trial, Shared().rig, "the rig", {.workers = 2});
  data::TrialBlock block;
  data::Tracks part;
  std::size_t sample = 0;
  for (std::size_t first = 0; first < trial.size(); first += 97) {
    trial.Read(first, std::min<std::size_t>(97, trial.size() - first), &block);
    streamed.Process(block, &part);
    for (std::size_t i = 0; i < part.size(); ++i, ++sample) {
      const auto col = static_cast<Eigen::Index>(i);
      const auto at = static_cast<Eigen::Index>(sample);
      EXPECT_EQ(part.t[i], whole.t[sample]);
      EXPECT_EQ(part.mark[i], whole.mark[sample]);
      EXPECT_EQ(part.status[i], whole.status[sample]);
      EXPECT_EQ((part.p.col(col) - whole.p.col(at)).norm(), 0.0);
      EXPECT_EQ((part.cov.col(col) - whole.cov.col(at)).norm(), 0.0);
    }
  }
  EXPECT_EQ(sample, whole.size());
}

TEST(Reconstruct, ABlindCameraLeavesThree) {
  const std::string path = Edited("blind.h5", [](std::size_t, const std::string&, std::size_t c,
                                                 std::span<std::uint16_t> active) {
    if (c == 2) Blind(active);
  });
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(data::TrialReader(path), Shared().rig, {}, &summary);
  std::remove(path.c_str());
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    ASSERT_EQ(tracks.status[i], data::SampleStatus::kThreeCameras);
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_LT((tracks.p.col(col) - Shared().truth.p.col(col)).norm(), 500e-6);
  }
  EXPECT_EQ(summary.readings[2], 0U);
  EXPECT_EQ(summary.flags[2][3], tracks.size());  // kSpotDim
}

TEST(Reconstruct, TwoBlindCamerasLeaveNothingAndSayWhy) {
  const std::string path = Edited("blind2.h5", [](std::size_t, const std::string&, std::size_t c,
                                                  std::span<std::uint16_t> active) {
    if (c >= 2) Blind(active);
  });
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(data::TrialReader(path), Shared().rig, {}, &summary);
  std::remove(path.c_str());
  EXPECT_EQ(summary.usable(), 0U);
  EXPECT_EQ(summary.Unsolved().at("too few readings"), tracks.size());
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    EXPECT_TRUE(std::isnan(tracks.p(0, static_cast<Eigen::Index>(i))));
  }
}

TEST(Reconstruct, ContinuityTellsWhichReadingIsWrong) {
  // From line 500 on, every 7th flash of mark2 reaches camera 1 as a reflection 40 pixels aside.
  std::vector<std::size_t> wrong;
  const std::string path = Edited("wrong.h5", [&](std::size_t line, const std::string& slot,
                                                  std::size_t c, std::span<std::uint16_t> active) {
    if (slot != "mark2" || c != 1 || line < 500 || line % 7 != 0) return;
    std::rotate(active.begin(), active.begin() + 40, active.end());
    wrong.push_back(line);
  });
  ASSERT_GT(wrong.size(), 10U);
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(data::TrialReader(path), Shared().rig, {}, &summary);
  std::remove(path.c_str());
  std::size_t rejected = 0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const std::size_t line = static_cast<std::size_t>(tracks.t[i] * 1000.0);
    const bool expected = std::find(wrong.begin(), wrong.end(), line) != wrong.end() &&
                          tracks.marks[static_cast<std::size_t>(tracks.mark[i])] == "mark2";
    EXPECT_EQ(tracks.status[i],
              expected ? data::SampleStatus::kRejectedReading : data::SampleStatus::kGood);
    rejected += tracks.status[i] == data::SampleStatus::kRejectedReading;
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_LT((tracks.p.col(col) - Shared().truth.p.col(col)).norm(), 500e-6);
  }
  EXPECT_EQ(rejected, wrong.size());
}

TEST(Reconstruct, WithoutAPastNothingTellsWhichSoItIsUnsolvable) {
  // Wrong from the first line on: never a good sample to continue from, never a wild point.
  const std::string path = Edited("always.h5", [](std::size_t, const std::string& slot,
                                                  std::size_t c, std::span<std::uint16_t> active) {
    if (slot == "mark2" && c == 1) std::rotate(active.begin(), active.begin() + 40, active.end());
  });
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(data::TrialReader(path), Shared().rig, {}, &summary);
  std::remove(path.c_str());
  const int mark2 = tracks.FindMark("mark2");
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    EXPECT_EQ(tracks.status[i], tracks.mark[i] == mark2 ? data::SampleStatus::kUnsolvable
                                                        : data::SampleStatus::kGood);
  }
  EXPECT_GT(summary.Unsolved().at("readings disagree"), 200U);
}

TEST(Reconstruct, RefusesARigOfOtherCameras) {
  const data::TrialReader trial(Shared().path);
  data::Rig other = Shared().rig;
  std::swap(other.cameras[0], other.cameras[1]);
  try {
    Reconstructor(trial, other, "other.h5");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::strstr(error.what(), "other.h5"), nullptr);
    EXPECT_NE(std::strstr(error.what(), trial.path().c_str()), nullptr);
    EXPECT_NE(std::strstr(error.what(), "north_west"), nullptr);
  }
  other.cameras.pop_back();
  EXPECT_THROW(Reconstructor(trial, other, "other.h5"), Error);
}

TEST(Reconstruct, RefusesATrialWithoutDarkLines) {
  const data::TrialReader whole(Shared().path);
  data::TrialHeader header = whole.header();
  for (std::string& slot : header.slots) {
    if (slot == data::kDarkSlot) slot = "mark9";
  }
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "undark.h5";
  data::TrialBlock block;
  whole.Read(0, 200, &block);
  data::TrialWriter writer(path, header, {});
  writer.Append(block);
  writer.Commit();
  EXPECT_THROW(Reconstructor(data::TrialReader(path), Shared().rig, "rig.h5"), Error);
  std::remove(path.c_str());
}

TEST(SurveyReadings, LinesBecomeReadingsWithHonestSigmas) {
  const data::Lab lab = ShippedLab();
  const VirtualRig rig = MakeVirtualRig(lab);
  constexpr int kPoints = 200;
  data::Survey points;
  points.p = RandomPoints(lab.volume_low, lab.volume_high, kPoints, 2);
  points.cov.setZero(6, kPoints);
  for (int i = 0; i < kPoints; ++i) points.id.push_back(std::to_string(i));
  data::Survey survey = ExposeSurvey(lab, points, {});
  FindSurveyReadings(&survey);
  int seen = 0;
  std::vector<double> error, whitened;
  for (Eigen::Index i = 0; i < kPoints; ++i) {
    for (Eigen::Index c = 0; c < 4; ++c) {
      SpotLight spot;
      const bool arrives =
          TraceSpot(rig.cameras[static_cast<std::size_t>(c)], points.p.col(i), &spot) &&
          spot.centre_px > 30.0 && spot.centre_px < 2129.0;
      EXPECT_FALSE(arrives && std::isnan(survey.u_px(i, c))) << i << " " << c;
      if (std::isnan(survey.u_px(i, c))) continue;
      ++seen;
      error.push_back(survey.u_px(i, c) - spot.centre_px);
      whitened.push_back(error.back() / survey.s_px(i, c));
    }
  }
  EXPECT_GT(seen, 780);
  EXPECT_LT(Rms(error), 0.03);
  // Spots through glass are not Gaussian; misfits raise their sigma, so it may err on the safe
  // side.
  EXPECT_GT(Rms(whitened), 0.5);
  EXPECT_LT(Rms(whitened), 1.2);
}

}  // namespace
}  // namespace unfurl::measure::reconstruct_test
