#include "measure/expose.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "base/statistics.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::expose_test {
namespace {

class TemporaryTrial {
 public:
  explicit TemporaryTrial(const std::string& name)
      : path_(testing::TempDir() + std::to_string(getpid()) + name) {}
  ~TemporaryTrial() { std::remove(path_.c_str()); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

TEST(MarkPath, IsExactForCubicsAndRestsBeforeTheRun) {
  data::Run run;
  for (const char* name : {"m.x", "m.y", "m.vx", "m.vy"}) {
    run.quantities.push_back({name, "", ""});
    run.columns.emplace_back();
  }
  const auto x = [](double t) { return 1.0 + t * (0.5 + t * (-2.0 + 3.0 * t)); };
  const auto vx = [](double t) { return 0.5 + t * (-4.0 + 9.0 * t); };
  for (double t : {0.0, 0.1, 0.25, 0.3}) {
    run.t.push_back(t);
    run.columns[0].push_back(x(t));
    run.columns[1].push_back(-x(t));
    run.columns[2].push_back(vx(t));
    run.columns[3].push_back(-vx(t));
  }
  const MarkPath path(run, "m");
  for (double t = 0.0; t <= 0.3; t += 0.013) {
    EXPECT_NEAR(path.At(t).x(), x(t), 1e-15);
    EXPECT_NEAR(path.At(t).y(), -x(t), 1e-15);
  }
  EXPECT_EQ(path.At(-1.0).x(), x(0.0));
  EXPECT_THROW(MarkPath(run, "other"), Error);
}

TEST(ExposeTrial, StampsSlotsAndTruth) {
  const data::Lab lab = ShippedLab();
  const data::Run run = SwingingRun(0.3);
  const TemporaryTrial file("stamps.h5");
  data::Tracks truth;
  data::TrialWriter writer(file.path(), HeaderOf(lab), {});
  ExposeTrial(lab, run, writer, {}, &truth);
  writer.Commit();
  const data::TrialReader trial(file.path());
  const VirtualRig rig = MakeVirtualRig(lab);
  EXPECT_GE(rig.lead, lab.strobe.lead[0]);
  EXPECT_LE(rig.lead, lab.strobe.lead[1]);
  EXPECT_NEAR(static_cast<double>(trial.size()) / 1000.0, 0.3 + rig.lead, 1.5e-3);
  data::TrialBlock block;
  trial.Read(0, trial.size(), &block);
  std::size_t sample = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    EXPECT_NEAR(block.t[i], (static_cast<double>(i) + 0.5) * 1e-3, 1e-12);
    const std::string& slot = trial.header().slots[static_cast<std::size_t>(block.slot[i])];
    EXPECT_EQ(slot, lab.strobe.slots[i % 5]);
    if (slot == data::kDarkSlot) continue;
    EXPECT_EQ(truth.t[sample], block.t[i]);
    EXPECT_EQ(truth.marks[static_cast<std::size_t>(truth.mark[sample])], slot);
    const Eigen::Vector3d p = rig.X_WM * MarkPath(run, slot).At(block.t[i] - rig.lead);
    EXPECT_LT((truth.p.col(static_cast<Eigen::Index>(sample)) - p).norm(), 1e-12);
    ++sample;
  }
  EXPECT_EQ(sample, truth.size());
}

TEST(ExposeTrial, TheNumberOfWorkersChangesNothing) {
  const data::Lab lab = ShippedLab();
  const data::Run run = SwingingRun(0.1);
  std::vector<std::uint16_t> first;
  for (const std::size_t workers : {1U, 3U}) {
    const TemporaryTrial file("workers.h5");
    data::TrialWriter writer(file.path(), HeaderOf(lab), {});
    ExposeTrial(lab, run, writer, {.workers = workers, .progress = {}}, nullptr);
    writer.Commit();
    const data::TrialReader trial(file.path());
    data::TrialBlock block;
    trial.Read(0, trial.size(), &block);
    if (first.empty()) {
      first = block.counts;
    } else {
      EXPECT_EQ(first, block.counts);
    }
  }
}

TEST(ExposeTrial, PeaksAreAsBrightAsTheLabAsksFor) {
  const data::Lab lab = ShippedLab({"mounting.rotation=0.0", "mounting.position=0.0"});
  const VirtualRig rig = MakeVirtualRig(lab);
  data::Survey points;
  points.id = {"middle"};
  points.p = Eigen::Vector3d::Zero();
  points.cov.setZero(6, 1);
  data::Lab bright = lab;
  bright.led.survey_flash = lab.led.flash;
  const data::Survey survey = ExposeSurvey(bright, points, {});
  const double full = survey.format.full_scale();
  for (std::size_t c = 0; c < 4; ++c) {
    const auto* line = &survey.lit[c * survey.format.elements()];
    const double peak = *std::max_element(line, line + survey.format.elements());
    // Where the spot falls between two pixels, or the lens is a bit off, the peak is lower.
    EXPECT_GT(peak / full, 0.7 * lab.led.peak);
    EXPECT_LT(peak / full, 1.4 * lab.led.peak);
  }
}

TEST(ExposeSurvey, StationNoiseIsWhatItStates) {
  const data::Lab lab = ShippedLab({"survey.sigma=0.0003"});
  data::Survey points;
  constexpr int kPoints = 400;
  points.p = RandomPoints(lab.volume_low, lab.volume_high, kPoints, 1);
  points.cov.setZero(6, kPoints);
  for (int i = 0; i < kPoints; ++i) points.id.push_back("p" + std::to_string(i));
  const data::Survey survey = ExposeSurvey(lab, points, {});
  std::vector<double> error;
  for (Eigen::Index i = 0; i < kPoints; ++i) {
    EXPECT_DOUBLE_EQ(survey.cov(0, i), 0.0003 * 0.0003);
    EXPECT_EQ(survey.cov(1, i), 0.0);
    for (int k = 0; k < 3; ++k) error.push_back(survey.p(k, i) - points.p(k, i));
  }
  // 1200 draws know their sigma to 2%.
  EXPECT_NEAR(Rms(error) / 0.0003, 1.0, 0.08);
  EXPECT_NEAR(Mean(error), 0.0, 4.0 * 0.0003 / std::sqrt(1200.0));
}

}  // namespace
}  // namespace unfurl::measure::expose_test
