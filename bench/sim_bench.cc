// The simulator's speed and accuracy: nanoseconds of one right-hand side per body, and the
// deployment's time against its tolerance, with the error of the marks against a tighter run.
//   sim_bench SCENE.toml [--damping BETA] [segments ...]        (default 4 8 16, the scene's own)
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "base/error.h"
#include "data/scene.h"
#include "sim/dynamics/dynamics.h"
#include "sim/dynamics/flush_denormals.h"
#include "sim/methods/simulate.h"

namespace {

using unfurl::sim::MarkTracks;
using unfurl::sim::Model;

Model ModelOf(const std::string& path, int segments, double damping) {
  unfurl::data::Scene scene = unfurl::data::ReadScene(path);
  for (auto& beam : scene.beams) {
    beam.segments = segments;
    if (damping >= 0.0) beam.damping = damping;
  }
  return unfurl::sim::Compile(scene);
}

// The state of the last sample.
struct Last : unfurl::sim::Observer {
  explicit Last(int size) : state(size) {}
  void OnSample(double, double* y, const std::vector<unfurl::sim::LatchMode>&) override {
    std::copy_n(y, state.size(), state.begin());
  }
  std::vector<double> state;
};

double NanosecondsPerRightSide(const Model& model) {
  unfurl::sim::Dynamics dynamics(model);
  dynamics.track_energy = false;
  // In the midst of the motion: at the start most couplings are zero.
  Last last(model.index.size());
  unfurl::sim::SimulateOptions options;
  options.duration = 1.0;
  unfurl::sim::Simulate(model, options, &last);
  std::vector<double> y = last.state, rate(y.size());
  const unfurl::sim::FlushDenormals flush;
  double best = 1e300;
  constexpr int kCalls = 20000, kRepeats = 7;
  for (int r = 0; r < kRepeats; ++r) {
    const auto begin = std::chrono::steady_clock::now();
    for (int k = 0; k < kCalls; ++k) dynamics.RightSide(0.0, y.data(), rate.data());
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    best = std::min(best, took.count() / kCalls * 1e9);
  }
  return best;
}

double WorstMarkError(const MarkTracks& a, const MarkTracks& b) {
  double worst = 0.0;
  for (std::size_t m = 0; m < a.x.size(); ++m) {
    for (std::size_t i = 0; i < std::min(a.t.size(), b.t.size()); ++i) {
      worst = std::max(worst, std::hypot(a.x[m][i] - b.x[m][i], a.y[m][i] - b.y[m][i]));
    }
  }
  return worst;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: sim_bench SCENE.toml [--damping BETA] [segments ...]\n");
    return 2;
  }
  std::vector<int> segments;
  double damping = -1.0;
  for (int k = 2; k < argc; ++k) {
    if (std::string(argv[k]) == "--damping" && k + 1 < argc) {
      damping = std::stod(argv[++k]);
    } else {
      segments.push_back(std::stoi(argv[k]));
    }
  }
  if (segments.empty()) segments = {4, 8, 16};
  try {
    fmt::print("{:>4} {:>7} {:>9} {:>8} {:>7} {:>8} {:>9} {:>7} {:>9} {:>11}\n", "n", "bodies",
               "rhs [ns]", "per body", "rtol", "steps", "evals", "events", "cpu [s]", "error [mm]");
    for (const int n : segments) {
      const Model model = ModelOf(argv[1], n, damping);
      const double ns = NanosecondsPerRightSide(model);
      unfurl::sim::SimulateOptions options;
      options.rtol = 1e-8;
      const MarkTracks reference = unfurl::sim::SimulateMarks(model, options);
      for (const double rtol : {1e-4, 1e-5, 1e-6}) {
        options.rtol = rtol;
        const std::clock_t begin = std::clock();
        const MarkTracks tracks = unfurl::sim::SimulateMarks(model, options);
        const double cpu = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
        fmt::print("{:>4} {:>7} {:>9.0f} {:>8.1f} {:>7.0e} {:>8} {:>9} {:>7} {:>9.3f} {:>11.5f}\n",
                   n, model.DynamicBodies(), ns, ns / model.DynamicBodies(), rtol,
                   tracks.report.steps, tracks.report.evaluations, tracks.report.events.size(), cpu,
                   1e3 * WorstMarkError(tracks, reference));
      }
    }
  } catch (const unfurl::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
