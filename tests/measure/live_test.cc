// A reconstruction that follows its record: the bits of the whole, and what an operator is told.
#include "measure/live.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "data/lab.h"
#include "measure/expose.h"
#include "measure/trial_record.h"
#include "tests/measure/fixtures.h"
#include "tests/measure/health_trial.h"
#include "tests/own_folder.h"

namespace unfurl::measure::live_test {
namespace {

using ::testing::HasSubstr;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kSigma = 0.02;  // of readings [px]

// All that was told.
struct Told : LiveListener {
  explicit Told(data::Tracks* kept = nullptr) : all(kept) {}
  void Begun(const Reconstructor& pass) override { layout = pass.layout(); }
  void Samples(const data::Tracks& tracks) override {
    samples += tracks.size();
    if (all == nullptr) return;
    if (all->size() == 0) *all = layout;
    AppendTracks(tracks, all);
  }
  void Notice(const LiveNotice& notice) override { notices.push_back(notice); }
  void Views(double, std::span<const LiveView> views) override {
    ++reports;
    last_views.assign(views.begin(), views.end());
  }
  std::vector<LiveNotice> Of(NoticeKind kind) const {
    std::vector<LiveNotice> out;
    for (const LiveNotice& notice : notices) {
      if (notice.kind == kind) out.push_back(notice);
    }
    return out;
  }
  data::Tracks* all;
  data::Tracks layout;
  std::vector<LiveNotice> notices;
  std::vector<LiveView> last_views;
  std::size_t samples = 0, reports = 0;
};

void ExpectSame(data::Tracks live, const data::Tracks& whole) {
  TrimTracks(&live);
  ASSERT_EQ(live.size(), whole.size());
  EXPECT_EQ(live.t, whole.t);
  EXPECT_EQ(live.mark, whole.mark);
  EXPECT_EQ(live.status, whole.status);
  EXPECT_EQ(live.used, whole.used);
  EXPECT_EQ(live.left_out, whole.left_out);
  EXPECT_EQ(live.shared_rank, whole.shared_rank);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    if (!data::Usable(whole.status[i])) continue;
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_EQ((live.p.col(col) - whole.p.col(col)).norm(), 0.0);
    EXPECT_EQ((live.cov.col(col) - whole.cov.col(col)).norm(), 0.0);
    const auto rank = static_cast<Eigen::Index>(whole.shared_rank);
    EXPECT_EQ((live.shared.middleCols(col * rank, rank) - whole.shared.middleCols(col * rank, rank))
                  .norm(),
              0.0);
  }
}

TEST(Live, LinesGiveTheBitsOfTheWholeRecord) {
  const OwnFolder folder;
  const std::string path = folder.File("trial.h5");
  const data::Lab lab = ShippedLab();
  {
    data::TrialWriter writer(path, HeaderOf(lab), {});
    ExposeTrial(lab, SwingingRun(0.6), writer, {}, nullptr);
    writer.Commit();
  }
  const TrialRecord record(path);
  const data::Tracks whole = Reconstruct(*record.lines(), ShippedRig());
  for (const std::size_t piece : {1U, 7U, 1000U}) {
    data::Tracks all;
    Told told(&all);
    Live live(record.Header(), "stream", ShippedRig(), "rig", {}, &record, &told);
    data::TrialBlock block;
    for (std::size_t i = 0; i < record.size(); i += piece) {
      record.lines()->Read(i, std::min<std::size_t>(piece, record.size() - i), &block);
      live.Add(block);
    }
    live.Finish();
    EXPECT_EQ(live.lines(), record.size());
    ExpectSame(all, whole);
    EXPECT_TRUE(told.notices.empty());
  }
  // Without another record the beginning has to do: the same points, if not the same split of their
  // covariance.
  data::Tracks all;
  Told told(&all);
  Live live(record.Header(), "stream", ShippedRig(), "rig", {}, nullptr, &told);
  data::TrialBlock block;
  record.lines()->Read(0, record.size(), &block);
  live.Add(block);
  live.Finish();
  ASSERT_EQ(all.size(), whole.size());
  EXPECT_EQ(all.status, whole.status);
  const auto n = static_cast<Eigen::Index>(whole.size());
  EXPECT_EQ((all.p.leftCols(n) - whole.p).norm(), 0.0);
}

const HealthTrial& Four() {
  static const HealthTrial trial(4, 6000);
  return trial;
}

// Readings of four sound cameras, six seconds of four marks.
class LiveReadings : public ::testing::Test {
 protected:
  LiveReadings() : rig_(Four().DrawRig(&rng_)) {}

