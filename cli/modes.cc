#include "sim/implicit/modes.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/table.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/implicit/equilibrium.h"
#include "sim/methods/simulate.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

constexpr char kSchema[] = "unfurl/modes";
constexpr int kVersion = 1;
constexpr double kMostCount = 1000;

struct Arguments {
  std::string scene, out, state = "auto";
  std::vector<std::string> sets;
  std::optional<double> at;  // [s]
  bool as_is = false;
  int count = 12;
};

// The state at the end of a run.
class LastState : public sim::Observer {
 public:
  void OnSample(double, double* state, const std::vector<sim::LatchMode>& modes) override {
    if (y.empty()) return;
    std::copy_n(state, y.size(), y.begin());
    at_end = modes;
  }
  std::vector<double> y;
  std::vector<sim::LatchMode> at_end;
};

// Where shapes are reported: bodies, then segments of beams, then marks.
struct Place {
  std::string name;
  sim::MovingPoint point;
};

std::vector<Place> PlacesOf(const sim::Model& model) {
  std::vector<Place> places;
  for (const sim::Model::Body& body : model.bodies) places.push_back({body.name, body.centre});
  for (const sim::Model::Beam& beam : model.beams) {
    for (int k = 0; k < beam.segments; ++k) {
      places.push_back({fmt::format("{}/{}", beam.name, k + 1), {beam.first + k, 0.0, 0.0}});
    }
  }
  for (const sim::Model::Mark& mark : model.marks) places.push_back({mark.name, mark.point});
  return places;
}

// Displacement of a place: x, y [m], angle [rad].
std::array<double, 3> Displacement(const sim::Model& model, const Place& place,
                                   const std::vector<double>& y, const std::vector<double>& shape) {
  const int n = model.slots.count;
  const auto of = [&](int slot, double px, double py) -> std::array<double, 3> {
    const double theta = y[model.index.theta(slot)], c = std::cos(theta), s = std::sin(theta);
    const double turn = shape[2 * n + slot];
    return {shape[slot] - turn * (s * px + c * py), shape[n + slot] + turn * (c * px - s * py),
            turn};
  };
  const sim::MovingPoint& p = place.point;
  std::array<double, 3> d = of(p.slot, p.px, p.py);
  if (p.other_slot >= 0) {  // where two segments meet: their mean
    const std::array<double, 3> other = of(p.other_slot, p.other_px, 0.0);
    for (int k = 0; k < 3; ++k) d[k] = 0.5 * (d[k] + other[k]);
  }
  return d;
}

void WriteShapes(const Arguments& arguments, data::Provenance provenance, const sim::Model& model,
                 std::vector<double> y, const sim::ModesReport& report) {
  const std::vector<Place> places = PlacesOf(model);
  std::vector<std::string> names;
  std::vector<double> frequency, damping, growth, rest, shapes;
  for (const Place& place : places) {
    const sim::PointMotion p = sim::MotionOf(model, place.point, y.data());
    names.push_back(place.name);
    rest.insert(rest.end(), {p.x, p.y, y[model.index.theta(place.point.slot)]});
  }
  for (const sim::NaturalMode& mode : report.modes) {
    frequency.push_back(mode.frequency);
    damping.push_back(mode.damping);
    growth.push_back(mode.growth);
    for (const Place& place : places) {
      const std::array<double, 3> d = Displacement(model, place, y, mode.shape);
      shapes.insert(shapes.end(), d.begin(), d.end());
    }
  }
  const std::string ending = std::filesystem::path(arguments.out).extension().string();
  if (ending == ".csv") {
    data::CsvWriter csv({{"mode", ""},
                         {"frequency", "Hz"},
                         {"place", ""},
                         {"x", "m"},
                         {"y", "m"},
                         {"dx", "m"},
                         {"dy", "m"},
                         {"dtheta", "rad"}});
    for (std::size_t m = 0; m < report.modes.size(); ++m) {
      for (std::size_t p = 0; p < places.size(); ++p) {
        const double* d = &shapes[3 * (m * places.size() + p)];
        std::vector<std::string> row = {std::to_string(m + 1), fmt::format("{}", frequency[m]),
                                        names[p]};
        for (const double v : {rest[3 * p], rest[3 * p + 1], d[0], d[1], d[2]}) {
          row.push_back(fmt::format("{}", v));
        }
        csv.Row(row);
      }
    }
    data::WriteTextFile(arguments.out, csv.text());
    return;
  }
  if (ending != ".h5") {
    throw Error(fmt::format("shapes cannot be written as '{}'", ending), arguments.out,
                "use .h5 or .csv");
  }
  data::H5Writer w(arguments.out, kSchema, kVersion, provenance);
  w.Write({"/frequency", "Hz", "undamped; 0 for an unstable motion"}, frequency);
  w.Write({"/damping", "1", "ratio, to first order"}, damping);
  w.Write({"/growth", "1/s", "of unstable motions"}, growth);
  w.Write({"/place", "1", "bodies, segments of beams, marks"}, names);
  w.Write({"/rest", "m, m, rad", "x, y, angle of each place"}, rest, {places.size(), 3});
  w.Write({"/shape", "m, m, rad", "dx, dy, dtheta by mode and place; largest displacement 1 m"},
          shapes, {report.modes.size(), places.size(), 3});
  w.Commit();
}

