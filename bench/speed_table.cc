// What the simulator reaches on the scenes that it is held to: for each accuracy asked, the
// cheapest of the settings tried that reaches it, and its time; then the right-hand side by body,
// what a large model costs, and what the longitudinal constraint costs against stretching beams.
//   speed_table [repeats]                                  (default 9)
// Times are the median of the process's CPU time, one thread, of the run alone; errors are against
// another formulation (slider-crank), else this program's own finest run, whose distance from that
// of a second method is printed beside.
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/error.h"
#include "beam_scenes.h"
#include "data/scene.h"
#include "modal_slider_crank.h"
#include "sim/dynamics/dynamics.h"
#include "sim/dynamics/flush_denormals.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace {

using unfurl::bench::BeamChoice;
using unfurl::data::BeamModel;
using unfurl::data::Scene;
using unfurl::sim::EventKind;
using unfurl::sim::Method;
using unfurl::sim::Model;
using unfurl::sim::SimulateOptions;
using unfurl::sim::SimulateReport;

int repeats = 9;

struct Recorder : unfurl::sim::Observer {
  Recorder(const Model& model, const std::vector<std::string>& wanted) : rows(model, wanted) {
    for (const auto& q : rows.quantities()) columns[q.name];
  }
  void OnSample(double t, double* y, const std::vector<unfurl::sim::LatchMode>& modes) override {
    const std::vector<double>& row = rows.Row(t, y, modes);
    for (std::size_t k = 0; k < row.size(); ++k)
      columns[rows.quantities()[k].name].push_back(row[k]);
  }
  unfurl::sim::Observables rows;
  std::map<std::string, std::vector<double>> columns;
};

using Columns = std::map<std::string, std::vector<double>>;

// A way to run a scene.
struct Setting {
  std::string name;
  Scene scene;
  Method method = Method::kProjected;
  int order = 0;
  double rtol = 1e-6;
};

struct Outcome {
  std::vector<double> curve;
  std::vector<double> latches;  // their times [s]
  SimulateReport report;
  double ms = 0.0;
};

struct Question {
  std::string name;
  double rate = 1000.0;             // samples per second
  std::vector<std::string> wanted;  // columns
  std::function<std::vector<double>(const Columns&)> curve;
  // Error of a curve against the reference's, in `unit`.
  std::function<double(const std::vector<double>&, const std::vector<double>&)> error;
  std::string unit;
};

SimulateOptions OptionsOf(const Question& q, const Setting& s) {
  SimulateOptions options;
  options.rate = q.rate;
  options.method = s.method;
  options.order = s.order;
  options.rtol = s.rtol;
  return options;
}

double Milliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

Outcome Run(const Question& q, const Setting& s, bool timed) {
  const Model model = unfurl::sim::Compile(s.scene);
  const SimulateOptions options = OptionsOf(q, s);
  Outcome out;
  Recorder recorder(model, q.wanted);
  out.report = Simulate(model, options, &recorder);
  out.curve = q.curve(recorder.columns);
  for (const auto& event : out.report.events) {
    if (event.kind == EventKind::kLatch) out.latches.push_back(event.t);
  }
  std::vector<double> took;
  for (int k = 0; timed && k < repeats; ++k) {
    unfurl::sim::Observer nobody;
    const double begin = Milliseconds();
    Simulate(model, options, &nobody);
    took.push_back(Milliseconds() - begin);
  }
  if (timed) {
    std::nth_element(took.begin(), took.begin() + took.size() / 2, took.end());
    out.ms = took[took.size() / 2];
  }
  return out;
}

bool SameLatches(const Outcome& a, const Outcome& b) {
  constexpr double kLatchTime = 1e-3;  // [s], one sample
  if (a.latches.size() != b.latches.size()) return false;
  for (std::size_t k = 0; k < a.latches.size(); ++k) {
    if (std::fabs(a.latches[k] - b.latches[k]) > kLatchTime) return false;
  }
  return true;
}

struct Goal {
  double error;     // in the question's unit
  double ms;        // asked
  double rival_ms;  // 0: none
};

