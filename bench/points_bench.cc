// Throughput of readings to points on one core, and what accuracy costs there: three or four
// cameras, the readings' covariance alone or with the calibration's part, strobed or lit together.
// CPU time, for on a shared machine the clock on the wall says little.
//   points_bench [RIG.h5]
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "cpu_time.h"
#include "data/rig.h"
#include "measure/camera_model.h"
#include "measure/mark_tracker.h"
#include "measure/triangulate.h"

namespace {

using namespace unfurl;
using namespace unfurl::measure;

constexpr double kSigma = 0.02;  // of a reading [px]
constexpr int kMarks = 4;

void Report(const std::string& what, double seconds, double target = 0.0) {
  fmt::print("{:<66} {:>8.3f} us {:>10.0f} points/s", what, 1e6 * seconds, 1.0 / seconds);
  if (target > 0.0) fmt::print("  {:.2f} x wanted", 1.0 / seconds / target);
  fmt::print("\n");
}

// A mark's way at about 1 m/s.
Eigen::Vector3d Swing(int mark, double t) {
  const double reach = 0.15 + 0.25 * mark, rate = 2.0 - 0.3 * mark;
  return {-0.4 + 0.3 * mark + reach * std::sin(rate * t + mark),
          -0.3 + 0.6 * reach * std::cos(rate * t + mark), 0.05 * mark};
}

void Run(const std::string& path) {
  const data::Rig rig = data::ReadRig(path);
  Triangulator triangulator(rig);
  const std::size_t cameras = rig.cameras.size();
  Rng rng(1);
  constexpr std::size_t kSamples = 4096;  // 5 ms apart, one mark after another
  std::vector<Eigen::Vector3d> truth;
  std::vector<std::vector<double>> u;
  for (std::size_t i = 0; i < kSamples; ++i) {
    truth.push_back(Swing(static_cast<int>(i) % kMarks, 5e-3 * static_cast<double>(i / kMarks)));
    u.emplace_back(cameras);
    for (std::size_t c = 0; c < cameras; ++c) {
      Project(rig.cameras[c], truth.back(), &u.back()[c]);
      u.back()[c] += kSigma * rng.Normal();
    }
  }
  const std::vector<double> s(cameras, kSigma);
  const Eigen::Vector3d step(0.004, 0.003, 0.0);  // a mark's way between two samples at 1 m/s
  const std::uint32_t three = ~1U;
  double four_error = 0.0, three_error = 0.0, sum = 0.0;
  std::vector<PointSolution> points;
  for (std::size_t i = 0; i < kSamples; ++i) {
    points.push_back(triangulator.Solve(u[i], s, truth[i]));
    four_error += (points.back().p - truth[i]).squaredNorm() / kSamples;
    three_error +=
        (triangulator.Solve(u[i], s, truth[i], three).p - truth[i]).squaredNorm() / kSamples;
  }
  fmt::print("error of readings of {} px: {:.4f} mm with four cameras, {:.4f} mm without {}\n",
             kSigma, 1e3 * std::sqrt(four_error), 1e3 * std::sqrt(three_error),
             rig.cameras[0].name);

  const double solve = bench::SecondsEach(40000, [&](std::size_t i) {
    sum += triangulator.Solve(u[i % kSamples], s, truth[i % kSamples] + step).p.x();
  });
  Report("four cameras, with the readings' covariance", solve, 1e6);
  Report("three cameras, with the readings' covariance",
         bench::SecondsEach(
             40000,
             [&](std::size_t i) {
               sum +=
                   triangulator.Solve(u[i % kSamples], s, truth[i % kSamples] + step, three).p.x();
             }),
         1e6);
  PointSolution twin;
  Report("  and whether a second point fits the three",
         bench::SecondsEach(40000, [&](std::size_t i) {
           const PointSolution point =
               triangulator.Solve(u[i % kSamples], s, truth[i % kSamples] + step, three);
           sum += triangulator.SecondSolution(u[i % kSamples], s, point, &twin);
         }));

  const auto shared = [&](const char* what) {
    Eigen::Matrix3Xd F(3, triangulator.shared_rank());
    Eigen::Matrix3d rest;
    double largest = 0.0;
    const double seconds = bench::SecondsEach(20000, [&](std::size_t i) {
      const PointSolution point =
          triangulator.Solve(u[i % kSamples], s, truth[i % kSamples] + step);
      triangulator.SharedFactor(point, s, F, &rest);
      largest = std::max(largest, rest.trace() / (rest.trace() + F.squaredNorm()));
    });
    Report(fmt::format("four cameras, with the calibration's part ({}, k = {})", what,
                       triangulator.shared_rank()),
           seconds, 3e5);
    fmt::print("    left to the samples' own covariance: {:.1e} of the variance at most\n",
               largest);
  };
  shared("whole volume");
  std::vector<PointSolution> some;
  for (std::size_t i = 0; i < kSamples; i += 17) some.push_back(points[i]);
  for (const double tolerance : {1e-4, 1e-5, 1e-6}) {
    triangulator = Triangulator(rig, {.shared_tolerance = tolerance});
    triangulator.ReduceShared(some);
    shared(fmt::format("on the path, {:.0e}", tolerance).c_str());
  }

  MarkTracker tracker(triangulator, kMarks);
  std::vector<Candidate> candidates(cameras * kMarks);
  std::vector<std::span<const Candidate>> spans(cameras);
  double clock = 0.0;
  Report("strobed: with what tells how the mark moves",
         bench::SecondsEach(40000,
                            [&](std::size_t i) {
                              const std::size_t k = i % kSamples;
                              for (std::size_t c = 0; c < cameras; ++c) {
                                candidates[c] = {u[k][c], kSigma};
                                spans[c] = {&candidates[c], 1};
                              }
                              if (k == 0) clock += 1.0;  // back to the start: long after
                              const int lit[] = {static_cast<int>(k) % kMarks};
                              const double t = clock + 5e-3 * static_cast<double>(k / kMarks);
                              clock += k + 1 == kSamples
                                           ? 5e-3 * static_cast<double>(kSamples / kMarks)
                                           : 0.0;
                              tracker.Add(t, lit, spans);
                              while (const TrackedLine* line = tracker.Next()) {
                                sum += line->points[0].point.p.x();
                              }
                            }),
         1e6);
  MarkTracker together(triangulator, kMarks);
  for (int m = 0; m < kMarks; ++m)
    together.Expect(static_cast<std::size_t>(m), Swing(m, 0.0), 0.05);
  const int lit[] = {0, 1, 2, 3};
  double t = 0.0;
  std::size_t usable = 0, all = 0;
  Report("four lit together, spots told apart",
         bench::SecondsEach(1000, [&](std::size_t) {
           t += 5e-3;
           for (std::size_t c = 0; c < cameras; ++c) {
             for (int m = 0; m < kMarks; ++m) {
               Candidate& candidate = candidates[c * kMarks + static_cast<std::size_t>(m)];
               Project(rig.cameras[c], Swing(m, t), &candidate.u_px);
               candidate.s_px = kSigma;
             }
             spans[c] = {&candidates[c * kMarks], kMarks};
           }
           together.Add(t, lit, spans);
           while (const TrackedLine* line = together.Next()) {
             for (const TrackedPoint& p : line->points) {
               usable += data::Usable(p.status);
               ++all;
             }
           }
         }) / kMarks);
  fmt::print("    {} of {} solved\n", usable, all);
  if (sum == 0.0) fmt::print("nothing was found\n");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Run(argc > 1 ? argv[1] : UNFURL_SOURCE_DIR "/data/sets/deployment/rig.h5");
  } catch (const unfurl::Error& error) {
    std::fprintf(stderr, "points_bench: %s\n", error.what());
    return unfurl::kExitBadInput;
  }
  return 0;
}
