#include <fmt/format.h>

#include <array>
#include <optional>

#include "base/error.h"
#include "calib/plan.h"
#include "calib/plan_survey.h"
#include "data/formats.h"
#include "data/survey.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Survey = Recorded<data::Survey>;
using Rig = Recorded<data::Rig>;

struct Plan {
  std::shared_ptr<Rig> rig;
  calib::PlanResult result;
};

// Places to survey: their number, or the places themselves as `station` measures them.
void SetPlannedPoints(const py::object& points, const std::string& station,
                      const std::optional<std::array<double, 3>>& at, double sigma,
                      calib::PlanOptions* options) {
  if (py::isinstance<py::int_>(points)) {
    if (!station.empty() || at) {
      throw Error("needs places to measure", station.empty() ? "station_at" : "station",
                  "give them, as points=\"points.csv\"");
    }
    options->survey_points = points.cast<int>();
    return;
  }
  const auto places = RecordFrom<Survey>(points, "a number, a Survey", &data::ReadPointsCsv);
  calib::PlannedStation by{.accuracy = station, .where = "station", .sigma = sigma};
  if (at) by.at = Eigen::Vector3d::Map(at->data());
  options->survey = calib::PlannedSurvey(places->data, by, NameOf(places->sources, "points"));
}

Plan MakePlan(const py::object& lab_or_rig, const py::object& points, const std::string& station,
              const std::optional<std::array<double, 3>>& station_at, double reading_sigma,
              double need, int columns, int layers, std::uint64_t seed) {
  calib::PlanOptions options;
  options.seed = seed;
  options.need = need;
  options.map.reading_sigma_px = reading_sigma;
  options.map.columns = columns;
  options.map.layers = layers;
  std::shared_ptr<data::Lab> lab;
  std::shared_ptr<Rig> rig;
  if (py::isinstance<data::Lab>(lab_or_rig)) {
    lab = lab_or_rig.cast<std::shared_ptr<data::Lab>>();
  } else if (!py::isinstance<Rig>(lab_or_rig) &&
             data::FormatOf(PathFrom(lab_or_rig, "a Lab, a Rig or a path").string()) ==
                 data::FileFormat::kToml) {
    lab = std::make_shared<data::Lab>(data::ReadLab(lab_or_rig.cast<fs::path>().string()));
  } else {
    rig = RecordFrom<Rig>(lab_or_rig, "a Lab, a Rig", &data::ReadRig);
  }
  SetPlannedPoints(points, station, station_at, lab != nullptr ? lab->survey.sigma : 0.0, &options);
  options.Check();
  return Long([&] {
    Plan out;
    out.result = lab != nullptr ? calib::Plan(*lab, options) : calib::Plan(rig->data, options);
    out.rig = rig != nullptr && !options.survey
                  ? rig
                  : std::make_shared<Rig>(Rig{
                        out.result.planned.rig,
                        lab != nullptr ? std::vector<Source>{SourceOf(lab->path)} : rig->sources});
    return out;
  });
}

}  // namespace

void BindPlan(py::module_& m) {
  using calib::PlanCase;
  py::class_<PlanCase>(m, "PlanCase", "The error to expect over the volume, in one case.")
      .def_readonly("name", &PlanCase::name, "'all cameras', or 'without NAME'.")
      .def_property_readonly(
          "sigma",
          [](const py::object& self) {
            const calib::UncertaintyMap& map = self.cast<PlanCase&>().map;
            const py::ssize_t columns = map.columns, layers = map.layers;
            return View(map.sigma.data(), {layers, columns, columns}, self);
          },
          "(layers, columns, columns) by z, y, x: 3-D standard deviation of a found point; NaN: "
          "not\n"
          "found [m].")
      .def_property_readonly(
          "box", [](const PlanCase& self) { return CornersOf(self.map.low, self.map.high); },
          "Corners of the box that the map divides into cells, (3,) each [m].")
      .def_property_readonly(
          "found", [](const PlanCase& self) { return self.map.Found(); },
          "Share of the volume that is found.")
      .def(
          "within", [](const PlanCase& self, double need) { return self.map.Within(need); },
          py::arg("need"), "Share of the volume whose error is at most so much [m].")
      .def(
          "quantile", [](const PlanCase& self, double p) { return self.map.Quantile(p); },
          py::arg("p"), "Of sigma over what is found [m]; NaN where nothing is.")
      .def("__repr__", [](const PlanCase& self) {
        return fmt::format("<unfurl.PlanCase {}: {:.0f}% found, half within {:.2g} m>", self.name,
                           100.0 * self.map.Found(), self.map.Quantile(0.5));
      });
  py::class_<Plan>(m, "Plan", "How well a rig will find points.")
      .def_readonly("rig", &Plan::rig, "With the covariance that such a calibration would have.")
      .def_property_readonly(
          "cases",
          [](const py::object& self) { return PartsOf(self, self.cast<Plan&>().result.cases); },
          "List of PlanCase: with all cameras, then without each.")
      .def_property_readonly(
          "verdict", [](const Plan& self) { return self.result.headline; }, "In words.")
      .def_property_readonly(
          "reasons", [](const Plan& self) { return self.result.reasons; }, "Why.")
      .def_property_readonly(
          "usable",
          [](const Plan& self) { return self.result.verdict != calib::PlanVerdict::kNotUsable; },
          "Whether enough of the volume reaches the need.")
      .def_property_readonly(
          "need", [](const Plan& self) { return self.result.need; },
          "Error of a found point by which it was judged [m].")
      .def_property_readonly(
          "advice", [](const Plan& self) { return self.result.planned.advice; },
          "On the survey's layout.")
      .def("__repr__", [](const Plan& self) {
        return fmt::format("<unfurl.Plan: {}, {:.0f}% of the volume found>",
                           Plural(self.rig->data.cameras.size(), "camera"),
                           100.0 * self.result.cases.front().map.Found());
      });
  m.def(
      "plan", &MakePlan, py::arg("lab_or_rig"), py::kw_only(),
      py::arg("points") = calib::PlanOptions().survey_points, py::arg("station") = "",
      py::arg("station_at") = py::none(),
      py::arg("reading_sigma") = calib::MapOptions().reading_sigma_px, py::arg("need") = 0.0,
      py::arg("columns") = calib::MapOptions().columns,
      py::arg("layers") = calib::MapOptions().layers, py::arg("seed") = calib::PlanOptions().seed,
      "How well a proposed laboratory or a calibrated rig will find points (or a path to one),\n"
      "and what the loss of any camera does.\n\n"
      "points: that would be surveyed: how many, or the places themselves (a Survey, or a path to\n"
      "id, x, y, z as CSV); with a rig, as calibrated anew by them. station: the total station's\n"
      "accuracy, as '1mm+0.1mm/m, 0.1mrad' or '1.5mm+2ppm, 1arcsec'; '': what the points state.\n"
      "station_at: where it stands (x, y, z) [m], unless the points say it.\n"
      "reading_sigma: of one reading [px]. need: error of a found\n"
      "point that is aimed at [m]; 0: a 2000th of the box. columns, layers: cells of the map "
      "along\n"
      "x and y, and along z. seed: of where the points lie.");
}

}  // namespace unfurl::python
