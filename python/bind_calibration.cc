#include <fmt/format.h>

#include "base/error.h"
#include "calib/calibrate_survey.h"
#include "calib/check.h"
#include "calib/plan.h"
#include "data/survey.h"
#include "measure/survey_readings.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Survey = Recorded<data::Survey>;
using Rig = Recorded<data::Rig>;

struct Calibration {
  std::shared_ptr<Rig> rig;
  calib::CalibrationReport report;
};

struct PlanCase {
  std::string name;  // "all", or the camera that is lost
  calib::UncertaintyMap map;
};

struct Plan {
  std::shared_ptr<Rig> rig;
  std::vector<PlanCase> cases;
  std::vector<std::string> advice;
};

int OrderOf(const std::string& name) {
  if (name == "auto") return calib::kAutomaticOrder;
  std::string known = "'auto'";
  for (std::size_t k = 0; k < calib::kLensOrders.size(); ++k) {
    if (name == calib::kLensOrders[k].name) return static_cast<int>(k);
    known += fmt::format(", '{}'", calib::kLensOrders[k].name);
  }
  throw Error(fmt::format("there is no lens model \"{}\"", name), "order", "give one of " + known);
}

Calibration Calibrate(const py::object& survey_or_path, const std::string& order, int folds,
                      std::size_t workers) {
  const auto survey = RecordFrom<Survey>(survey_or_path, &data::ReadSurvey);
  calib::CalibrateOptions options;
  options.order = OrderOf(order);
  if (folds < 2) throw Error(fmt::format("{} is not a number of folds", folds), "folds", "use 2 or more");
  options.folds = folds;
  options.workers = workers;
  return Long([&] {
    const std::string where = survey->sources.empty() ? "survey" : survey->sources.front().path;
    calib::Calibration found = calib::Calibrate(survey->data, options, where);
    return Calibration{std::make_shared<Rig>(Rig{std::move(found.rig), survey->sources}),
                       std::move(found.report)};
  });
}

calib::CheckResult Check(const py::object& rig_or_path, const py::object& survey_or_path) {
  const auto rig = RecordFrom<Rig>(rig_or_path, &data::ReadRig);
  const auto given = RecordFrom<Survey>(survey_or_path, &data::ReadSurvey);
  return Long([&] {
    data::Survey survey = given->data;
    measure::FindSurveyReadings(&survey);
    const std::string where = given->sources.empty() ? "survey" : given->sources.front().path;
    return calib::CheckPoints(rig->data, calib::FromSurvey(survey, where), where);
  });
}

Plan MakePlan(const py::object& lab_or_rig, int points, double reading_sigma, int columns,
              int layers, std::uint64_t seed) {
  if (points < 12 || columns < 1 || layers < 1 || !(reading_sigma > 0.0)) {
    throw Error("points, reading_sigma, columns or layers out of range", "plan",
                "use 12 points or more, one cell or more, and a positive sigma");
  }
  std::shared_ptr<Rig> rig;
  std::shared_ptr<data::Lab> lab;
  if (py::isinstance<Rig>(lab_or_rig)) {
    rig = lab_or_rig.cast<std::shared_ptr<Rig>>();
  } else if (py::isinstance<data::Lab>(lab_or_rig)) {
    lab = lab_or_rig.cast<std::shared_ptr<data::Lab>>();
  } else {
    const fs::path path = lab_or_rig.cast<fs::path>();
    if (path.extension() == ".toml") {
      lab = std::make_shared<data::Lab>(data::ReadLab(path.string()));
    } else {
      rig = RecordFrom<Rig>(lab_or_rig, &data::ReadRig);
    }
  }
  return Long([&] {
    Plan out;
    calib::Visibility sees;
    if (lab != nullptr) {
      calib::PlanOptions options;
      options.survey_points = points;
      options.reading_sigma_px = reading_sigma;
      options.seed = seed;
      calib::Plan plan = calib::PlanLab(*lab, options);
      out.rig = std::make_shared<Rig>(Rig{std::move(plan.rig), {SourceOf(lab->path)}});
      out.advice = plan.advice;
      sees = plan.sees;
    } else {
      out.rig = rig;
      sees = calib::SeenOnRow(rig->data);
    }
    calib::MapOptions map;
    map.columns = columns;
    map.layers = layers;
    map.reading_sigma_px = reading_sigma;
    out.cases.push_back({"all", calib::MapUncertainty(out.rig->data, sees, map)});
    for (std::size_t c = 0; c < out.rig->data.cameras.size(); ++c) {
      out.cases.push_back({out.rig->data.cameras[c].name,
                           calib::MapUncertainty(out.rig->data, sees, map, static_cast<int>(c))});
    }
    return out;
  });
}