// The scene as the options want it: whether it has latches, and whether they are to be closed.
struct Request {
  data::Scene scene;
  bool latches = false;
  bool latched = false;
  double at = 0.0;  // [s]
};

Request ReadRequest(const Arguments& arguments) {
  if (arguments.count < 1 || arguments.count > kMostCount) {
    throw Error(fmt::format("{} modes are not a number of modes", arguments.count), "option count",
                "use 1 to 1000");
  }
  Request request;
  request.scene = data::ReadScene(arguments.scene, arguments.sets);
  for (const data::SceneJoint& joint : request.scene.joints) {
    request.latches |= joint.latch.has_value();
  }
  if (arguments.state != "auto" && arguments.state != "drawn" && arguments.state != "latched") {
    throw Error(fmt::format("there is no state \"{}\"", arguments.state), "option state",
                "use drawn or latched");
  }
  if (arguments.state == "latched" && !request.latches) {
    throw Error("the scene has no latch", "option state", "use drawn");
  }
  request.at = arguments.at.value_or(0.0);
  if (!(request.at >= 0.0) || !std::isfinite(request.at)) {
    throw Error(fmt::format("{} s is not a time of a run", request.at), "option at",
                "use 0 s or more");
  }
  request.latched = !arguments.at.has_value() && request.latches && arguments.state != "drawn";
  if (request.latched) {
    for (data::SceneJoint& joint : request.scene.joints) {
      if (joint.latch) joint.theta = -joint.latch->theta_b;
    }
  }
  return request;
}

// The state that a run reaches at time `at`, brought to rest; sets the latches of `dynamics`.
std::vector<double> StateAt(double at, const std::string& where, sim::Dynamics* dynamics) {
  const sim::Model& model = dynamics->model();
  sim::SimulateOptions options;
  options.duration = at;
  options.rate = 1.0 / at;  // a sample at the end
  LastState last;
  last.y = model.initial_state;
  const sim::SimulateReport report = sim::Simulate(model, options, &last);
  if (!report.Usable()) {
    throw Error(fmt::format("the run to {} s failed: {}", at, report.message), where,
                "take an earlier time");
  }
  dynamics->modes() = last.at_end;
  std::fill_n(last.y.begin() + model.index.vx(0), 3 * model.slots.count, 0.0);
  return last.y;
}

// Every latch's joint: its angle, and the stop that it rests on.
std::string DescribeLatches(const sim::Model& model, const std::vector<double>& y,
                            const std::vector<sim::LatchMode>& latches, ordered_json* json) {
  std::vector<std::vector<std::string>> rows = {{"joint", "theta [rad]", "contact"}};
  for (const sim::Model::Joint& joint : model.joints) {
    if (joint.latch < 0) continue;
    const sim::LatchMode& mode = latches[static_cast<std::size_t>(joint.latch)];
    const char* side = mode.upper_contact   ? "upper stop"
                       : mode.lower_contact ? "lower stop"
                                            : "none";
    const auto& hinge = joint.coordinate.hinge;
    const double theta = hinge.sign * (y[model.index.theta(hinge.outer)] -
                                       y[model.index.theta(hinge.inner)] - hinge.zero);
    (*json)["joints"].push_back({{"joint", joint.name}, {"theta", theta}, {"contact", side}});
    rows.push_back({joint.name, fmt::format("{:.7g}", theta), side});
  }
  return AlignedTable(rows);
}

// The place with the largest displacement; of equal ones the first.
const Place& MovesMost(const sim::Model& model, const std::vector<Place>& places,
                       const std::vector<double>& y, const sim::NaturalMode& mode) {
  std::size_t most = 0;
  double largest = -1.0;
  for (std::size_t p = 0; p < places.size(); ++p) {
    const std::array<double, 3> d = Displacement(model, places[p], y, mode.shape);
    const double size = std::hypot(d[0], d[1]);
    if (size > largest * (1.0 + 1e-9)) {
      largest = size;
      most = p;
    }
  }
  return places[most];
}

