// A cost with several minima: one that a profile has found to be lower is where the fit ends.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "correlate/fit/fit.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate::better_point_test {
namespace {

// The two-link arm whose tip is displaced by (a, B sin(k a)) in the plane from t = 0.5 s on: the
// distance to a = 0 has a minimum near every multiple of pi / k as long as 2 a < B^2 k.
class WavyTip : public Model {
 public:
  static constexpr double kNumber = 1000.0;  // k [1/m]
  static constexpr double kSize = 0.004;     // B [m]
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out = arm_.Evaluate(TwoLink::Truth(), stamps);
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      if (stamps.marks[m] != "tip") continue;
      for (std::size_t i = 0; i < stamps.t[m].size(); ++i) {
        if (stamps.t[m][i] < 0.5) continue;
        out.marks[m].p.col(static_cast<Eigen::Index>(i)) +=
            Eigen::Vector3d(theta[0], kSize * std::sin(kNumber * theta[0]), 0.0);
      }
    }
    return out;
  }

 private:
  TwoLink arm_;
};

TEST(BetterPoint, IsWhereTheFitEnds) {
  const WavyTip model;
  const double next = std::numbers::pi / WavyTip::kNumber;  // the next minimum, about [m]
  Rng rng(3);
  const Observations data =
      Record(model, std::vector<double>{0.0}, TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  problem.parameters.resize(1);
  Parameter& a = problem.parameters[0];
  a.name = "a", a.unit = "m", a.low = -0.02, a.high = 0.02, a.start = 1.02 * next;
  FitOptions options;
  options.whiten = false;
  options.profile.wanted = false;
  options.search.screened = 0;  // and no look elsewhere
  const FitResult blind = Fit(problem, options);
  ASSERT_TRUE(blind.Usable()) << blind.message;
  EXPECT_NEAR(blind.parameters[0].value, next, 0.1 * next);  // the wrong one, as it must

  // Held as far away as the right minimum is, the profile comes upon it.
  options.profile.wanted = true;
  options.profile.levels = {blind.parameters[0].value / blind.parameters[0].sigma_data};
  const FitResult fit = Fit(problem, options);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_GE(fit.returns, 1);
  EXPECT_LT(fit.cost, blind.cost);
  EXPECT_EQ(fit.profile_below, 0.0);
  EXPECT_NEAR(fit.parameters[0].value, 0.0, 4.0 * fit.parameters[0].sigma);
}

}  // namespace
}  // namespace unfurl::correlate::better_point_test
