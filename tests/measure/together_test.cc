// Marks that are lit together.
#include "tests/measure/together.h"

#include <cstdio>

namespace unfurl::measure::together_test {
namespace {

TEST(Together, FourMarksAreToldApart) {
  const TogetherScore score = FourTogether(3, 6);
  score.Print();
  // What is claimed is right, and nearly all that three cameras show is claimed.
  EXPECT_EQ(score.claimed.wrong, 0U);
  EXPECT_GE(score.possible.Share(score.possible.right), 0.98);
}

TEST(Together, MarksOfUnknownStartAreNamedByTheirPlacesAndItIsSaid) {
  const Triangulator triangulator(ShippedRig());
  Following following(triangulator, 3);
  Rng rng(3);
  const Eigen::Matrix3Xd points =
      RandomPoints(ShippedRig().volume_low, ShippedRig().volume_high, 3, 8);
  std::vector<Eigen::Vector3d> truth = {points.col(0), points.col(1), points.col(2)};
  std::sort(truth.begin(), truth.end(), [](const auto& a, const auto& b) { return a.x() < b.x(); });
  Line line(4);
  for (std::size_t c = 0; c < 4; ++c) {
    for (const Eigen::Vector3d& p : truth) line[c].push_back(Reading(c, p, rng));
    std::sort(line[c].begin(), line[c].end(),
              [](const Candidate& a, const Candidate& b) { return a.u_px < b.u_px; });
  }
  int judged = 0;
  following.Add(0.0, {0, 1, 2}, line, [&](const auto& found) {
    for (std::size_t m = 0; m < 3; ++m) {
      ++judged;
      EXPECT_EQ(found[m].status, data::SampleStatus::kGood);
      EXPECT_LT((found[m].point.p - truth[m]).norm(), 1e-3);
    }
  });
  following.Finish();
  EXPECT_EQ(judged, 3);
  for (std::size_t m = 0; m < 3; ++m) EXPECT_TRUE(following.tracker().named_by_place(m));
}

TEST(Together, TwoMarksThatMeetAreAmbiguousAndNeverSwapped) {
  // Two marks on one line through each other, at the same speed: while they are nearer than what
  // the readings tell apart, nothing is claimed that is wrong by more than that.
  const Triangulator triangulator(ShippedRig());
  Following following(triangulator, 2);
  Rng rng(3);
  Score score;
  for (int i = 0; i < 400; ++i) {
    const double t = 5e-3 * i, x = 0.4 * (t - 1.0);
    const std::vector<Eigen::Vector3d> truth = {{x, 0.1, 0.0}, {-x, 0.1, 0.004}};
    if (i == 0) {
      following.tracker().Expect(0, truth[0], 0.02);
      following.tracker().Expect(1, truth[1], 0.02);
    }
    following.Add(t, {0, 1}, Show(truth, 0.0, 0.0, rng), [&, truth](const auto& found) {
      for (std::size_t m = 0; m < 2; ++m) score.Count(found[m], truth[m]);
    });
  }
  following.Finish();
  std::printf("meeting: %zu right, %zu wrong, %zu unsolved, worst %.3f mm\n", score.right,
              score.wrong, score.unsolved, 1e3 * score.worst);
  EXPECT_EQ(score.wrong, 0U);
  EXPECT_GT(score.right, score.all() * 8 / 10);
}

}  // namespace
}  // namespace unfurl::measure::together_test
