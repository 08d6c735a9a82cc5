#include <fmt/format.h>

#include "base/error.h"
#include "python/bindings.h"
#include "python/scene_object.h"
#include "study/scene_cost.h"

namespace unfurl::python {
namespace {

using correlate::CostPoint;
using study::SceneCost;

SceneCost Cost(const py::object& scene_or_path, const py::object& set,
               const std::vector<std::string>& methods, const std::vector<double>& tolerances,
               const std::vector<int>& segments, double duration, const py::object& progress) {
  study::SceneCostOptions options;
  options.methods = methods;
  options.tolerances = tolerances;
  options.segments = segments;
  options.duration = duration;
  options.Check();
  const auto scene = SceneFrom(scene_or_path, set);
  CallbackError errors;
  const auto done = ProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    return study::StudySceneCost(scene->scene, options,
                                 [&](double part, const std::string&) { done(part); });
  });
}

// Of a setting that gave a result.
std::optional<double> Usable(const CostPoint& point, double value) {
  return point.usable ? std::optional(value) : std::nullopt;
}

}  // namespace

void BindCost(py::module_& m) {
  py::class_<CostPoint>(m, "CostPoint", "What one setting of the simulator takes, and gives.")
      .def_property_readonly(
          "method", [](const CostPoint& p) { return p.setting.method; }, "As simulate takes it.")
      .def_property_readonly(
          "rtol", [](const CostPoint& p) { return p.setting.tolerance; },
          "Error allowed per step [-].")
      .def_property_readonly(
          "segments",
          [](const CostPoint& p) {
            return p.setting.mesh > 0 ? std::optional(p.setting.mesh) : std::nullopt;
          },
          "Of every beam; None: the scene's.")
      .def_readonly("usable", &CostPoint::usable, "Whether the run came to its end.")
      .def_readonly("message", &CostPoint::message, "Why not.")
      .def_property_readonly(
          "seconds", [](const CostPoint& p) { return Usable(p, p.seconds); },
          "Of computing [s]; None: not usable.")
      .def_property_readonly(
          "rms", [](const CostPoint& p) { return Usable(p, p.rms); },
          "RMS distance of the worst mark from the finest run, over its range of motion [-].")
      .def_property_readonly(
          "largest", [](const CostPoint& p) { return Usable(p, p.largest); },
          "The largest distance in time, likewise [-].")
      .def_readonly("on_front", &CostPoint::on_front, "No other is both faster and nearer.")
      .def("__repr__", [](const CostPoint& p) {
        return p.usable ? fmt::format("<unfurl.CostPoint: {}, {:.3g} s, error {:.2g}>",
                                      p.setting.Name(), p.seconds, p.rms)
                        : fmt::format("<unfurl.CostPoint: {}, {}>", p.setting.Name(), p.message);
      });
  py::class_<SceneCost>(m, "Cost", "What accuracy of a scene costs in time.")
      .def_property_readonly(
          "points",
          [](const py::object& self) {
            return PartsOf(self, self.cast<SceneCost&>().study.points);
          },
          "List of CostPoint, in the order of the settings.")
      .def_property_readonly(
          "advice", [](const SceneCost& c) { return correlate::CostAdvice(c.study); },
          "The cheapest setting for each accuracy, a sentence each.")
      .def_property_readonly(
          "reference", [](const SceneCost& c) { return c.study.reference.Name(); },
          "The finest run, that the others are compared with.")
      .def_property_readonly(
          "floor",
          [](const SceneCost& c) {
            return c.study.floor >= 0.0 ? std::optional(c.study.floor) : std::nullopt;
          },
          "How far a second finest run is from it, as rms [-]; None: there was none.")
      .def_readonly("duration", &SceneCost::duration, "That was simulated [s].")
      .def_property_readonly("usable", &SceneCost::Usable,
                             "Whether a setting gave a result at all.")
      .def("__repr__", [](const SceneCost& c) {
        return fmt::format("<unfurl.Cost: {} over {:g} s>",
                           Plural(c.study.points.size(), "setting"), c.duration);
      });
  const study::SceneCostOptions defaults;
  m.def(
      "cost", &Cost, py::arg("scene"), py::kw_only(), py::arg("set") = py::none(),
      py::arg("methods") = defaults.methods, py::arg("rtol") = defaults.tolerances,
      py::arg("segments") = defaults.segments, py::arg("duration") = defaults.duration,
      py::arg("progress") = py::none(),
      "What accuracy costs in time on a scene (a Scene or a path).\n\n"
      "Every combination of methods, rtol and segments (of every beam; []: the scene's) is run "
      "and\n"
      "compared with a run that is finer than the finest. The first method makes that, the second\n"
      "checks it. duration: to simulate [s]; 0: the scene's. progress(done) is called with the\n"
      "share that is done.");
}

}  // namespace unfurl::python
