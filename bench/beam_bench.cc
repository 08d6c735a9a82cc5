// The two beam models against each other: time to an accuracy, on two scenes with their parameters
// in beam_scenes.cc (docs/decisions/010-second-beam.md).
//   beam_bench [repeats]                                   (default 9)
//   beam_bench folds      error of each order, both folds  (docs/decisions/185-even-and-odd.md)
// Columns: model with its segments or modes, order of the method, tolerance, evaluations, median
// milliseconds of the run (thread's CPU), and the root mean square of the error against the
// reference: of the rod's middle against its chord, in % of its peak (slider-crank); of the tip, in
// mm (two beams). The reference is the smooth model of high order at a tight tolerance; how far the
// segments' finest runs, extrapolated in n^-2, are from it is printed too.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "base/error.h"
#include "beam_scenes.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"

namespace {

using unfurl::bench::BeamChoice;
using unfurl::bench::kRod;
using unfurl::bench::SliderCrank;
using unfurl::bench::TwoBeams;
using unfurl::data::BeamModel;
using unfurl::data::Scene;
using unfurl::sim::MarkTracks;

// What is compared, by sample.
std::vector<std::array<double, 2>> Curve(const MarkTracks& t) {
  std::vector<std::array<double, 2>> curve;
  for (std::size_t i = 0; i < t.t.size(); ++i) {
    if (t.x.size() == 1) {
      curve.push_back({t.x[0][i], t.y[0][i]});
      continue;
    }
    const double dx = t.x[2][i] - t.x[0][i], dy = t.y[2][i] - t.y[0][i];
    const double mx = t.x[1][i] - t.x[0][i], my = t.y[1][i] - t.y[0][i];
    curve.push_back({(dx * my - dy * mx) / std::hypot(dx, dy) / kRod, 0.0});
  }
  return curve;
}

using CurveOf = std::vector<std::array<double, 2>>;

double RootMeanSquare(const CurveOf& a, const CurveOf& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int c = 0; c < 2; ++c) sum += (a[i][c] - b[i][c]) * (a[i][c] - b[i][c]);
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

double Milliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void Table(Scene (*make)(const BeamChoice&), double rate, int repeats) {
  const bool crank = make == SliderCrank;
  int order = 0;  // of the method; 0: the program's choice
  const auto run = [&](const BeamChoice& choice, double rtol, double* ms, long* evaluations) {
    const auto model = unfurl::sim::CompileModel(make(choice));
    unfurl::sim::SimulateOptions options;
    options.rate = rate;
    options.rtol = rtol;
    options.order = order;
    std::vector<double> took;
    MarkTracks tracks;
    for (int k = 0; k < (ms != nullptr ? repeats : 1); ++k) {
      const double begin = Milliseconds();
      tracks = unfurl::sim::SimulateMarks(*model, options);
      took.push_back(Milliseconds() - begin);
    }
    std::nth_element(took.begin(), took.begin() + took.size() / 2, took.end());
    if (ms != nullptr) *ms = took[took.size() / 2];
    if (evaluations != nullptr) *evaluations = tracks.report.evaluations;
    if (!tracks.report.Usable()) fmt::print("{}: {}\n", choice.Name(), tracks.report.message);
    return Curve(tracks);
  };
  fmt::print("{}\n", make({BeamModel::kSegments, 8}).name);
  const CurveOf reference = run({BeamModel::kKirchhoff, 9}, 1e-10, nullptr, nullptr);
  double scale = 1e3;
  if (crank) {
    double peak = 0.0;
    for (const auto& v : reference) peak = std::max(peak, std::fabs(v[0]));
    fmt::print("peak of beta {:.6f}\n", peak);
    scale = 100.0 / peak;
  }
  const CurveOf less = run({BeamModel::kKirchhoff, 7}, 1e-10, nullptr, nullptr);
  fmt::print("smooth 7 against smooth 9: {:.6f}\n", scale * RootMeanSquare(less, reference));
  const CurveOf n13 = run({BeamModel::kSegments, 13}, 1e-9, nullptr, nullptr);
  CurveOf n25 = run({BeamModel::kSegments, 25}, 1e-9, nullptr, nullptr);
  const double raw = scale * RootMeanSquare(n25, reference);
  for (std::size_t i = 0; i < n25.size(); ++i) {
    for (int c = 0; c < 2; ++c) {
      n25[i][c] += (n25[i][c] - n13[i][c]) / ((25.0 * 25.0) / (13.0 * 13.0) - 1.0);
    }
  }
  fmt::print("segments 13: {:.6f}, 25: {:.6f}, extrapolated: {:.6f}\n",
             scale * RootMeanSquare(n13, reference), raw, scale * RootMeanSquare(n25, reference));
  fmt::print("{:>12} {:>6} {:>7} {:>8} {:>9} {:>11}\n", "beams", "method", "rtol", "evals", "ms",
             crank ? "error [%]" : "error [mm]");
  std::vector<BeamChoice> choices;
  for (const int p : {1, 2, 3, 4, 5}) choices.push_back({BeamModel::kKirchhoff, p});
  for (const int n : {9, 17}) choices.push_back({BeamModel::kSegments, n});
  for (const BeamChoice& choice : choices) {
    for (const int method : {4, 5, 8}) {
      for (const double rtol : {1e-3, 1e-4, 1e-5}) {
        if (choice.model == BeamModel::kSegments && rtol == 1e-3) continue;
        double ms = 0.0;
        long evaluations = 0;
        order = method;
        const CurveOf curve = run(choice, rtol, &ms, &evaluations);
        fmt::print("{:>12} {:>6} {:>7.0e} {:>8} {:>9.3f} {:>11.5f}\n", choice.Name(), method, rtol,
                   evaluations, ms, scale * RootMeanSquare(curve, reference));
      }
    }
  }
}

// Root mean square of the tip's error by order, in mm, against the highest order of the better
// parity; the two beams unfold as a zigzag and as a roll, without damping and with some.
void Folds() {
  for (const double sign : {-1.0, 1.0}) {
    for (const double damping : {0.0, 1e-5, 1e-4}) {
      const auto run = [&](int order) {
        Scene scene = TwoBeams({BeamModel::kKirchhoff, order});
        scene.joints[1].sign = sign;
        for (auto& beam : scene.beams) beam.damping = damping;
        unfurl::sim::SimulateOptions options;
        options.rate = 200.0;
        options.rtol = 1e-8;
        return Curve(unfurl::sim::SimulateMarks(scene, options));
      };
      const CurveOf reference = run(sign < 0.0 ? 11 : 10);
      fmt::print("{}, damping {:.0e} s:", sign < 0.0 ? "zigzag" : "roll", damping);
      for (int order = 1; order < 10; ++order) {
        fmt::print(" {:.4f}", 1e3 * RootMeanSquare(run(order), reference));
      }
      fmt::print("\n");
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc > 1 && std::string(argv[1]) == "folds") {
      Folds();
      return 0;
    }
    const int repeats = argc > 1 ? std::stoi(argv[1]) : 9;
    Table(SliderCrank, 2000.0, repeats);
    Table(TwoBeams, 200.0, repeats);
  } catch (const unfurl::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
