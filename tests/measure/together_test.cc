// Marks that are lit together.
#include <cstdio>

#include "tests/measure/marks.h"

namespace unfurl::measure {
namespace {

constexpr double kMerge = 12.0;  // two spots as near as this are one, in the middle [px]

// What cameras show of several marks: each spot missing with chance `missing`, one line in forty
// with a spot of nothing, in order along the row. `alone[m]`, when not null, gets how many cameras
// show mark m by itself.
Line Show(const std::vector<Eigen::Vector3d>& marks, double missing, double clutter, Rng& rng,
          std::vector<int>* alone = nullptr) {
  Line line(4);
  if (alone != nullptr) alone->assign(marks.size(), 0);
  for (std::size_t c = 0; c < 4; ++c) {
    std::vector<double> at(marks.size(), -1e9);
    for (std::size_t m = 0; m < marks.size(); ++m) {
      if (rng.Uniform() < missing) continue;
      line[c].push_back(Reading(c, marks[m], rng));
      at[m] = line[c].back().u_px;
    }
    for (std::size_t m = 0; alone != nullptr && m < marks.size(); ++m) {
      bool clear = at[m] > 0.0;
      for (std::size_t o = 0; o < marks.size(); ++o) {
        clear = clear && (o == m || std::abs(at[o] - at[m]) > kMerge);
      }
      (*alone)[m] += clear;
    }
    if (rng.Uniform() < clutter) line[c].push_back({rng.Uniform(20.0, 2140.0), kSigma});
    std::sort(line[c].begin(), line[c].end(),
              [](const Candidate& a, const Candidate& b) { return a.u_px < b.u_px; });
    for (std::size_t k = 1; k < line[c].size();) {
      if (line[c][k].u_px - line[c][k - 1].u_px < kMerge) {
        line[c][k - 1].u_px = 0.5 * (line[c][k].u_px + line[c][k - 1].u_px);
        line[c].erase(line[c].begin() + static_cast<std::ptrdiff_t>(k));
      } else {
        ++k;
      }
    }
  }
  return line;
}

TEST(Together, FourMarksAreToldApart) {
  // Ten seeds of 2 s at 200 lines a second, spots in any order; where two come nearer than 12 px in
  // a camera, as three widths, there is one spot between them; one spot in a hundred is missing,
  // and one line in ten has a spot of nothing. Whoever knows where the marks start, says so.
  // `possible`: where three cameras at least show a mark by itself.
  Score score, possible;
  const Triangulator triangulator(ShippedRig());
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Following following(triangulator, 4);
    Rng rng(seed);
    const double phase = static_cast<double>(seed);
    for (int m = 0; m < 4; ++m) {
      following.tracker().Expect(static_cast<std::size_t>(m), Swing(m, 0.0, phase), 0.01);
    }
    for (int i = 0; i < 400; ++i) {
      const double t = 5e-3 * i;
      std::vector<Eigen::Vector3d> truth;
      for (int m = 0; m < 4; ++m) truth.push_back(Swing(m, t, phase));
      std::vector<int> alone;
      const Line line = Show(truth, 0.01, 0.025, rng, &alone);
      following.Add(t, {0, 1, 2, 3}, line, [&, truth, alone](const auto& found) {
        for (std::size_t m = 0; m < 4; ++m) {
          score.Count(found[m], truth[m]);
          if (alone[m] >= 3) possible.Count(found[m], truth[m]);
        }
      });
    }
    following.Finish();
  }
  std::printf("together: %zu right, %zu wrong, %zu unsolved, worst %.3f mm; of %zu possible %zu\n",
              score.right, score.wrong, score.unsolved, 1e3 * score.worst, possible.all(),
              possible.right);
  // What is claimed is right. A spot between two marks that was taken for one of them would be off
  // by up to 6 px, 9 mm; another mark's name by decimetres.
  EXPECT_LE(static_cast<double>(score.wrong), 2e-4 * static_cast<double>(score.all()));
  EXPECT_LT(score.worst, 3e-3);
  // Two marks that are lost in one place stay lost, for nobody can say which is which: some seeds
  // lose half of a record, the others 1% of what three cameras show.
  EXPECT_GE(score.Share(score.right), 0.85);
  EXPECT_GE(possible.Share(possible.right), 0.9);
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
}  // namespace unfurl::measure
