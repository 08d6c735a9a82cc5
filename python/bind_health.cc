#include <fmt/format.h>

#include "data/trial_health.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using data::TrialHealth;

// One row of TrialHealth's lists.
struct Fault {
  std::string words, kind, camera;
  bool certain = false;
  double earliest = 0.0, latest = 0.0, size = 0.0, sigma = 0.0, slope = 0.0, slope_sigma = 0.0,
         at = 0.0;
};

std::vector<Fault> FaultsOf(const TrialHealth& health) {
  constexpr const char* kKinds[] = {"moved", "drifting", "late"};
  std::vector<Fault> out;
  for (std::size_t k = 0; k < health.words.size(); ++k) {
    out.push_back({health.words[k], kKinds[health.kind[k]],
                   health.cameras[static_cast<std::size_t>(health.camera[k])],
                   health.certain[k] != 0, health.from[k], health.to[k], health.size[k],
                   health.sigma[k], health.slope[k], health.slope_sigma[k], health.at[k]});
  }
  return out;
}

}  // namespace

void BindHealth(py::module_& m) {
  py::class_<Fault>(m, "Fault", "A camera that moved, drifts or is late.")
      .def_readonly("words", &Fault::words, "What is wrong, in words.")
      .def_readonly("kind", &Fault::kind, "'moved', 'drifting' or 'late'.")
      .def_readonly("camera", &Fault::camera, "Its name.")
      .def_readonly("certain", &Fault::certain, "False: it may be another camera.")
      .def_readonly("earliest", &Fault::earliest,
                    "It began between this [s] and latest; -inf: before the record.")
      .def_readonly("latest", &Fault::latest, "See earliest [s].")
      .def_readonly("size", &Fault::size, "Offset [px] of a move or a drift, or lag [lines].")
      .def_readonly("sigma", &Fault::sigma, "Its standard deviation.")
      .def_readonly("slope", &Fault::slope, "Of a drift [px/s].")
      .def_readonly("slope_sigma", &Fault::slope_sigma, "Its standard deviation [px/s].")
      .def_readonly("at", &Fault::at, "When a drift has its size [s].")
      .def("__repr__", [](const Fault& fault) { return "<Fault " + fault.words + ">"; });
  const auto array = [](Eigen::MatrixXd TrialHealth::*member) {
    return [member](const py::object& self) {
      return MatrixView(self.cast<const TrialHealth&>().*member, self);
    };
  };
  py::class_<TrialHealth, std::shared_ptr<TrialHealth>>(
      m, "Health", "What a trial says of its c cameras, in n slices of time.")
      .def_readonly("unknown", &TrialHealth::unknown,
                    "Why nothing can be told; empty: it was looked at.")
      .def_readonly("cameras", &TrialHealth::cameras, "Names (c).")
      .def_property_readonly("faults", &FaultsOf, "In the order in which they were found.")
      .def_property_readonly(
          "t", [](const py::object& self) { return View(self.cast<const TrialHealth&>().t, self); },
          "Middles of the slices [s], shape (n,).")
      .def_property_readonly("offset", array(&TrialHealth::offset_px),
                             "Readings less what the other cameras predict [px], shape (n, c).")
      .def_property_readonly("sigma", array(&TrialHealth::sigma_px),
                             "Standard deviation of offset by its scatter [px], shape (n, c).")
      .def_property_readonly("gain", array(&TrialHealth::gain),
                             "Brightness of spots over the trial's median, shape (n, c).")
      .def_property_readonly("width", array(&TrialHealth::width_px),
                             "Width (sigma) of spots [px], shape (n, c).")
      .def("__repr__", [](const TrialHealth& health) {
        return fmt::format("<Health of {} cameras, {} faults>", health.cameras.size(),
                           health.words.size());
      });
}

}  // namespace unfurl::python