  data::TrialReadings Clean() { return Four().Draw({}, kSigma, &rng_); }
  static data::LiveHeader HeaderOf(const data::TrialReadings& readings) {
    data::LiveHeader header;
    header.readings = true;
    header.trial.cameras = readings.cameras;
    header.trial.slots = readings.slots;
    return header;
  }
  // Takes readings of camera (all: -1) and mark (all: empty) away within a time.
  static void Hide(int camera, const std::string& mark, double from, double to,
                   data::TrialReadings* readings) {
    for (std::size_t i = 0; i < readings->size(); ++i) {
      const std::string& lit = readings->slots[static_cast<std::size_t>(readings->slot[i])];
      if (readings->t[i] < from || readings->t[i] >= to || (!mark.empty() && lit != mark)) continue;
      for (std::size_t c = 0; c < readings->cameras.size(); ++c) {
        if (camera >= 0 && c != static_cast<std::size_t>(camera)) continue;
        for (std::size_t k = 0; k < readings->most; ++k) {
          readings->u_px[(i * readings->cameras.size() + c) * readings->most + k] = kNone;
        }
      }
    }
  }
  static std::size_t LitOf(const data::TrialReadings& readings) {
    return static_cast<std::size_t>(
        std::count_if(readings.slot.begin(), readings.slot.end(), [&](std::int32_t slot) {
          return readings.slots[static_cast<std::size_t>(slot)] != data::kDarkSlot;
        }));
  }
  // Of views: what is told of positions and of the cameras' health follows from these.
  static std::vector<LiveNotice> Views(const Told& told) {
    std::vector<LiveNotice> out;
    for (const LiveNotice& notice : told.notices) {
      const bool view = notice.kind != NoticeKind::kNoPosition &&
                        notice.kind != NoticeKind::kMoved && notice.kind != NoticeKind::kLeftOut;
      if (view) out.push_back(notice);
    }
    return out;
  }
  static std::string Words(const std::vector<LiveNotice>& notices) {
    std::string all;
    for (const LiveNotice& notice : notices) {
      all += std::to_string(notice.t) + (notice.begins ? " begins: " : " ends: ") + notice.words +
             " since " + std::to_string(notice.since) + "\n";
    }
    return all;
  }
  Told Follow(const data::TrialReadings& readings, const LiveOptions& options = {},
              data::Tracks* all = nullptr) {
    Told told(all);
    Live live(HeaderOf(readings), "stream", rig_, "rig", options, nullptr, &told);
    live.Add(readings);
    live.Finish();
    EXPECT_EQ(live.lines(), readings.size());
    return told;
  }