void AnswerBy(const Question& q, const Outcome& reference, const std::string& name,
              const Setting& second, const std::vector<Setting>& tried,
              const std::vector<Goal>& goals) {
  const Outcome other = Run(q, second, false);
  fmt::print("\n{}: reference {}; {} is {:.2g} {} from it\n", q.name, name, second.name,
             q.error(other.curve, reference.curve), q.unit);
  struct Tried {
    std::string name;
    double error, ms;
    long evaluations;
    bool right;
  };
  std::vector<Tried> all;
  for (const Setting& s : tried) {
    const Outcome out = Run(q, s, true);
    const bool right = out.report.Usable() && SameLatches(out, reference);
    all.push_back(
        {s.name, q.error(out.curve, reference.curve), out.ms, out.report.evaluations, right});
    fmt::print("  {:<34}{:>11.2e} {}{:>10} evaluations{:>10.3f} ms{}\n", s.name, all.back().error,
               q.unit, out.report.evaluations, out.ms, right ? "" : "  (latches differ)");
  }
  for (const Goal& goal : goals) {
    const Tried* best = nullptr;
    for (const Tried& t : all) {
      if (t.right && t.error <= goal.error && (best == nullptr || t.ms < best->ms)) best = &t;
    }
    fmt::print("within {:g} {} (asked {:g} ms{}): ", goal.error, q.unit, goal.ms,
               goal.rival_ms > 0.0 ? fmt::format(", rival {:g} ms", goal.rival_ms) : "");
    if (best == nullptr) {
      fmt::print("none of these\n");
    } else {
      fmt::print("{:.2f} ms, {} ({:.2g} {})\n", best->ms, best->name, best->error, q.unit);
    }
  }
}

void Answer(const Question& q, const Setting& finest, const Setting& second,
            const std::vector<Setting>& tried, const std::vector<Goal>& goals) {
  AnswerBy(q, Run(q, finest, false), finest.name, second, tried, goals);
}

double RootMeanSquare(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

double Largest(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::fabs(a[i] - b[i]));
  return worst;
}

using Make = Scene (*)(const BeamChoice&);

Setting BeamSetting(Make make, const BeamChoice& choice, int order, double rtol) {
  return {fmt::format("{}, order {}, {:.0e}", choice.Name(), order, rtol), make(choice),
          Method::kProjected, order, rtol};
}

std::vector<Setting> BeamSettings(Make make, const std::vector<int>& modes) {
  std::vector<Setting> settings;
  for (const int p : modes) {
    for (const auto& [order, rtol] :
         {std::pair{4, 1e-2}, {4, 1e-3}, {4, 3e-4}, {4, 1e-4}, {5, 1e-4}, {8, 1e-5}}) {
      settings.push_back(BeamSetting(make, {BeamModel::kKirchhoff, p}, order, rtol));
    }
  }
  for (const int n : {9, 17}) {
    settings.push_back(BeamSetting(make, {BeamModel::kSegments, n}, 4, 1e-3));
  }
  return settings;
}

void SliderCrankRow() {
  Question q;
  q.name = "slider-crank, two revolutions, deflection of the rod's middle";
  q.rate = 2000.0;
  q.wanted = {"start.?", "middle.?", "end.?"};
  q.unit = "% of its peak (RMS)";
  q.curve = [](const Columns& c) {
    std::vector<double> beta;
    for (std::size_t i = 0; i < c.at("start.x").size(); ++i) {
      const double x = c.at("start.x")[i], y = c.at("start.y")[i];
      const double dx = c.at("end.x")[i] - x, dy = c.at("end.y")[i] - y;
      const double mx = c.at("middle.x")[i] - x, my = c.at("middle.y")[i] - y;
      beta.push_back((dx * my - dy * mx) / std::hypot(dx, dy) / unfurl::bench::kRod);
    }
    return beta;
  };
  q.error = [](const auto& a, const auto& b) {
    double peak = 0.0;
    for (const double v : b) peak = std::max(peak, std::fabs(v));
    return 100.0 * RootMeanSquare(a, b) / peak;
  };
  const Make make = unfurl::bench::SliderCrank;
  Outcome modal;
  modal.curve = unfurl::bench::ModalSliderCrank(q.rate);
  AnswerBy(q, modal, "the rod in nine modes of its angle",
           BeamSetting(make, {BeamModel::kSegments, 49}, 8, 1e-8), BeamSettings(make, {1, 2, 3}),
           {{0.75, 1.0, 9.7}, {0.06, 5.0, 42.0}});
}