template <class Value>
py::array ReadingColumn(const Calibration& of, Value calib::ReadingReport::*member) {
  std::vector<Value> values;
  for (const calib::ReadingReport& r : of.report.readings) values.push_back(r.*member);
  return Owned(std::move(values));
}

py::array_t<double> HeldOutErrors(const Calibration& of) {
  const auto n = static_cast<py::ssize_t>(of.report.held_out.size());
  py::array_t<double> out({n, py::ssize_t{3}});
  for (py::ssize_t i = 0; i < n; ++i) {
    for (py::ssize_t k = 0; k < 3; ++k) {
      out.mutable_at(i, k) = of.report.held_out[static_cast<std::size_t>(i)].error[k];
    }
  }
  return out;
}

void BindCalibrate(py::module_& m) {
  py::class_<calib::CameraReport>(m, "CameraReport", "What the calibration says of one camera.")
      .def_readonly("name", &calib::CameraReport::name)
      .def_readonly("readings", &calib::CameraReport::readings, "How many.")
      .def_readonly("gross", &calib::CameraReport::gross, "Of them, left out as gross errors.")
      .def_readonly("residual_rms", &calib::CameraReport::residual_rms_px, "Of the others [px].")
      .def_readonly("floor", &calib::CameraReport::floor_px, "Its model error [px].")
      .def("__repr__", [](const calib::CameraReport& c) {
        return fmt::format("<unfurl.CameraReport '{}': {}, residual {:.4f} px>", c.name,
                           Plural(static_cast<std::size_t>(c.readings), "reading"),
                           c.residual_rms_px);
      });
  py::class_<Calibration>(m, "Calibration", "A rig, and what the survey says of it.")
      .def_readonly("rig", &Calibration::rig)
      .def_property_readonly(
          "verdict", [](const Calibration& self) { return self.rig->data.verdict; },
          "'good', 'usable with care' or 'do not use'.")
      .def_property_readonly(
          "reasons", [](const Calibration& self) { return self.rig->data.reasons; }, "Why.")
      .def_property_readonly(
          "usable", [](const Calibration& self) { return self.rig->data.verdict != "do not use"; },
          "Whether the verdict is any but 'do not use'.")
      .def_property_readonly(
          "checks", [](const Calibration& self) { return self.rig->data.checks; },
          "Numbers by name with unit: {'held_out_rms [m]': 2.1e-4, ..}.")
      .def_property_readonly(
          "cameras", [](const Calibration& self) { return self.report.cameras; },
          "List of CameraReport.")
      .def_property_readonly(
          "ids", [](const Calibration& self) { return self.report.ids; }, "Names of the points.")
      .def_property_readonly(
          "gross",
          [](const Calibration& self) {
            std::vector<std::string> sentences;
            for (const calib::GrossFinding& g : self.report.gross) sentences.push_back(g.text);
            return sentences;
          },
          "Gross errors, a sentence each.")
      .def_property_readonly(
          "advice", [](const Calibration& self) { return self.report.advice; },
          "On the survey's layout.")
      .def_property_readonly(
          "lens_model", [](const Calibration& self) { return self.report.lens_model; })
      .def_property_readonly(
          "chi_square", [](const Calibration& self) { return self.report.chi_square; })
      .def_property_readonly(
          "degrees_of_freedom",
          [](const Calibration& self) { return self.report.degrees_of_freedom; })
      .def_property_readonly(
          "point",
          [](const Calibration& self) { return ReadingColumn(self, &calib::ReadingReport::point); },
          "(r,) index into ids, of each reading.")
      .def_property_readonly(
          "camera",
          [](const Calibration& self) { return ReadingColumn(self, &calib::ReadingReport::camera); },
          "(r,) index into cameras, of each reading.")
      .def_property_readonly(
          "u",
          [](const Calibration& self) { return ReadingColumn(self, &calib::ReadingReport::u_px); },
          "(r,) each reading [px].")
      .def_property_readonly(
          "residual",
          [](const Calibration& self) {
            return ReadingColumn(self, &calib::ReadingReport::residual_px);
          },
          "(r,) reading less prediction [px].")
      .def_property_readonly(
          "sigma",
          [](const Calibration& self) {
            return ReadingColumn(self, &calib::ReadingReport::sigma_px);
          },
          "(r,) standard deviation with the camera's model error [px].")
      .def_property_readonly(
          "weight",
          [](const Calibration& self) { return ReadingColumn(self, &calib::ReadingReport::weight); },
          "(r,) 0: left out as gross.")
      .def_property_readonly("held_out", &HeldOutErrors,
                             "(h, 3) errors of points that were found without having been used [m].")
      .def("__repr__", [](const Calibration& self) {
        return fmt::format("<unfurl.Calibration: {}, {}, {}>", self.rig->data.verdict,
                           Plural(self.report.cameras.size(), "camera"),
                           Plural(self.report.ids.size(), "point"));
      });
  m.def("calibrate", &Calibrate, py::arg("survey"), py::kw_only(), py::arg("order") = "auto",
        py::arg("folds") = 10, py::arg("workers") = 0,
        "A rig from a survey (a Survey or a path), without an initial guess.\n\n"
        "order: lens model; 'auto' chooses by cross-validation. folds: of the held-out check.\n"
        "workers: threads, 0 for all cores; changes no result.\n"
        "A calibration that is not good is a result: see verdict and reasons.");
}