  Rng rng_{77};
  data::Rig rig_;
};

// The marks' flashes come every 5 ms; a notice waits for patience and a round.
constexpr double kPatience = 0.5, kRound = 0.006;

TEST_F(LiveReadings, OfSoundCamerasTellNothingAndLoseNothing) {
  // Each camera misses flashes by itself, as often as the options say.
  data::TrialReadings readings = Clean();
  for (double& u : readings.u_px) {
    if (rng_.Uniform(0.0, 1.0) < WatchOptions{}.miss) u = kNone;
  }
  const Told told = Follow(readings);
  EXPECT_EQ(told.samples, LitOf(readings));
  EXPECT_TRUE(told.notices.empty());
  EXPECT_GE(told.reports, 5U);
}

TEST_F(LiveReadings, TellOfADeadLedAndOfItsMending) {
  data::TrialReadings readings = Clean();
  const std::string mark = readings.slots[1];
  Hide(-1, mark, 2.0, 4.0, &readings);
  const Told told = Follow(readings);
  const std::vector<LiveNotice> led = told.Of(NoticeKind::kLed);
  ASSERT_EQ(told.notices.size(), 2U);
  ASSERT_EQ(led.size(), 2U);
  EXPECT_TRUE(led[0].begins);
  EXPECT_EQ(told.layout.marks[static_cast<std::size_t>(led[0].mark)], mark);
  EXPECT_NEAR(led[0].since, 2.0, kRound);
  EXPECT_NEAR(led[0].t, 2.0 + kPatience, 4.0 * kRound);
  EXPECT_FALSE(led[1].begins);
  EXPECT_NEAR(led[1].t, 4.0, 0.1);
}

TEST_F(LiveReadings, TellACoveredCameraFromABlockedViewAndFromNoLight) {
  data::TrialReadings covered = Clean(), blocked = Clean(), dark = Clean();
  Hide(2, "", 1.5, 99.0, &covered);
  Hide(1, blocked.slots[0], 1.5, 99.0, &blocked);
  Hide(-1, "", 1.5, 99.0, &dark);
  const Told camera = Follow(covered), view = Follow(blocked), light = Follow(dark);
  const std::vector<LiveNotice> of_camera = Views(camera), of_view = Views(view),
                                of_light = Views(light);
  ASSERT_EQ(of_camera.size(), 1U) << Words(of_camera);
  EXPECT_EQ(of_camera[0].kind, NoticeKind::kCamera);
  EXPECT_EQ(of_camera[0].camera, 2);
  EXPECT_NEAR(of_camera[0].since, 1.5, kRound);
  ASSERT_EQ(of_view.size(), 1U) << Words(of_view);
  EXPECT_EQ(of_view[0].kind, NoticeKind::kBlocked);
  EXPECT_EQ(of_view[0].camera, 1);
  EXPECT_THAT(of_view[0].words, HasSubstr("it would read"));
  EXPECT_NEAR(of_view[0].t, 1.5 + kPatience, 4.0 * kRound);
  ASSERT_EQ(of_light.size(), 1U);
  EXPECT_EQ(of_light[0].kind, NoticeKind::kNoLight);
}

TEST_F(LiveReadings, WhatPassesByIsNoFault) {
  data::TrialReadings readings = Clean();
  Hide(0, "", 2.0, 2.4, &readings);
  EXPECT_TRUE(Follow(readings).notices.empty());
}

TEST_F(LiveReadings, ACameraAimedAwayIsToldByWhereTheMarkWouldBe) {
  // A row of which one camera's end was cut off: what lay there is seen no more.
  data::TrialReadings readings = Clean();
  constexpr int kCamera = 3;
  double highest = 0.0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    highest = std::max(highest, readings.Readings(i, kCamera)[0]);
  }
  const int pixels = static_cast<int>(highest) - 200;
  rig_.cameras[kCamera].pixels = pixels;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    double& u = readings.u_px[(i * 4 + kCamera) * readings.most];
    if (u > pixels - 0.5) u = kNone;
  }
  if (!readings.pixels.empty()) readings.pixels[kCamera] = pixels;
  const Told told = Follow(readings, {.watch = {.patience = 0.05}});
  const std::vector<LiveNotice> aim = told.Of(NoticeKind::kAim);
  ASSERT_FALSE(aim.empty());
  EXPECT_EQ(aim[0].camera, kCamera);
  EXPECT_THAT(aim[0].words, HasSubstr("beyond its row"));
}

TEST_F(LiveReadings, ABumpedCameraIsNamedAndLeftOutFromThenOn) {
  const Harm harm{.camera = 1, .px = 5.0, .from = 2.0};
  const data::TrialReadings readings = Four().Draw(harm, kSigma, &rng_);
  data::Tracks all;
  const Told told = Follow(readings, {}, &all);
  const std::vector<LiveNotice> moved = told.Of(NoticeKind::kMoved);
  ASSERT_FALSE(moved.empty());
  EXPECT_EQ(moved[0].camera, harm.camera);
  EXPECT_TRUE(moved[0].begins);
  EXPECT_THAT(moved[0].words, HasSubstr("moved by"));
  // One look to see it, one until the answer.
  EXPECT_LE(moved[0].t, harm.from + 2.0 * LiveOptions{}.look_every + 0.1);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool used = (all.used[i] >> harm.camera & 1U) != 0;
    EXPECT_FALSE(used && all.t[i] > moved[0].t) << all.t[i];
  }
}

// A camera that takes a lamp for the marks, from two seconds on, and for a second and a half. No
// move and no lag explains it; it is told before anybody looks at the cameras' health, and no other
// is blamed.
TEST_F(LiveReadings, ACameraThatSeesSomethingElseIsToldInTime) {
  data::TrialReadings readings = Clean();
  constexpr int kCamera = 2;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    double& u = readings.u_px[(i * 4 + kCamera) * readings.most];
    if (!std::isnan(u) && readings.t[i] >= 2.0 && readings.t[i] < 3.5) u = 700.25;
  }
  const Told told = Follow(readings);
  EXPECT_TRUE(told.Of(NoticeKind::kMoved).empty()) << Words(told.notices);
  const std::vector<LiveNotice> out = told.Of(NoticeKind::kLeftOut);
  ASSERT_EQ(out.size(), 2U) << Words(told.notices);
  EXPECT_EQ(out[0].camera, kCamera);
  EXPECT_EQ(out[0].mark, -1);
  EXPECT_NEAR(out[0].since, 2.0, 0.1);  // a mark that passes by the lamp fits it
  EXPECT_LT(out[0].t, 2.0 + 2.0 * kPatience);
  EXPECT_FALSE(out[1].begins);
  EXPECT_NEAR(out[1].t, 3.5, 0.2);
}