void TwoBeamsRow() {
  Question q;
  q.name = "two beams in series, 1 s, path of the tip";
  q.rate = 200.0;
  q.wanted = {"tip.?"};
  q.unit = "mm (RMS)";
  q.curve = [](const Columns& c) {
    std::vector<double> path = c.at("tip.x");
    path.insert(path.end(), c.at("tip.y").begin(), c.at("tip.y").end());
    return path;
  };
  // Both coordinates stand in one vector: the distance's mean square is twice that of the entries.
  q.error = [](const auto& a, const auto& b) {
    return 1e3 * std::sqrt(2.0) * RootMeanSquare(a, b);
  };
  const Make make = unfurl::bench::TwoBeams;
  Answer(q, BeamSetting(make, {BeamModel::kKirchhoff, 9}, 8, 1e-9),
         BeamSetting(make, {BeamModel::kSegments, 40}, 8, 1e-7),
         BeamSettings(make, {1, 2, 3, 4, 5}), {{0.28, 20.0, 138.0}, {0.03, 85.0, 610.0}});
}

void AndrewsRow(const std::string& sets) {
  const std::vector<std::string> names = {"beta",  "Theta", "gamma",  "Phi",
                                          "delta", "Omega", "epsilon"};
  Question q;
  q.name = "Andrews' mechanism at 0.03 s";
  q.rate = 100.0;
  for (const auto& name : names) q.wanted.push_back(name + ".theta");
  q.unit = "(largest relative error)";
  q.curve = [=](const Columns& c) {
    std::vector<double> last;
    for (const auto& name : names) last.push_back(c.at(name + ".theta").back());
    return last;
  };
  q.error = [](const auto& a, const auto& b) {
    double worst = 0.0;
    for (std::size_t k = 0; k < a.size(); ++k)
      worst = std::max(worst, std::fabs(a[k] / b[k] - 1.0));
    return worst;
  };
  const Scene scene = unfurl::data::ReadScene(sets + "andrews/scene.toml");
  std::vector<Setting> tried;
  for (const auto& [order, rtol] :
       {std::pair{4, 1e-3}, {5, 1e-4}, {5, 1e-5}, {5, 1e-6}, {8, 1e-7}}) {
    tried.push_back(
        {fmt::format("order {}, {:.0e}", order, rtol), scene, Method::kProjected, order, rtol});
  }
  Answer(q, {"projected, order 8, 1e-12", scene, Method::kProjected, 8, 1e-12},
         {"partitioned, 1e-12", scene, Method::kPartitioned, 0, 1e-12}, tried,
         {{1.8e-4, 6.2, 31.0}, {3e-6, 49.2, 246.0}});
}

void DeploymentRow(const std::string& sets) {
  Question q;
  q.name = "the deployment, n = 8, clearance, 5 s, hub's angle";
  q.wanted = {"hub.theta"};
  q.unit = "% of its range (largest)";
  q.curve = [](const Columns& c) { return c.at("hub.theta"); };
  q.error = [](const auto& a, const auto& b) {
    const auto [low, high] = std::minmax_element(b.begin(), b.end());
    return 100.0 * Largest(a, b) / (*high - *low);
  };
  const Scene scene = unfurl::data::ReadScene(sets + "deployment/scene_clearance_8.toml");
  std::vector<Setting> tried;
  for (const auto& [order, rtol] :
       {std::pair{4, 1e-2}, {4, 1e-3}, {4, 3e-4}, {5, 1e-4}, {5, 3e-5}, {5, 1e-5}}) {
    tried.push_back(
        {fmt::format("order {}, {:.0e}", order, rtol), scene, Method::kProjected, order, rtol});
  }
  Answer(q, {"projected, order 8, 1e-10", scene, Method::kProjected, 8, 1e-10},
         {"partitioned, 1e-8", scene, Method::kPartitioned, 0, 1e-8}, tried,
         {{1.0, 50.0, 0.0}, {0.01, 300.0, 0.0}});
}

