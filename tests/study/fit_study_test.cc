#include "study/fit_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "correlate/observations.h"
#include "tests/study/arm.h"

namespace unfurl::study::fit_study_test {
namespace {

// A mark on a circle, one turn in `period` [s]; keeps the shortest step that it was asked for [s].
class Circle : public correlate::Model {
 public:
  explicit Circle(double period) : period_(period) {}
  correlate::Prediction Evaluate(std::span<const double> /*theta*/,
                                 const correlate::Stamps& stamps) const override {
    correlate::Prediction out;
    for (const std::vector<double>& t : stamps.t) {
      correlate::MarkMotion motion;
      const auto n = static_cast<Eigen::Index>(t.size());
      motion.p.setZero(3, n);
      motion.v.setZero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const double turn = 2.0 * M_PI * t[at] / period_;
        motion.p.col(i) << std::cos(turn), std::sin(turn), 0.0;
        if (i > 0) shortest_ = std::min(shortest_, t[at] - t[at - 1]);
      }
      out.marks.push_back(std::move(motion));
    }
    return out;
  }
  double shortest() const { return shortest_; }

 private:
  double period_;
  mutable double shortest_ = std::numeric_limits<double>::infinity();
};

// The model is sampled by the record's own interval, whether a hinge snaps in milliseconds or a
// boom takes minutes: ten times as often as the mark.
TEST(CompareAtEstimate, SamplesTheModelByTheRecord) {
  for (const double interval : {1e-5, 5e-3, 0.8}) {
    constexpr int kSamples = 200;
    const Circle model(kSamples * interval);
    correlate::MarkSeries mark;
    mark.name = "a";
    mark.p.resize(3, kSamples);
    mark.cov.setZero(6, kSamples);
    for (int i = 0; i < kSamples; ++i) {
      mark.t.push_back(3.0 + i * interval);
      const double turn = 2.0 * M_PI * i / kSamples;
      mark.p.col(i) << std::cos(turn), std::sin(turn), 0.0;
      for (const int row : {0, 3, 5}) mark.cov(row, i) = 1e-8;
    }
    correlate::Observations observations;
    observations.marks.push_back(mark);
    correlate::FitTrial trial;
    trial.name = "circle";
    trial.observations = &observations;
    trial.model = &model;
    CompareAtEstimate(trial, {});
    EXPECT_NEAR(model.shortest() / interval, 0.1, 1e-6) << interval;
  }
}

class ModelWarnings : public ArmTest {};

// A fit is no better than its runs: a spring known between -0.3 and 0.3 rad, and swings of 0.6 rad.
TEST_F(ModelWarnings, AreToldWithTheFit) {
  for (const double reach : {0.3, 0.7}) {
    const std::string table = fmt::format("joint.hinge.table.theta=[{}, {}]", -reach, reach);
    const std::string moment = fmt::format("joint.hinge.table.moment=[{}, {}]", reach, -reach);
    Record("beyond.csv", {"mid", "tip"}, {table, moment}, 4);
    const StudyFit fit = Fit(Study("beyond.csv", fmt::format("\"{}\", \"{}\"", table, moment)), {});
    ASSERT_TRUE(fit.Usable()) << fit.record.verdict;
    const auto told = std::count_if(
        fit.record.reasons.begin(), fit.record.reasons.end(), [](const std::string& reason) {
          return reason.find("The simulation warns: the angle of 'hinge' went to") == 0;
        });
    EXPECT_EQ(told, reach < 0.6 ? 1 : 0) << reach;
  }
}

}  // namespace
}  // namespace unfurl::study::fit_study_test
