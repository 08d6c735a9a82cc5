// What many trials of one structure say together, as a Fit has it.
#include <fmt/format.h>

#include "data/fit.h"
#include "python/bindings.h"
#include "python/fit_object.h"

namespace unfurl::python {

namespace {

using FitRepeat = data::FitRecord::Repeat;
using RepeatParameter = FitRepeat::Parameter;

void BindRepeatParameter(py::module_& m) {
  py::class_<RepeatParameter>(m, "RepeatParameter",
                              "How one parameter differs from trial to trial. Its mean over trials "
                              "is the FitParameter's value.")
      .def_readonly("scatters", &RepeatParameter::scatters, "False: one value for all trials.")
      .def_readonly("logarithm", &RepeatParameter::log,
                    "Whether it is the logarithm that is normal; scatter is then of that.")
      .def_readonly("scatter", &RepeatParameter::scatter,
                    "Standard deviation among trials [the parameter's unit].")
      .def_property_readonly(
          "scatter_interval",
          [](const RepeatParameter& p) {
            return std::make_pair(p.scatter_low95, p.scatter_high95);
          },
          "95%.")
      .def_readonly("visible", &RepeatParameter::visible,
                    "A scatter that the trials' own errors let be seen [the parameter's unit].")
      .def_property_readonly(
          "next_interval",
          [](const RepeatParameter& p) { return std::make_pair(p.next_low95, p.next_high95); },
          "95% of the next trial's values.")
      .def_readonly("alike_p", &RepeatParameter::alike_p,
                    "Probability of so much scatter where there is none (Cochran's Q) [-].");
}

}  // namespace

void BindRepeat(py::module_& m) {
  BindRepeatParameter(m);
  const auto matrix = [](Eigen::MatrixXd FitRepeat::*member) {
    return [member](const py::object& self) {
      return MatrixView(self.cast<FitRepeat&>().*member, self);
    };
  };
  const auto points = [](Eigen::Matrix3Xd FitRepeat::*member) {
    return [member](const py::object& self) {
      return PointsView<3>(self.cast<FitRepeat&>().*member, self);
    };
  };
  py::class_<FitRepeat>(m, "FitRepeat",
                        "What k trials of one structure say together of p parameters, and of the "
                        "next trial.")
      .def_readonly("parameters", &FitRepeat::parameters,
                    "List of RepeatParameter, in the order of the fit's parameters.")
      .def_readonly("trials", &FitRepeat::trials, "Names of those that count.")
      .def_property_readonly("estimate", matrix(&FitRepeat::estimate),
                             "(p, k) of each trial by itself.")
      .def_property_readonly("low95", matrix(&FitRepeat::low95), "(p, k) of those.")
      .def_property_readonly("high95", matrix(&FitRepeat::high95), "(p, k) of those.")
      .def_property_readonly("effect", matrix(&FitRepeat::effect),
                             "(p, k) of each trial, by what the others say too; NaN where one "
                             "value serves all.")
      .def_property_readonly("effect_low95", matrix(&FitRepeat::effect_low95), "(p, k) of those.")
      .def_property_readonly("effect_high95", matrix(&FitRepeat::effect_high95), "(p, k) of those.")
      .def_property_readonly("left_out_p", matrix(&FitRepeat::left_out_p),
                             "(p, k) how probable each trial is by the others alone.")
      .def_readonly("unlike_p", &FitRepeat::unlike_p,
                    "Of each trial: the least of its p, times their number.")
      .def_readonly("alike_p", &FitRepeat::alike_p, "Of all parameters [-].")
      .def_readonly("marks", &FitRepeat::marks)
      .def_property_readonly(
          "t", [](const py::object& self) { return View(self.cast<FitRepeat&>().t, self); },
          "(n,) of the next trial's band, on the model's clock [s].")
      .def_property_readonly(
          "mark", [](const py::object& self) { return View(self.cast<FitRepeat&>().mark, self); },
          "(n,) index into marks.")
      .def_property_readonly("middle", points(&FitRepeat::middle),
                             "(n, 3) of the next trial, in the model's frame [m].")
      .def_property_readonly("low", points(&FitRepeat::low), "(n, 3) 95% [m].")
      .def_property_readonly("high", points(&FitRepeat::high), "(n, 3) 95% [m].")
      .def("__repr__", [](const FitRepeat& r) {
        return fmt::format("<unfurl.FitRepeat: {}>", Plural(r.trials.size(), "trial"));
      });
}

}  // namespace unfurl::python
