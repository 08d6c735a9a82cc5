// A comparison asks signals what they are of, never what they are called.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random_vector.h"
#include "correlate/compare/comparison.h"

namespace unfurl::correlate::signal_id_test {
namespace {

// Three marks, two of them on one body: a swing and vibrations, as tracks with noise or without.
data::Tracks Swing(const std::vector<std::string>& names, double sigma, std::uint64_t seed) {
  constexpr int kSamples = 600;
  constexpr double kStep = 0.005;
  data::Tracks tracks;
  tracks.frame = "rig";
  tracks.marks = names;
  tracks.p.resize(3, 3 * kSamples);
  tracks.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, 3 * kSamples);
  tracks.shared.resize(3, 0);
  Rng rng(seed);
  for (int i = 0; i < kSamples; ++i) {
    const double t = kStep * i;
    const double turn = 0.6 * std::exp(-0.5 * t) * std::cos(2.0 * std::numbers::pi * 1.7 * t);
    const double bend = 0.02 * std::exp(-0.3 * t) * std::cos(2.0 * std::numbers::pi * 9.0 * t);
    const Eigen::Vector3d along(std::cos(turn), std::sin(turn), 0.0);
    const Eigen::Vector3d across(-std::sin(turn), std::cos(turn), 0.0);
    const Eigen::Vector3d p[] = {0.4 * along, 0.9 * along, 1.5 * along + (0.3 * t + bend) * across};
    for (int m = 0; m < 3; ++m) {
      tracks.t.push_back(t);
      tracks.mark.push_back(m);
      tracks.status.push_back(data::SampleStatus::kGood);
      tracks.p.col(3 * i + m) = p[m] + sigma * NormalVector(&rng);
      for (int row : {0, 3, 5}) tracks.cov(row, 3 * i + m) = sigma * sigma;
    }
  }
  return tracks;
}

Comparison CompareNamed(const std::vector<std::string>& names) {
  constexpr double kSigma = 2e-4;  // [m]
  const data::Tracks measured = Swing(names, kSigma, 1), reference = Swing(names, kSigma, 2);
  return Compare(ComparedRecord(measured), ComparedRecord(reference));
}

TEST(SignalId, WhatSignalsAreOfDoesNotDependOnNames) {
  const Comparison plain = CompareNamed({"inner", "outer", "tip"});
  ASSERT_TRUE(plain.alignment.Usable()) << plain.alignment.message;
  ASSERT_EQ(plain.signals.size(), 10u);  // an angle, three coordinates of three marks
  ASSERT_EQ(plain.spectra.size(), 7u);   // those across the plane have none
  // Names that look like an angle, like a z coordinate, like the row of all marks.
  const std::vector<std::vector<std::string>> names = {
      {"angle_tip", "mark1z", "tip"}, {"angle", "z", "all"}, {"a x", "a", "a y"}};
  for (const auto& list : names) {
    const Comparison odd = CompareNamed(list);
    ASSERT_TRUE(odd.alignment.Usable());
    ASSERT_EQ(odd.signals.size(), plain.signals.size()) << list[0];
    for (std::size_t i = 0; i < odd.signals.size(); ++i) {
      EXPECT_EQ(odd.signals[i].id.kind, plain.signals[i].id.kind);
      EXPECT_EQ(odd.signals[i].id.axis, plain.signals[i].id.axis);
      EXPECT_EQ(odd.signals[i].measured, plain.signals[i].measured);
    }
    ASSERT_EQ(odd.spectra.size(), plain.spectra.size()) << list[0];
    for (std::size_t i = 0; i < odd.spectra.size(); ++i) {
      EXPECT_EQ(odd.spectra[i].measured.amplitude, plain.spectra[i].measured.amplitude);
      EXPECT_STREQ(odd.spectra[i].id.Unit(), plain.spectra[i].id.Unit());
    }
    ASSERT_EQ(odd.scores.size(), plain.scores.size());
    for (std::size_t i = 0; i < odd.scores.size(); ++i) {
      EXPECT_STREQ(odd.scores[i].Unit(), plain.scores[i].Unit());
      EXPECT_EQ(odd.scores[i].score.rmse, plain.scores[i].score.rmse);
      EXPECT_EQ(odd.scores[i].sigmas, plain.scores[i].sigmas);
      EXPECT_EQ(odd.scores[i].rating.overall, plain.scores[i].rating.overall);
    }
    EXPECT_EQ(odd.operating_shapes.size(), plain.operating_shapes.size());
    EXPECT_EQ(odd.mode_signals.size(), plain.mode_signals.size());
  }
}

TEST(SignalId, TheAngleIsOfTheTwoMarksOnOneBody) {
  const Comparison c = CompareNamed({"inner", "outer", "tip"});
  const SignalId& id = c.signals.front().id;
  ASSERT_TRUE(id.IsAngle());
  EXPECT_EQ(c.marks[id.mark], "inner");
  EXPECT_EQ(c.marks[id.second], "outer");
  EXPECT_STREQ(id.Unit(), "rad");
  EXPECT_EQ(c.scores.front().of, ComparedScore::Of::kAngle);
  EXPECT_EQ(c.scores.back().of, ComparedScore::Of::kAll);
  // Its range is that of the swing, in radians.
  EXPECT_NEAR(c.signals.front().reference.front(), 0.6, 0.01);
}

}  // namespace
}  // namespace unfurl::correlate::signal_id_test
