#pragma once

#include <algorithm>
#include <cstdio>

#include "tests/measure/marks.h"

namespace unfurl::measure {

inline constexpr double kMerge = 12.0;  // two spots as near as this are one, in the middle [px]

// What cameras show of several marks: each spot missing with chance `missing`, one line in forty
// with a spot of nothing, in order along the row. `alone[m]`, when not null, gets how many cameras
// show mark m by itself.
inline Line Show(const std::vector<Eigen::Vector3d>& marks, double missing, double clutter,
                 Rng& rng, std::vector<int>* alone = nullptr) {
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

struct TogetherScore {
  Score claimed;
  Score possible;  // the same of samples that three cameras at least show by themselves
  void Print() const {
    std::printf(
        "together: %zu right, %zu wrong, %zu unsolved, worst %.3f mm; of %zu possible %zu\n",
        claimed.right, claimed.wrong, claimed.unsolved, 1e3 * claimed.worst, possible.all(),
        possible.right);
  }
};

// Each seed 2 s of four marks at 200 lines a second, spots in any order; where two come nearer than
// 12 px in a camera, as three widths, there is one spot between them; one spot in a hundred is
// missing, and one line in ten has a spot of nothing. Whoever knows where the marks start, says so.
inline TogetherScore FourTogether(std::uint64_t first, std::uint64_t last) {
  TogetherScore out;
  const Triangulator triangulator(ShippedRig());
  for (std::uint64_t seed = first; seed <= last; ++seed) {
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
          out.claimed.Count(found[m], truth[m]);
          if (alone[m] >= 3) out.possible.Count(found[m], truth[m]);
        }
      });
    }
    following.Finish();
  }
  return out;
}

}  // namespace unfurl::measure
