// Marks that flash one after another, through glass.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>

#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::strobe_test {
namespace {

TEST(Strobe, SkewAtTwoMetresPerSecond) {
  // Four marks on one body that goes straight on at 2 m/s: x = 2 t + d_k along M's x axis. Slots
  // are 1 ms apart, in which the body moves 2 mm; laid back by their own stamps, all marks must
  // show the same body: where it was at the recorder's time 0, and how far apart they are.
  constexpr double kSpeed = 2.0, kMost = 0.1e-3;  // [m/s], [m]
  constexpr double kDuration = 0.35;              // [s]
  const double away[] = {0.0, 0.15, 0.3, 0.45};   // d_k [m]
  const data::Lab lab = ShippedLab({"strobe.lead=[0.01, 0.02]"});
  const VirtualRig truth = MakeVirtualRig(lab);
  data::Rig rig = FitRig(truth, lab.volume_low, lab.volume_high);
  rig.model_floor_px = 0.008;

  data::Run run = FourMarks();
  // Before release a run's marks stand still; that part is not looked at.
  for (int i = 0; i <= 350; ++i) {
    const double t = 1e-3 * i;
    run.t.push_back(t);
    for (std::size_t m = 0; m < 4; ++m) {
      const double values[] = {0.4 + kSpeed * t + away[m], 0.3, kSpeed, 0.0};
      for (std::size_t k = 0; k < 4; ++k) run.columns[4 * m + k].push_back(values[k]);
    }
  }
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "strobe.h5";
  {
    data::TrialWriter writer(path, HeaderOf(lab), {});
    ExposeTrial(lab, run, writer, {}, nullptr);
    writer.Commit();
  }
  const data::Tracks tracks = Reconstruct(data::TrialReader(path), rig);
  std::remove(path.c_str());

  const Eigen::Vector3d along = truth.X_WM.linear().col(0);
  double mean[4] = {}, worst = 0.0;
  for (std::int32_t m = 0; m < 4; ++m) {
    const auto column =
        static_cast<std::size_t>(tracks.FindMark(run.marks[static_cast<std::size_t>(m)]));
    std::size_t used = 0;
    for (std::size_t i : tracks.SamplesOf(static_cast<std::int32_t>(column))) {
      const double t = tracks.t[i] - truth.lead;
      if (t < 1e-3 || t > kDuration - 1e-3) continue;
      const Eigen::Vector3d start =
          truth.X_WM * Eigen::Vector3d(0.4 + away[m] + kSpeed * t, 0.3, 0.0);
      const double ahead = along.dot(tracks.p.col(static_cast<Eigen::Index>(i)) - start);
      mean[m] += ahead;
      worst = std::max(worst, std::abs(ahead));
      ++used;
    }
    ASSERT_GT(used, 50U);
    mean[m] /= static_cast<double>(used);
    EXPECT_LT(std::abs(mean[m]), kMost) << run.marks[static_cast<std::size_t>(m)];
  }
  for (int m = 1; m < 4; ++m) EXPECT_LT(std::abs(mean[m] - mean[0]), kMost);
  std::printf("at 2 m/s: %.4f %.4f %.4f %.4f mm ahead of where they were, single samples %.3f mm\n",
              1e3 * mean[0], 1e3 * mean[1], 1e3 * mean[2], 1e3 * mean[3], 1e3 * worst);
}

}  // namespace
}  // namespace unfurl::measure::strobe_test
