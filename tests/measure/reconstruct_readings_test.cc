// Readings in place of lines: the same points, statuses and error bars.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/error.h"
#include "base/random.h"
#include "measure/camera_model.h"
#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::reconstruct_readings_test {
namespace {

using ::testing::HasSubstr;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// What a recorder with our own spot finder would have written of these lines: backgrounds from the
// dark lines of the first 160, as a reconstruction begins, and then of each as it comes.
data::TrialReadings ReadingsOf(const data::TrialReader& trial) {
  const data::TrialHeader& header = trial.header();
  data::TrialReadings out;
  out.path = "readings of " + trial.path();
  out.cameras = header.cameras;
  out.slots = header.slots;
  out.most = data::kMostReadings;
  data::TrialBlock block;
  trial.Read(0, trial.size(), &block);
  const auto dark = [&](std::size_t i) {
    return header.slots[static_cast<std::size_t>(block.slot[i])] == data::kDarkSlot;
  };
  const std::size_t cameras = header.cameras.size();
  out.u_px.assign(block.size() * cameras * out.most, kNone);
  out.s_px = out.u_px;
  out.t = block.t;
  out.slot = block.slot;
  constexpr std::size_t kPrimed = 160;
  for (std::size_t c = 0; c < cameras; ++c) {
    Background background(header.format.Of(c));
    SpotFinder finder(header.format.Of(c));
    for (std::size_t i = 0; i < kPrimed; ++i) {
      if (dark(i)) background.Add(block.Line(header, i, c));
    }
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (dark(i)) {
        if (i >= kPrimed) background.Add(block.Line(header, i, c));
        continue;
      }
      std::array<Spot, data::kMostReadings> spots;
      const std::size_t count = finder.FindAll(block.Line(header, i, c), background, spots);
      std::size_t k = (i * cameras + c) * out.most;
      for (std::size_t j = 0; j < count; ++j) {
        if (!Resolved(spots[j])) continue;
        out.u_px[k] = spots[j].u_px;
        out.s_px[k++] = spots[j].s_px;
      }
    }
  }
  return out;
}

TEST(ReconstructReadings, GiveWhatTheirLinesGive) {
  const data::Lab lab = ShippedLab();
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "lines.h5";
  {
    data::TrialWriter writer(path, HeaderOf(lab), {});
    ExposeTrial(lab, SwingingRun(0.6), writer, {}, nullptr);
    writer.Commit();
  }
  const data::TrialReader trial(path);
  const data::Tracks lines = Reconstruct(trial, ShippedRig());
  ReconstructSummary summary;
  const data::Tracks readings = Reconstruct(ReadingsOf(trial), ShippedRig(), {}, &summary);
  std::remove(path.c_str());
  ASSERT_GT(lines.size(), 400U);
  ASSERT_EQ(readings.size(), lines.size());
  EXPECT_EQ(summary.usable(), lines.size());
  EXPECT_EQ(readings.t, lines.t);
  EXPECT_EQ(readings.mark, lines.mark);
  EXPECT_EQ(readings.status, lines.status);
  EXPECT_EQ(readings.used, lines.used);
  EXPECT_EQ((readings.p - lines.p).norm(), 0.0);
  EXPECT_EQ((readings.cov - lines.cov).norm(), 0.0);
}

// Marks on circles through a rig of `cameras` of the shipped ones, whose rows are unlike: readings
// by the camera model with noise of sigmas that differ from reading to reading.
struct Made {
  data::Rig rig;
  data::TrialReadings readings;
  std::vector<Eigen::Vector3d> truth;  // by flash; of several marks the first's
};

Made Make(std::size_t cameras, int flashes, std::uint64_t seed, bool together = false) {
  Made out;
  out.rig = ShippedRig();
  out.rig.cameras.resize(cameras);
  const auto size = static_cast<Eigen::Index>(cameras) * data::kCameraParameters;
  out.rig.covariance = Eigen::MatrixXd::Zero(size, size);
  Rng rng(seed);
  for (std::size_t c = 0; c < cameras; ++c) {
    data::RigCamera& camera = out.rig.cameras[c];
    const double scale = 1.0 + 0.4 * static_cast<double>(c);  // finer pixels on the same sensor
    camera.pixels = static_cast<int>(scale * camera.pixels);
    camera.f_px *= scale;
    camera.u0_px *= scale;
    for (double& term : camera.terms_px) term *= scale;
    out.readings.cameras.push_back(camera.name);
    out.readings.pixels.push_back(camera.pixels);
  }
  out.readings.path = "made";
  if (together) {
    out.readings.slots = {"a+b"};
  } else {
    out.readings.slots = {"a", "b"};
  }
  out.readings.most = together ? 2 : 1;
  for (int i = 0; i < flashes; ++i) {
    const double t = 0.002 * i;
    out.readings.t.push_back(t);
    out.readings.slot.push_back(together ? 0 : i % 2);
    const auto place = [&](double sign) {
      return Eigen::Vector3d(0.5 * std::cos(2.0 * t), sign * 0.4, 0.3 * std::sin(3.0 * t));
    };
    std::vector<Eigen::Vector3d> at;
    if (together || i % 2 == 0) at.push_back(place(1.0));
    if (together || i % 2 == 1) at.push_back(place(-1.0));
    out.truth.push_back(at[0]);
    for (std::size_t c = 0; c < cameras; ++c) {
      const std::size_t first = rng.Integer(at.size());  // in no order
      for (std::size_t k = 0; k < at.size(); ++k) {
        double u = 0.0;
        EXPECT_TRUE(Project(out.rig.cameras[c], at[(first + k) % at.size()], &u));
        const double s = rng.Uniform(0.01, 0.08);
        out.readings.u_px.push_back(u + s * rng.Normal());
        out.readings.s_px.push_back(s);
      }
    }
  }
  return out;
}

