// Coverage over the whole plane of trials and scatter, and of a real model.
#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "tests/correlate/campaigns.h"
#include "tests/correlate/two_link_campaigns.h"

namespace unfurl::correlate::hierarchy_slow_test {
namespace {

class ManyCampaigns : public ::testing::TestWithParam<CampaignCase> {};

TEST_P(ManyCampaigns, AreCovered) {
  constexpr std::size_t kCampaigns = 5000;
  const CoverageCount count = CoverageOf(GetParam(), kCampaigns);
  const auto share = [](std::size_t n) {
    return 100.0 * static_cast<double>(n) / static_cast<double>(kCampaigns);
  };
  std::printf(
      "%ld trials, scatter %g%s: mean %.1f%%, scatter %.1f%%, next %.1f%%, left out %.1f%%\n",
      static_cast<long>(GetParam().trials), GetParam().scatter,
      GetParam().unequal ? ", unequal" : "", share(count.mean), share(count.scatter),
      share(count.next), share(count.left_out));
  const bool none = GetParam().scatter == 0.0;
  ExpectWithin(count.mean, kCampaigns, 0.93, 0.97);
  ExpectWithin(count.scatter, kCampaigns, none ? 0.975 : 0.95, none ? 0.975 : 0.95);
  ExpectWithin(count.next, kCampaigns, 0.93, GetParam().scatter < 1.0 ? 1.0 : 0.97);
}

std::vector<CampaignCase> Plane() {
  std::vector<CampaignCase> out;
  for (Eigen::Index trials : {3, 5, 8, 20}) {
    for (double scatter : {0.0, 0.3, 1.0, 3.0, 10.0}) {
      for (bool unequal : {false, true}) out.push_back({trials, scatter, unequal});
    }
  }
  return out;
}

INSTANTIATE_TEST_SUITE_P(Plane, ManyCampaigns, ::testing::ValuesIn(Plane()));

// 500 campaigns of eight trials of the two-link arm, each fitted from its marks.
TEST(CampaignsOfTheArm, AreCovered) {
  constexpr std::size_t kCampaigns = 500;
  TwoLinkCampaigns c;
  for (std::size_t k = 0; k < kCampaigns; ++k) ASSERT_TRUE(c.Add(7000 + k));
  for (std::size_t j = 0; j < 2; ++j) {
    std::printf("parameter %zu: mean %zu, scatter %zu of %zu\n", j, c.mean[j], c.scatter[j],
                kCampaigns);
    ExpectWithin(c.mean[j], kCampaigns, 0.93, 0.97);
    ExpectWithin(c.scatter[j], kCampaigns, 0.93, 0.97);
  }
  const double share = static_cast<double>(c.inside) / static_cast<double>(c.samples);
  std::printf("samples of the next trial's marks in the band: %.2f%%\n", 100.0 * share);
  EXPECT_GT(share, 0.93);
  EXPECT_LT(share, 0.97);
}

}  // namespace
}  // namespace unfurl::correlate::hierarchy_slow_test
