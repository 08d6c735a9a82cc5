#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "python/bindings.h"
#include "python/scene_object.h"
#include "study/scene_cost.h"

namespace unfurl::python {
namespace {

using study::CostLine;
using study::CostPoint;
using study::SceneCost;

SceneCost Cost(const py::object& scene_or_path, const py::object& set,
               const std::vector<std::string>& quantity, const std::vector<std::string>& methods,
               const std::vector<double>& tolerances, const std::vector<int>& segments,
               const std::vector<int>& orders, double duration, std::optional<double> within,
               std::size_t workers, const py::object& progress) {
  study::SceneCostOptions options;
  options.quantities = quantity;
  options.methods = methods;
  options.tolerances = tolerances;
  options.segments = segments;
  options.orders = orders;
  options.duration = duration;
  options.within = within.value_or(std::numeric_limits<double>::infinity());
  options.workers = workers;
  options.Check();
  const auto scene = SceneFrom(scene_or_path, set);
  CallbackError errors;
  const auto done = StepProgressOf(progress, &errors);
  return LongWithCallbacks(errors,
                           [&] { return study::StudySceneCost(scene->scene, options, done); });
}

// Of a setting that gave a result.
std::optional<double> Usable(const CostPoint& point, double value) {
  return point.usable ? std::optional(value) : std::nullopt;
}

std::optional<double> Judged(const CostPoint& point, double value) {
  return point.worst >= 0 && std::isfinite(value) ? Usable(point, value) : std::nullopt;
}

// By line, None where nothing can be said.
py::dict ErrorsOf(const SceneCost& cost, const CostPoint& point) {
  py::dict out;
  for (std::size_t l = 0; l < point.errors.size(); ++l) {
    const double rms = point.errors[l].rms;
    const bool known = cost.lines[l].settled && std::isfinite(rms);
    out[py::str(cost.lines[l].quantity.name)] =
        known ? py::object(py::float_(rms)) : py::object(py::none());
  }
  return out;
}

std::optional<int> Some(int value) { return value > 0 ? std::optional(value) : std::nullopt; }

}  // namespace

void BindCost(py::module_& m) {
  py::class_<CostLine>(m, "CostLine", "A quantity that settings are judged by.")
      .def_property_readonly(
          "name", [](const CostLine& l) { return l.quantity.name; }, "Such as joint1.theta.")
      .def_property_readonly(
          "unit", [](const CostLine& l) { return l.quantity.unit; }, "Of its scale.")
      .def_readonly("scale", &CostLine::scale, "What its errors are parts of [unit].")
      .def_readonly("settled", &CostLine::settled, "Whether finer meshes come to an end.")
      .def_property_readonly(
          "reference_error",
          [](const CostLine& l) {
            return l.settled ? std::optional(l.reference_error) : std::nullopt;
          },
          "Of what runs are compared with, rms [-]; None: not known.")
      .def("__repr__",
           [](const CostLine& l) { return fmt::format("<unfurl.CostLine: {}>", l.quantity.name); });
  py::class_<CostPoint>(m, "CostPoint", "What one setting of the simulator takes, and gives.")
      .def_property_readonly(
          "method", [](const CostPoint& p) { return p.setting.method; }, "As simulate takes it.")
      .def_property_readonly(
          "rtol", [](const CostPoint& p) { return p.setting.tolerance; },
          "Error allowed per step [-].")
      .def_property_readonly(
          "beams", [](const CostPoint& p) { return p.setting.beams; }, "Model and mesh, in words.")
      .def_property_readonly(
          "segments", [](const CostPoint& p) { return Some(p.setting.segments); },
          "Of every beam alike; None: they differ, or are smooth.")
      .def_property_readonly(
          "order", [](const CostPoint& p) { return Some(p.setting.order); },
          "Of every smooth beam alike, or None.")
      .def_property_readonly(
          "set", [](const CostPoint& p) { return p.setting.set; },
          "Overrides of the scene that make this setting, as simulate(set=) takes them.")
      .def_readonly("usable", &CostPoint::usable, "Whether the run came to its end.")
      .def_readonly("message", &CostPoint::message, "Why not.")
      .def_property_readonly(
          "seconds", [](const CostPoint& p) { return Usable(p, p.seconds); },
          "Of CPU, the median of its runs [s]; None: not usable.")
      .def_property_readonly(
          "scatter", [](const CostPoint& p) { return Usable(p, p.scatter); },
          "Standard error of seconds; 0 of a single run [s].")
      .def_property_readonly(
          "rms", [](const CostPoint& p) { return Judged(p, p.rms); },
          "Error of the worst line over the run, that of the reference added, over its scale [-].")
      .def_property_readonly(
          "largest", [](const CostPoint& p) { return Judged(p, p.largest); },
          "The largest error in time of any line, likewise [-].")
      .def_readonly("on_front", &CostPoint::on_front, "No other is both faster and nearer.")
      .def("__repr__", [](const CostPoint& p) {
        return p.usable ? fmt::format("<unfurl.CostPoint: {}, {:.3g} s, error {:.2g}>",
                                      p.setting.Name(), p.seconds, p.rms)
                        : fmt::format("<unfurl.CostPoint: {}, {}>", p.setting.Name(), p.message);
      });
  py::class_<SceneCost>(m, "Cost", "What accuracy of a scene costs.")
      .def_property_readonly(
          "points",
          [](const py::object& self) { return PartsOf(self, self.cast<SceneCost&>().points); },
          "List of CostPoint, mesh by mesh, method by method.")
      .def_property_readonly(
          "lines",
          [](const py::object& self) { return PartsOf(self, self.cast<SceneCost&>().lines); },
          "List of CostLine.")
      .def("errors", &ErrorsOf, py::arg("point"),
           "Root-mean-square errors of a point by line, over its scale [-].")
      .def(
          "cheapest",
          [](const py::object& self, double error, const std::optional<std::string>& line) {
            const auto& cost = self.cast<SceneCost&>();
            int at = -1;
            std::vector<std::string> known;
            for (std::size_t l = 0; line && l < cost.lines.size(); ++l) {
              known.push_back(cost.lines[l].quantity.name);
              if (known.back() == *line) at = static_cast<int>(l);
            }
            if (line && at < 0) RefuseName("line", *line, known);
            const CostPoint* best = study::Cheapest(cost, error, at);
            return best == nullptr
                       ? py::object(py::none())
                       : py::cast(best, py::return_value_policy::reference_internal, self);
          },
          py::arg("error"), py::arg("line") = py::none(),
          "The cheapest CostPoint whose error is this at most [-], in a line or in all; or None.")
      .def_property_readonly("advice", &study::CostAdvice,
                             "The cheapest setting for each accuracy, a sentence each.")
      .def_readonly("reference", &SceneCost::reference, "What runs are compared with, in words.")
      .def_readonly("left_out", &SceneCost::left_out, "Settings that the budget left no time for.")
      .def_readonly("absent", &SceneCost::absent, "Quantities without a line, and why.")
      .def_readonly("refused", &SceneCost::refused, "Why some settings have no run.")
      .def_readonly("seconds", &SceneCost::seconds, "Of CPU, all runs [s].")
      .def_readonly("duration", &SceneCost::duration, "That was simulated [s].")
      .def_property_readonly("usable", &SceneCost::Usable,
                             "Whether something can be said of a setting.")
      .def("__repr__", [](const SceneCost& c) {
        return fmt::format("<unfurl.Cost: {} over {:g} s>", Plural(c.points.size(), "setting"),
                           c.duration);
      });
  const study::SceneCostOptions defaults;
  m.def(
      "cost", &Cost, py::arg("scene"), py::kw_only(), py::arg("set") = py::none(),
      py::arg("quantity") = defaults.quantities, py::arg("methods") = defaults.methods,
      py::arg("rtol") = defaults.tolerances, py::arg("segments") = defaults.segments,
      py::arg("order") = defaults.orders, py::arg("duration") = defaults.duration,
      py::arg("within") = py::none(), py::arg("workers") = 0, py::arg("progress") = py::none(),
      "What accuracy costs on a scene (a Scene or a path).\n\n"
      "quantity: what is judged, by name, * and ? standing for letters; [] is marks, joints,\n"
      "latch and event times, peak loads. Every combination of methods, rtol and beams (segments,\n"
      "or smooth beams of an order; both []: of the scene's, fewer and more) is run and compared\n"
      "with the limit of ever finer meshes. rtol []: 1e-2 to 1e-6, until the mesh is what is\n"
      "left. duration: to simulate [s]; 0: the scene's. within: CPU that all may take [s].\n"
      "progress(done) is called with the share that is done.");
}

}  // namespace unfurl::python