TEST(ReconstructReadings, ErrorBarsAreTheScatterForAnyCameras) {
  for (const std::size_t cameras : {std::size_t{3}, std::size_t{4}}) {
    constexpr int kFlashes = 2000;
    const Made made = Make(cameras, kFlashes, 5 + cameras);
    ReconstructSummary summary;
    const data::Tracks tracks = Reconstruct(made.readings, made.rig, {}, &summary);
    ASSERT_EQ(tracks.size(), made.truth.size());
    // Four readings fail the residual test once in a thousand, and are then weighed by themselves.
    EXPECT_GE(summary.usable(), static_cast<std::size_t>(0.995 * kFlashes));
    double nees = 0.0;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (!data::Usable(tracks.status[i])) continue;
      const Eigen::Vector3d e = tracks.p.col(static_cast<Eigen::Index>(i)) - made.truth[i];
      nees += e.dot(tracks.Covariance(i).inverse() * e) / (3.0 * kFlashes);
    }
    // A chi-square of 3 n degrees over 3 n: five of its sigmas.
    EXPECT_NEAR(nees, 1.0, 5.0 * std::sqrt(2.0 / (3.0 * kFlashes))) << cameras;
  }
}

TEST(ReconstructReadings, MarksThatNobodyNamesAreFollowed) {
  const Made made = Make(4, 600, 3, true);
  ReconstructOptions options;
  options.start = {{"a", {0.5, 0.4, 0.0}}, {"b", {0.5, -0.4, 0.0}}};
  const data::Tracks tracks = Reconstruct(made.readings, made.rig, options);
  ASSERT_EQ(tracks.size(), 1200U);
  int usable = 0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    ++usable;
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_EQ(tracks.p(1, col) > 0.0,
              tracks.marks[static_cast<std::size_t>(tracks.mark[i])] == "a");
  }
  EXPECT_GE(usable, 1190);
}

TEST(ReconstructReadings, AWrongReadingIsRejectedAsFromLines) {
  Made made = Make(4, 1000, 9);
  for (std::size_t i = 500; i < 1000; i += 20) made.readings.u_px[4 * i + 2] += 30.0;
  const data::Tracks tracks = Reconstruct(made.readings, made.rig);
  for (std::size_t i = 500; i < 1000; i += 20) {
    EXPECT_EQ(tracks.status[i], data::SampleStatus::kRejectedReading) << i;
    EXPECT_EQ(tracks.left_out[i], 1U << 2);
    EXPECT_LT((tracks.p.col(static_cast<Eigen::Index>(i)) - made.truth[i]).norm(), 1e-3);
  }
}

TEST(ReconstructReadings, CamerasGoByNameAndMayBeAbsent) {
  const Made made = Make(4, 300, 4);
  data::TrialReadings other = made.readings;
  other.cameras = {made.readings.cameras[3], made.readings.cameras[0], made.readings.cameras[2]};
  other.pixels.clear();
  other.u_px.clear();
  other.s_px.clear();
  for (std::size_t i = 0; i < made.readings.size(); ++i) {
    for (const std::size_t c : {3U, 0U, 2U}) {
      other.u_px.push_back(made.readings.u_px[4 * i + c]);
      other.s_px.push_back(made.readings.s_px[4 * i + c]);
    }
  }
  ReconstructSummary summary;
  const data::Tracks tracks = Reconstruct(other, made.rig, {}, &summary);
  EXPECT_EQ(summary.readings[1], 0U);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    ASSERT_EQ(tracks.status[i], data::SampleStatus::kThreeCameras);
    EXPECT_LT((tracks.p.col(static_cast<Eigen::Index>(i)) - made.truth[i]).norm(), 1e-3);
  }
}

TEST(ReconstructReadings, WhatTheRigCannotHaveReadIsRefused) {
  const auto refusal = [](const Made& made) {
    try {
      Reconstruct(made.readings, made.rig);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  const Made good = Make(4, 20, 4);
  Made made = good;
  made.readings.cameras[1] = "attic";
  EXPECT_THAT(refusal(made), HasSubstr("made: has readings of a camera 'attic', but the rig"));
  made = good;
  made.readings.pixels[2] += 1;
  EXPECT_THAT(refusal(made), HasSubstr("pixels, but"));
  made = good;
  made.readings.u_px[5] = 40000.0;
  EXPECT_THAT(refusal(made), HasSubstr("reads 40000 px at 0.002 s, but its row has"));
}

}  // namespace
}  // namespace unfurl::measure::reconstruct_readings_test
