// Residuals as people judge them: what the bands promise, by chance itself.
#include "cli/residual_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace unfurl::cli::residual_views_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(ResidualViews, OrderedNormalValuesLieInTheirBandsAsOftenAsPromised) {
  constexpr int kRepeats = 4000;
  constexpr std::size_t kCount = 50;
  const std::size_t ranks[] = {1, 5, 25, 49, 50};
  int inside[5] = {};
  std::pair<double, double> band[5];
  for (int r = 0; r < 5; ++r) band[r] = NormalOrderBand(ranks[r], kCount, 0.95);
  Rng rng(11);
  std::vector<double> x(kCount);
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    for (double& v : x) v = rng.Normal();
    std::sort(x.begin(), x.end());
    for (int r = 0; r < 5; ++r) {
      const double v = x[ranks[r] - 1];
      inside[r] += v >= band[r].first && v <= band[r].second ? 1 : 0;
    }
  }
  // Of 4000 that hit at 0.95 the share scatters by 0.0034; four of that, for five ranks.
  for (int r = 0; r < 5; ++r) EXPECT_NEAR(inside[r] / double{kRepeats}, 0.95, 0.014) << ranks[r];
}

TEST(ResidualViews, NeighboursThatResembleEachOtherShow) {
  // x_i = 0.8 x_(i-1) + noise has autocorrelation 0.8^k; of 40000 values it scatters by 0.011
  // (Bartlett: sqrt((1 + r^2) / (1 - r^2) / n)); four of that.
  Rng rng(12);
  std::vector<double> x = {rng.Normal()};
  for (int i = 1; i < 40000; ++i) x.push_back(0.8 * x.back() + 0.6 * rng.Normal());
  const std::vector<double> found = Autocorrelations(x, 5);
  for (int k = 0; k <= 5; ++k) EXPECT_NEAR(found[k], std::pow(0.8, k), 0.044) << k;
  EXPECT_DOUBLE_EQ(found[0], 1.0);
}

std::string PageOf(std::size_t count, bool own_scale) {
  ResidualViews views;
  views.of = "camera";
  views.words = "as read";
  views.along = {"time", "s"};
  views.own_scale = own_scale;
  Rng rng(13);
  for (const char* name : {"a", "b"}) {
    ResidualGroup group{name, {}, {}};
    for (std::size_t i = 0; i < count; ++i) {
      group.along.push_back(0.1 * static_cast<double>(i));
      group.value.push_back(rng.Normal());
    }
    views.groups.push_back(group);
  }
  report::Page page("t");
  AddResidualViews(views, &page);
  return page.Html();
}

TEST(ResidualViews, EveryViewIsThereAndFewSayNothing) {
  const std::string html = PageOf(200, false);
  for (const char* title : {"Residuals, as read", "Against a normal distribution, as read",
                            "Likeness of neighbours, as read", "Residuals by camera, as read", "RMS"}) {
    EXPECT_THAT(html, HasSubstr(title));
  }
  EXPECT_THAT(PageOf(200, true), Not(HasSubstr("RMS")));
  EXPECT_THAT(PageOf(3, false), Not(HasSubstr("as read")));
  EXPECT_THAT(PageOf(5, false), Not(HasSubstr("Likeness")));  // no lags to speak of
}

}  // namespace
}  // namespace unfurl::cli::residual_views_test