TEST_F(LiveReadings, TheSameHoweverTheyCome) {
  const Harm harm{.camera = 1, .px = 5.0, .from = 2.0};
  data::TrialReadings readings = Four().Draw(harm, kSigma, &rng_);
  Hide(2, "", 3.0, 4.5, &readings);
  data::Tracks one, other;
  const Told whole = Follow(readings, {}, &one);
  Told told(&other);
  Live live(HeaderOf(readings), "stream", rig_, "rig", {}, nullptr, &told);
  data::TrialReadings piece = readings;
  const std::size_t width = readings.cameras.size() * readings.most;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    piece.t = {readings.t[i]};
    piece.slot = {readings.slot[i]};
    const auto from = readings.u_px.begin() + static_cast<std::ptrdiff_t>(i * width);
    const auto sigma = readings.s_px.begin() + static_cast<std::ptrdiff_t>(i * width);
    piece.u_px.assign(from, from + static_cast<std::ptrdiff_t>(width));
    piece.s_px.assign(sigma, sigma + static_cast<std::ptrdiff_t>(width));
    live.Add(piece);
  }
  live.Finish();
  TrimTracks(&one);
  ExpectSame(other, one);
  ASSERT_EQ(told.notices.size(), whole.notices.size());
  for (std::size_t k = 0; k < told.notices.size(); ++k) {
    EXPECT_EQ(told.notices[k].words, whole.notices[k].words);
    EXPECT_EQ(told.notices[k].t, whole.notices[k].t);
  }
}

TEST_F(LiveReadings, WhatCannotBeReadIsRefused) {
  data::TrialReadings readings = Clean();
  readings.u_px[5000] = 1e7;
  EXPECT_THROW(Follow(readings), Error);
  data::LiveHeader dark;
  dark.trial.cameras = {"a"};
  dark.trial.slots = {"tip"};
  EXPECT_THROW(Live(dark, "stream", rig_, "rig", {}, nullptr, nullptr), Error);
}

// Before a line of the stream has come.
TEST_F(LiveReadings, AHeaderOfOtherCamerasIsRefused) {
  const auto refusal = [&](const data::LiveHeader& header) -> std::string {
    try {
      Live(header, "stream", rig_, "rig.h5", {}, nullptr, nullptr);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  data::LiveHeader readings = HeaderOf(Clean());
  EXPECT_EQ(refusal(readings), "");
  readings.pixels = {2160, 2160, 2161, 2160};
  EXPECT_THAT(refusal(readings), HasSubstr("has 2161 pixels, but 2160 in the rig rig.h5"));
  readings.pixels[2] = 0;  // not stated
  EXPECT_EQ(refusal(readings), "");
  readings.trial.slots[1] = "m1+ m1";
  EXPECT_THAT(refusal(readings), HasSubstr("names a mark twice"));
  readings.trial.cameras[1] = "another";
  EXPECT_THAT(refusal(readings), HasSubstr("camera 'another'"));
  data::LiveHeader lines;
  lines.trial.cameras = Clean().cameras;
  lines.trial.slots = {"tip", data::kDarkSlot};
  lines.trial.format.active = 2160;
  EXPECT_EQ(refusal(lines), "");
  lines.trial.format.active = 4000;
  EXPECT_THAT(refusal(lines), HasSubstr("4000 active pixels, but 2160"));
  std::swap(lines.trial.cameras[0], lines.trial.cameras[1]);
  EXPECT_THAT(refusal(lines), HasSubstr("in this order"));
}

TEST(HealthEvidence, OfARecordWithoutEndKeepsTheLastLines) {
  HealthEvidence evidence = HealthEvidence::OfLast(1, 100);
  for (int i = 0; i < 1234; ++i) {
    const HealthEvidence::Reading reading{.u_px = static_cast<double>(i)};
    evidence.Add(i, 0, {&reading, 1});
    EXPECT_LE(evidence.size(), 200U);
    EXPECT_EQ(evidence.At(evidence.size() - 1, 0).u_px, i);
  }
  EXPECT_GE(evidence.size(), 100U);
  for (std::size_t i = 1; i < evidence.size(); ++i) {
    EXPECT_EQ(evidence.t(i), evidence.t(i - 1) + 1.0);
    EXPECT_EQ(evidence.After(i - 1, 1), static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace
}  // namespace unfurl::measure::live_test