// Nanoseconds of one right-hand side by body, at a state where everything is bent.
double RightSide(const Model& model, int calls) {
  unfurl::sim::Dynamics dynamics(model);
  dynamics.track_energy = false;
  std::vector<double> y = model.initial_state, rate(y.size());
  for (std::size_t i = 0; i < y.size(); ++i) y[i] += 1e-6 * std::sin(1.7 * static_cast<double>(i));
  const unfurl::sim::FlushDenormals flush;
  double best = 1e300;
  for (int r = 0; r < repeats; ++r) {
    const double begin = Milliseconds();
    for (int k = 0; k < calls; ++k) dynamics.RightSide(0.0, y.data(), rate.data());
    best = std::min(best, (Milliseconds() - begin) / calls * 1e6);
  }
  return best / model.DynamicBodies();
}

void BodyRows(const std::string& sets) {
  Scene scene = unfurl::data::ReadScene(sets + "deployment/scene_clearance_8.toml");
  const Model deployment = unfurl::sim::Compile(scene);
  fmt::print("\none right-hand side, {} bodies: {:.1f} ns a body (asked 40)\n",
             deployment.DynamicBodies(), RightSide(deployment, 20000));
  constexpr int kSegments = 100'000;
  const Scene large = unfurl::data::ParseScene(
      fmt::format("[scene]\nname = \"large\"\nduration = 1\n[beam.b]\nlength = 1\nmass = 1\nEI = "
                  "1\nsegments = {}\n",
                  kSegments),
      "large");
  const auto in_use = [] {
    const struct mallinfo2 m = ::mallinfo2();
    return static_cast<double>(m.uordblks + m.hblkhd);
  };
  const double before = in_use(), begin = Milliseconds();
  const Model model = unfurl::sim::Compile(large);
  const double took = Milliseconds() - begin;
  fmt::print(
      "{} segments: compiled in {:.0f} ms (asked 1000), the model holds {:.2f} kB a segment\n",
      kSegments, took, (in_use() - before) / kSegments / 1024.0);
  fmt::print("one right-hand side there: {:.1f} ns a body (asked 60)\n", RightSide(model, 20));
}

// The paper's claim of 20%: an explicit run with the longitudinal constraint against stretching
// beams, to the same tolerance.
void AxialRow(const std::string& sets) {
  fmt::print("\nslider-crank, n = 3, longitudinal constraint against stretching beams\n");
  for (const double rtol : {1e-4, 1e-6}) {
    double ms[2];
    long evaluations[2];
    for (int k = 0; k < 2; ++k) {
      Question q;
      q.wanted = {"*"};
      q.curve = [](const Columns&) { return std::vector<double>(); };
      const Setting s{
          "",
          unfurl::data::ReadScene(sets + "slider_crank/scene.toml",
                                  {"beam.rod.segments=3", k == 0 ? "beam.rod.axial=\"rigid\""
                                                                 : "beam.rod.axial=\"elastic\""}),
          Method::kProjected, 5, rtol};
      const Outcome out = Run(q, s, true);
      ms[k] = out.ms;
      evaluations[k] = out.report.evaluations;
    }
    fmt::print(
        "  rtol {:.0e}: rigid {} evaluations, {:.3f} ms; elastic {} evaluations, {:.3f} ms\n", rtol,
        evaluations[0], ms[0], evaluations[1], ms[1]);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1) repeats = std::max(1, std::atoi(argv[1]));
  const std::string sets = std::string(UNFURL_SOURCE_DIR) + "/data/sets/";
  try {
    SliderCrankRow();
    TwoBeamsRow();
    AndrewsRow(sets);
    DeploymentRow(sets);
    BodyRows(sets);
    AxialRow(sets);
  } catch (const unfurl::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