std::string DescribeModes(const sim::Model& model, const std::vector<double>& y,
                          const sim::ModesReport& report, ordered_json* json) {
  std::vector<std::vector<std::string>> rows = {
      {"mode", "frequency [Hz]", "damping ratio [%]", "moves most"}};
  const std::vector<Place> places = PlacesOf(model);
  (*json)["modes"] = ordered_json::array();
  for (std::size_t m = 0; m < report.modes.size(); ++m) {
    const sim::NaturalMode& mode = report.modes[m];
    const std::string& most = MovesMost(model, places, y, mode).name;
    (*json)["modes"].push_back({{"frequency", mode.frequency},
                                {"damping", mode.damping},
                                {"growth", mode.growth},
                                {"moves_most", most}});
    rows.push_back({std::to_string(m + 1),
                    mode.growth > 0.0 ? fmt::format("unstable, {:.4g} 1/s", mode.growth)
                                      : fmt::format("{:.5f}", mode.frequency),
                    fmt::format("{:.4f}", 100.0 * mode.damping), most});
  }
  return AlignedTable(rows);
}

std::string DescribeEquilibrium(const sim::EquilibriumReport& equilibrium, bool as_is) {
  if (as_is) return "linearised about that state as it is, in equilibrium or not\n";
  if (equilibrium.found) {
    return fmt::format("equilibrium found in {} iterations\n", equilibrium.iterations);
  }
  return fmt::format("NOT USABLE: no equilibrium found, {:.3g} m/s^2 left after {} iterations\n",
                     equilibrium.acceleration, equilibrium.iterations);
}

int Run(const Common& common, const Arguments& arguments) {
  const Request request = ReadRequest(arguments);
  const sim::Model model = sim::Compile(request.scene);
  if (model.kirchhoff.count() > 0) {
    throw Error("the modes of smooth beams are not known", arguments.scene,
                "use model = \"segments\" for the beams");
  }
  sim::Dynamics dynamics(model);
  std::vector<double> y = request.at > 0.0 ? StateAt(request.at, arguments.scene, &dynamics)
                                           : std::vector<double>(model.initial_state);
  sim::EquilibriumReport equilibrium;
  if (!arguments.as_is) {
    equilibrium = request.latched ? sim::FindLatchedEquilibrium(&dynamics, y.data())
                                  : sim::FindEquilibrium(&dynamics, y.data());
  }
  const sim::ModesReport report = sim::FindModes(&dynamics, y.data(), arguments.count);

  data::Provenance provenance = StartProvenance(common);
  for (const std::string& file : request.scene.files) provenance.AddInput(file);
  if (!arguments.out.empty()) WriteShapes(arguments, provenance, model, y, report);

  const bool run = arguments.at.has_value();
  const char* state = request.latched
                          ? "latched, every clearance closed on the side that the load presses"
                      : run ? "as it is at the time given, brought to rest"
                            : "as drawn";
  ordered_json json = {{"scene", arguments.scene},
                       {"state", request.latched ? "latched"
                                 : run           ? "at"
                                                 : "drawn"},
                       {"equilibrium", equilibrium.found},
                       {"rigid_motions", report.rigid}};
  if (run) json["at"] = request.at;
  std::string text = fmt::format("{}: \"{}\", {}\n", arguments.scene, request.scene.name, state);
  text += DescribeEquilibrium(equilibrium, arguments.as_is);
  if (request.latches) text += DescribeLatches(model, y, dynamics.modes(), &json);
  text += fmt::format("{} rigid motion{}\n", report.rigid, report.rigid == 1 ? "" : "s");
  text += DescribeModes(model, y, report, &json);
  if (!arguments.out.empty()) text += fmt::format("shapes -> {}\n", arguments.out);
  Finish(common, json, text);
  return arguments.as_is || equilibrium.found
             ? kExitGood
             : NotUsable(arguments.scene,
                         "no equilibrium was found; --as-is linearises at the state as it is");
}

}  // namespace

Verb AddModes(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "modes",
                          "Equilibrium, natural frequencies and shapes of a scene, latched or not",
                          "unfurl modes scene.toml --count 8 -o shapes.h5");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files.Read("SCENE", &arguments->scene, "The scene (TOML)")->required();
  files.Write("-o,--output", &arguments->out, "Where to write the shapes (.h5 or .csv)");
  files.Overrides(&arguments->sets, "Overrides a key of the scene (repeatable)");
  app->add_option(
         "--state", arguments->state,
         "drawn, or latched: every latch closed (default: latched where there are latches)")
      ->type_name("STATE");
  app->add_option("--at", arguments->at,
                  "Start from the state that a run reaches at this time [s]");
  app->add_flag("--as-is", arguments->as_is,
                "Take the state as it is, and look for no equilibrium");
  app->add_option("--count", arguments->count, "How many modes")->capture_default_str();
  verb.run = [&common, arguments] { return Run(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
