// Whether tolerances mean what they say: over scenes with a known answer, the largest error of a
// mark relative to the range of its motion, at named times, over the tolerance asked; and what each
// method takes for it. Answers: closed forms; where there is none, the mean of two runs by
// different methods at 1e-12, whose difference is printed beside.
//   tolerance_bench [rtol ...]       (default 1e-4 1e-6 1e-8 1e-10)
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace {

using unfurl::data::Scene;
using unfurl::sim::MarkTracks;
using unfurl::sim::Method;
using unfurl::sim::SimulateOptions;

struct Case {
  std::string name, path;
  double duration;  // [s]
  std::function<void(Scene*)> change;
};

std::vector<Case> Cases() {
  const std::string sets = std::string(UNFURL_SOURCE_DIR) + "/data/sets/";
  const auto nothing = [](Scene*) {};
  const auto segments = [](int n, double damping) {
    return [=](Scene* scene) {
      for (auto& beam : scene->beams) {
        beam.segments = n;
        beam.damping = damping;
      }
    };
  };
  return {
      {"double pendulum, 1 s", sets + "double_pendulum/scene.toml", 1.0, nothing},
      {"four-bar chain N = 2, 0.7 s", sets + "four_bar_chain/scene_2.toml", 0.7, nothing},
      {"deployment n = 4, before a latch, 0.6 s", sets + "deployment/scene_suspension.toml", 0.6,
       segments(4, 5e-5)},
      {"deployment n = 4, 1.3 s", sets + "deployment/scene_suspension.toml", 1.3,
       segments(4, 5e-5)},
      {"bouncing latch, 1 s", sets + "bouncing_latch/scene.toml", 1.0, nothing},
  };
}

struct Run {
  Method method;
  int order;
  const char* name;
};
constexpr Run kRuns[] = {{Method::kProjected, 4, "projected 4(3)"},
                         {Method::kProjected, 5, "projected 5(4)"},
                         {Method::kProjected, 8, "projected 8(5,3)"},
                         {Method::kPartitioned, 0, "partitioned"}};

// Largest distance of a mark at any sample over the range of that mark.
double RelativeError(const MarkTracks& a, const MarkTracks& b) {
  double worst = 0.0;
  for (std::size_t m = 0; m < a.x.size(); ++m) {
    double far = 0.0, range = 0.0;
    for (std::size_t i = 0; i < std::min(a.t.size(), b.t.size()); ++i) {
      far = std::max(far, std::hypot(a.x[m][i] - b.x[m][i], a.y[m][i] - b.y[m][i]));
      range = std::max(range, std::hypot(b.x[m][i] - b.x[m][0], b.y[m][i] - b.y[m][0]));
    }
    if (range > 0.0) worst = std::max(worst, far / range);
  }
  return worst;
}

void RunCase(const Case& c, const std::vector<double>& tolerances) {
  Scene scene = unfurl::data::ReadScene(c.path);
  c.change(&scene);
  const unfurl::sim::Model model = unfurl::sim::Compile(scene);
  SimulateOptions options;
  options.duration = c.duration;
  options.rate = 20.0;  // the named times: every 0.05 s
  options.rtol = 1e-12;
  options.order = 8;
  const MarkTracks reference = unfurl::sim::SimulateMarks(model, options);
  options.method = Method::kPartitioned;
  const MarkTracks second = unfurl::sim::SimulateMarks(model, options);
  fmt::print("\n{}; the two references differ by {:.1e}\n", c.name,
             RelativeError(second, reference));
  fmt::print("{:>8}  {:<18}{:>12}{:>12}{:>10}{:>12}\n", "rtol", "method", "error", "over rtol",
             "evals", "cpu [ms]");
  for (const double rtol : tolerances) {
    for (const Run& run : kRuns) {
      options.rtol = rtol;
      options.method = run.method;
      options.order = run.order;
      const std::clock_t begin = std::clock();
      const MarkTracks tracks = unfurl::sim::SimulateMarks(model, options);
      const double cpu = 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
      const double error = RelativeError(tracks, reference);
      fmt::print("{:>8.0e}  {:<18}{:>12.1e}{:>12.2f}{:>10}{:>12.2f}{}\n", rtol, run.name, error,
                 error / rtol, tracks.report.evaluations, cpu,
                 tracks.report.Usable() ? "" : "  " + tracks.report.message);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<double> tolerances;
  for (int k = 1; k < argc; ++k) tolerances.push_back(std::stod(argv[k]));
  if (tolerances.empty()) tolerances = {1e-4, 1e-6, 1e-8, 1e-10};
  try {
    for (const Case& c : Cases()) RunCase(c, tolerances);
  } catch (const unfurl::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
