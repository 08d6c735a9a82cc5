#include "correlate/hierarchy/from_fits.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/correlate/two_link_campaigns.h"
#include "tests/repeats.h"

namespace unfurl::correlate::from_fits_test {
namespace {

using ::testing::HasSubstr;

// A fit's result by itself: values, errors of the data and of the model, a calibration's direction.
FitResult Result(double frequency, double decay, double model = 0.0) {
  FitResult r;
  r.status = FitStatus::kConverged;
  r.parameters.resize(2);
  r.parameters[0].value = frequency;
  r.parameters[1].value = decay;
  for (ParameterEstimate& e : r.parameters) {
    e.data95 = {e.value - 1.0, e.value + 1.0};
    e.verdict = Verdict::kDetermined;
  }
  r.covariance_model = model * Eigen::Matrix2d::Identity();
  r.covariance = Eigen::Vector2d(4e-6, 9e-4).asDiagonal();
  r.covariance += r.covariance_model;
  r.trials.resize(1);
  r.trials[0].calibration_shift = Eigen::Vector2d(1e-3, 0.0);
  return r;
}

TEST(FromFits, KeepsApartWhatTrialsShare) {
  const std::vector<Parameter> parameters = TwoLinkParameters();
  const std::vector<FitResult> results = {Result(0.9, 0.3, 1e-5), Result(0.91, 0.3, 1e-5),
                                          Result(0.89, 0.3, 1e-5)};
  std::vector<FitTrial> trials(3);
  for (FitTrial& t : trials) t.calibration = "rig";
  const auto fitted = [&] {
    return FromFits(
        parameters,
        {{&trials[0], &results[0]}, {&trials[1], &results[1]}, {&trials[2], &results[2]}});
  };
  const HierarchyProblem one = fitted().problem;
  EXPECT_NEAR(one.shared(0, 0), 1e-5 + 1e-6, 1e-18);         // model, calibration
  EXPECT_NEAR(one.shared(1, 1), 1e-5 / (0.3 * 0.3), 1e-15);  // of the logarithm
  EXPECT_NEAR(one.trials[0].covariance(0, 0), 3e-6, 1e-18);  // without the calibration's
  EXPECT_NEAR(one.trials[0].covariance(1, 1), 9e-4 / 0.09, 1e-15);
  EXPECT_NEAR(one.trials[0].value(1), std::log(0.3), 1e-15);
  trials[2].calibration = "another rig";
  const HierarchyProblem apart = fitted().problem;
  EXPECT_NEAR(apart.shared(0, 0), 1e-5, 1e-18);
  EXPECT_NEAR(apart.trials[0].covariance(0, 0), 4e-6, 1e-18);
}

TEST(FromFits, LeavesOutWhatIsNoEstimate) {
  std::vector<FitTrial> trials(4);
  for (std::size_t i = 0; i < 4; ++i) trials[i].name = "trial " + std::to_string(i + 1);
  std::vector<FitResult> results(4, Result(0.9, 0.3));
  results[0].status = FitStatus::kNotConverged;
  results[0].message = "gave up";
  results[1].parameters[1].data95.high = std::nan("");
  results[2].parameters[0].verdict = Verdict::kAtBound;
  std::vector<FittedTrial> fits;
  for (std::size_t i = 0; i < 4; ++i) fits.push_back({&trials[i], &results[i]});
  const FittedTrials fitted = FromFits(TwoLinkParameters(), fits);
  EXPECT_THAT(fitted.used, ::testing::ElementsAre(3u));
  ASSERT_EQ(fitted.left_out.size(), 3u);
  EXPECT_THAT(fitted.left_out[0], HasSubstr("trial 1 is left out: gave up"));
  EXPECT_THAT(fitted.left_out[1], HasSubstr("leaves decay open"));
  EXPECT_THAT(fitted.left_out[2], HasSubstr("frequency is at its bound"));
}

// Few campaigns of the real thing; hundreds are slow.
TEST(FromFits, CoversTheTwoLinkArm) {
  const auto campaigns = static_cast<std::size_t>(Repeats(8, 12));
  TwoLinkCampaigns c;
  for (std::size_t k = 0; k < campaigns; ++k) ASSERT_TRUE(c.Add(7000 + k));
  for (std::size_t j = 0; j < 2; ++j) {
    ExpectWithin(c.mean[j], campaigns, 0.95, 0.95);
    ExpectWithin(c.scatter[j], campaigns, 0.95, 0.95);
  }
  EXPECT_GT(static_cast<double>(c.inside), 0.8 * static_cast<double>(c.samples));
}

}  // namespace
}  // namespace unfurl::correlate::from_fits_test
