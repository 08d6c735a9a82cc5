// `auto` against the best of the other methods, over scenes drawn by seed
// (tests/hard/random_scenes.h).
//   auto_bench FIRST LAST [stiff]
// A line a scene and tolerance (1e-3, 1e-5, 1e-7): error of the marks [m] against 1e-10, thread's
// CPU [s], that of the cheapest run of another method and tolerance (1e-2 to 1e-8) that is at least
// as good, and their ratio; last how many are above two. Runs of under two milliseconds, which
// are read to no better than a factor of two, are counted apart.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "base/error.h"
#include "cpu_time.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"
#include "tests/hard/random_scenes.h"

namespace {

using unfurl::sim::MarkTracks;
using unfurl::sim::Method;
using unfurl::sim::Model;
using unfurl::sim::SimulateOptions;

constexpr double kNotCompared = 1e9;  // [m], of a run that ended early
constexpr double kMostRatio = 2.0;    // the goal of `auto`
constexpr double kReadable = 2e-3;    // CPU of a run that is compared [s]

struct Run {
  MarkTracks tracks;
  double cpu = 0.0;  // the faster of two [s]
  std::string name;
};

struct Choice {
  const char* name;
  Method method;
  int order;  // 0: the program's
};

Run RunOf(const Model& model, const Choice& choice, double rtol) {
  SimulateOptions options;
  options.rtol = rtol;
  options.rate = 100.0;
  options.method = choice.method;
  options.order = choice.order;
  Run run;
  for (int k = 0; k < 2; ++k) {
    const double begin = unfurl::bench::ThreadSeconds();
    run.tracks = unfurl::sim::SimulateMarks(model, options);
    const double took = unfurl::bench::ThreadSeconds() - begin;
    run.cpu = k == 0 ? took : std::min(run.cpu, took);
  }
  run.name = fmt::format("{} at {:.0e}", choice.name, rtol);
  return run;
}

double Error(const MarkTracks& run, const MarkTracks& truth) {
  if (!run.report.Usable() || run.t.size() != truth.t.size()) return kNotCompared;
  double largest = 0.0;
  for (std::size_t m = 0; m < run.x.size(); ++m) {
    for (std::size_t k = 0; k < run.t.size(); ++k) {
      largest =
          std::max(largest, std::hypot(run.x[m][k] - truth.x[m][k], run.y[m][k] - truth.y[m][k]));
    }
  }
  return largest;
}

struct Count {
  int all = 0, above = 0, above_short = 0, refused = 0;
};

void Compare(std::uint64_t seed, bool stiff, Count* count) {
  const unfurl::sim::RandomScene scene =
      stiff ? unfurl::sim::DrawStiffScene(seed) : unfurl::sim::DrawScene(seed);
  const auto model = unfurl::sim::CompileModel(unfurl::data::ParseScene(scene.toml, "random.toml"));
  constexpr Choice kAuto{"auto", Method::kAuto, 0};
  const MarkTracks truth = RunOf(*model, kAuto, 1e-10).tracks;
  if (!truth.report.Usable()) {
    fmt::print("{} has no reference: {}\n", seed, truth.report.message);
    return;
  }
  std::vector<Run> others;
  for (const Choice& choice : {Choice{"4(3)", Method::kProjected, 4},
                               {"5(4)", Method::kProjected, 5},
                               {"8(5,3)", Method::kProjected, 8},
                               {"implicit", Method::kImplicit, 0}}) {
    for (const double rtol : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
      others.push_back(RunOf(*model, choice, rtol));
    }
  }
  for (const double rtol : {1e-3, 1e-5, 1e-7}) {
    const Run run = RunOf(*model, kAuto, rtol);
    const double error = Error(run.tracks, truth);
    ++count->all;
    if (!run.tracks.report.Usable()) {
      ++count->refused;
      fmt::print("{} {:.0e}: {}\n", seed, rtol, run.tracks.report.message);
      continue;
    }
    const Run* best = nullptr;
    for (const Run& other : others) {
      if (Error(other.tracks, truth) > error) continue;
      if (best == nullptr || other.cpu < best->cpu) best = &other;
    }
    const double ratio = best == nullptr ? 0.0 : run.cpu / best->cpu;
    if (ratio > kMostRatio) ++(run.cpu > kReadable ? count->above : count->above_short);
    fmt::print("{:4} {:.0e} {:8.1e} m {:8.4f} s, best {:8.4f} s ({}): {:.2f}\n", seed, rtol, error,
               run.cpu, best == nullptr ? 0.0 : best->cpu, best == nullptr ? "none" : best->name,
               ratio);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "auto_bench FIRST LAST [stiff]\n");
    return 2;
  }
  try {
    Count count;
    const int last = std::stoi(argv[2]);
    for (int seed = std::stoi(argv[1]); seed <= last; ++seed) {
      Compare(static_cast<std::uint64_t>(seed), argc > 3, &count);
      std::fflush(stdout);
    }
    fmt::print("{} runs, {} refused, above twice the best: {}, and {} of under {} ms\n", count.all,
               count.refused, count.above, count.above_short, 1e3 * kReadable);
  } catch (const unfurl::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