void BindCheck(py::module_& m) {
  using calib::CheckResult;
  py::class_<CheckResult>(m, "CheckResult", "Whether a calibration is still valid.")
      .def_readonly("verdict", &CheckResult::verdict,
                    "'still valid', 'doubtful' or 'no longer valid'.")
      .def_readonly("reasons", &CheckResult::reasons)
      .def_readonly("chance", &CheckResult::chance,
                    "Of so large a misfit, were the calibration valid.")
      .def_readonly("rms", &CheckResult::rms, "Of the found points' errors [m].")
      .def_readonly("rms_predicted", &CheckResult::rms_predicted, "What it should be [m].")
      .def_property_readonly(
          "usable", [](const CheckResult& self) { return self.chance >= calib::kDoubtful; },
          "Whether it is not 'no longer valid'.")
      .def("__repr__", [](const CheckResult& self) {
        return fmt::format("<unfurl.CheckResult: {}, chance {:.2g}>", self.verdict, self.chance);
      });
  m.def("check", &Check, py::arg("rig"), py::arg("survey"),
        "Is a calibration still valid? Against a survey of some points; both may be paths.");
}

void BindPlan(py::module_& m) {
  py::class_<PlanCase>(m, "PlanCase", "The error to expect over the volume, in one case.")
      .def_readonly("name", &PlanCase::name, "'all', or the camera that is lost.")
      .def_property_readonly(
          "sigma",
          [](py::object self) {
            const calib::UncertaintyMap& map = self.cast<PlanCase&>().map;
            const py::ssize_t columns = map.columns, layers = map.layers;
            return View(map.sigma.data(), {layers, columns, columns}, self);
          },
          "(layers, columns, columns) by z, y, x: 3-D standard deviation of a found point; NaN: not\n"
          "found [m].")
      .def_property_readonly(
          "found", [](const PlanCase& self) { return self.map.Found(); },
          "Share of the volume that is found.")
      .def(
          "quantile", [](const PlanCase& self, double p) { return self.map.Quantile(p); },
          py::arg("p"), "Of sigma over what is found [m].")
      .def("__repr__", [](const PlanCase& self) {
        return fmt::format("<unfurl.PlanCase {}: {:.0f}% found, half within {:.2g} m>",
                           self.name == "all" ? "all cameras" : "without '" + self.name + "'",
                           100.0 * self.map.Found(), self.map.Quantile(0.5));
      });
  py::class_<Plan>(m, "Plan", "How well a rig will find points.")
      .def_readonly("rig", &Plan::rig, "With the covariance that such a calibration would have.")
      .def_readonly("cases", &Plan::cases, "PlanCase: with all cameras, then without each.")
      .def_readonly("advice", &Plan::advice)
      .def("__repr__", [](const Plan& self) {
        return fmt::format("<unfurl.Plan: {}, {:.0f}% of the volume found>",
                           Plural(self.rig->data.cameras.size(), "camera"),
                           100.0 * self.cases.front().map.Found());
      });
  m.def("plan", &MakePlan, py::arg("lab_or_rig"), py::kw_only(), py::arg("points") = 200,
        py::arg("reading_sigma") = 0.03, py::arg("columns") = 12, py::arg("layers") = 3,
        py::arg("seed") = 1,
        "How well a proposed laboratory or a calibrated rig will find points (or a path to one),\n"
        "and what the loss of any camera does. points: that would be surveyed. reading_sigma: of\n"
        "one reading [px]. columns, layers: cells of the map along x and y, and along z.");
}

}  // namespace

void BindCalibration(py::module_& m) {
  BindCalibrate(m);
  BindCheck(m);
  BindPlan(m);
}

}  // namespace unfurl::python
