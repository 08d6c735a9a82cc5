#pragma once

#include <cstdio>

#include "tests/measure/marks.h"

namespace unfurl::measure {

// A tenth of all readings is off by 10 to 1000 sigmas either way, any order of magnitude alike.
struct GrossScore {
  std::size_t lines[5] = {}, lost[5] = {};  // by number of bad readings
  std::size_t found = 0, named = 0, misnamed = 0, false_alarm = 0;
  // Squares, of what is claimed: its error, and that of the same readings unspoiled; and of all
  // lines with one bad reading at most, the unspoiled ones' and what is left when whoever knows
  // leaves out the bad one.
  double claimed = 0.0, unspoiled = 0.0, clean = 0.0, known = 0.0;
  double worst = 0.0;

  double Share(std::size_t n, int bad) const {
    return static_cast<double>(n) / static_cast<double>(lines[bad]);
  }
  double Ratio() const { return std::sqrt(claimed / unspoiled); }
  double KnownRatio() const { return std::sqrt(known / clean); }
  void Count(const Triangulator& triangulator, const TrackedPoint& found_point,
             const Eigen::Vector3d& p, const std::vector<double>& u, std::uint32_t bad) {
    const std::vector<double> s(4, kSigma);
    const bool solved = data::Usable(found_point.status);
    const int count = __builtin_popcount(bad);
    ++lines[count];
    lost[count] += !solved;
    const double whole = (triangulator.Solve(u, s, p).p - p).squaredNorm();
    if (count == 0) false_alarm += found_point.status != data::SampleStatus::kGood;
    if (count == 1) {
      found += found_point.status != data::SampleStatus::kGood;
      const bool told = found_point.status == data::SampleStatus::kRejectedReading;
      named += told && found_point.left_out == bad;
      misnamed += told && found_point.left_out != bad;
    }
    if (count <= 1) {
      clean += whole;
      known += (triangulator.Solve(u, s, p, ~bad).p - p).squaredNorm();
    }
    if (!solved) return;
    const double error = (found_point.point.p - p).squaredNorm();
    claimed += error;
    unspoiled += whole;
    worst = std::max(worst, std::sqrt(error));
  }
  void Print() const {
    std::printf(
        "gross readings: %zu lines with one, %.4f found, %.4f named, %.4f misnamed, %.4f lost; %zu "
        "clean, %.4f called bad, %.4f lost; %zu with two, %.4f lost; RMS over clean %.3f, by "
        "whoever knows the bad ones %.3f; largest %.2f mm\n",
        lines[1], Share(found, 1), Share(named, 1), Share(misnamed, 1), Share(lost[1], 1), lines[0],
        Share(false_alarm, 0), Share(lost[0], 0), lines[2], Share(lost[2], 2), Ratio(),
        KnownRatio(), 1e3 * worst);
  }
};

// Each seed 2 s of four marks, one after another, at 200 samples a second each; `way(mark, t,
// phase)` tells where they are.
template <typename Way>
GrossScore Gross(std::uint64_t first, std::uint64_t last, const Way& way) {
  GrossScore score;
  const Triangulator triangulator(ShippedRig());
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    Following following(triangulator, 4);
    Rng rng(seed);
    for (int i = 0; i < 2000; ++i) {
      const int mark = i % 5;
      if (mark == 4) continue;
      const Eigen::Vector3d p = way(mark, 1e-3 * i, static_cast<double>(seed));
      Line line = Readings(p, rng);
      std::uint32_t bad = 0;
      std::vector<double> u(4);
      for (std::size_t c = 0; c < 4; ++c) {
        u[c] = line[c][0].u_px;
        if (rng.Uniform() >= 0.1) continue;
        const double size = std::exp(rng.Uniform(std::log(10.0), std::log(1000.0)));
        line[c][0].u_px += (rng.Uniform() < 0.5 ? -1.0 : 1.0) * size * kSigma;
        bad |= 1U << c;
      }
      following.Add(1e-3 * i, {mark}, line, [&, p, u, bad](const auto& found) {
        score.Count(triangulator, found[0], p, u, bad);
      });
    }
    following.Finish();
  }
  return score;
}

}  // namespace unfurl::measure
