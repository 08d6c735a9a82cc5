#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "calib/calibrate_survey.h"
#include "calib/check.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "python/bindings.h"
#include "python/lens_names.h"

namespace unfurl::python {
namespace {

using Survey = Recorded<data::Survey>;
using Rig = Recorded<data::Rig>;

struct Calibration {
  std::shared_ptr<Rig> rig;
  calib::CalibrationReport report;
};

Calibration Calibrate(const py::object& survey_or_path, const std::string& lens,
                      const std::string& order, double need, int folds, std::uint64_t seed,
                      std::size_t workers, const py::object& lenses, bool steady,
                      const py::object& progress) {
  calib::CalibrateOptions options;
  options.trends.steady = steady;
  options.guess.lens = LensNamed(lens);
  options.order = OrderNamed(options.guess.lens, order);
  options.guess.seed = seed;
  options.verdict.need = need;
  options.folds = folds;
  options.workers = workers;
  options.Check();
  if (!lenses.is_none()) {
    options.guess.known =
        calib::KnownLensesOf(RecordFrom<Rig>(lenses, "a Rig", &data::ReadRig)->data);
  }
  const auto survey = RecordFrom<Survey>(survey_or_path, "a Survey", &data::ReadSurvey);
  CallbackError errors;
  options.progress = ProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    calib::Calibration found =
        calib::Calibrate(survey->data, options, NameOf(survey->sources, "survey"));
    return Calibration{std::make_shared<Rig>(Rig{std::move(found.rig), survey->sources}),
                       std::move(found.report)};
  });
}

calib::CheckResult Check(const py::object& rig_or_path, const py::object& survey_or_path,
                         double bar, double bar_sigma, double need, double doubtful,
                         double invalid) {
  calib::CheckOptions options;
  options.need = need;
  options.doubtful = doubtful;
  options.invalid = invalid;
  options.Check();
  const auto rig = RecordFrom<Rig>(rig_or_path, "a Rig", &data::ReadRig);
  if (bar != 0.0) {
    if (!(bar > 0.0) || !(bar_sigma >= 0.0) || !std::isfinite(bar) || !std::isfinite(bar_sigma)) {
      throw Error(fmt::format("{} +- {} m is no length", bar, bar_sigma), "bar, bar_sigma",
                  "give a positive length [m] and its standard deviation [m]");
    }
    const std::string path =
        PathFrom(survey_or_path, "with a bar, the path of its readings").string();
    return Long([&] {
      return calib::CheckBar(rig->data, data::ReadReadingsCsv(path), {bar, bar_sigma}, path,
                             options);
    });
  }
  const auto survey = RecordFrom<Survey>(survey_or_path, "a Survey", &data::ReadSurvey);
  return Long([&] {
    return calib::CheckPoints(rig->data, survey->data, NameOf(survey->sources, "survey"), options);
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
          "lens_model", [](const Calibration& self) { return self.report.lens_model; },
          "Its set of terms by name, or one for each camera.")
      .def_property_readonly(
          "chi_square", [](const Calibration& self) { return self.report.chi_square; },
          "Sum of the squared residuals of readings and survey, each in its sigma [-].")
      .def_property_readonly(
          "degrees_of_freedom",
          [](const Calibration& self) { return self.report.degrees_of_freedom; },
          "Redundant numbers of the survey: what chi_square is expected to be [-].")
      .def_property_readonly(
          "point",
          [](const Calibration& self) { return ReadingColumn(self, &calib::ReadingReport::point); },
          "(r,) index into ids, of each reading.")
      .def_property_readonly(
          "camera",
          [](const Calibration& self) {
            return ReadingColumn(self, &calib::ReadingReport::camera);
          },
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
          [](const Calibration& self) {
            return ReadingColumn(self, &calib::ReadingReport::weight);
          },
          "(r,) 0: left out as gross.")
      .def_property_readonly(
          "held_out", &HeldOutErrors,
          "(h, 3) errors of points that were found without having been used [m].")
      .def("__repr__", [](const Calibration& self) {
        return fmt::format("<unfurl.Calibration: {}, {}, {}>", self.rig->data.verdict,
                           Plural(self.report.cameras.size(), "camera"),
                           Plural(self.report.ids.size(), "point"));
      });
  m.def("calibrate", &Calibrate, py::arg("survey"), py::kw_only(), py::arg("lens") = "rectilinear",
        py::arg("order") = "auto", py::arg("need") = 0.0, py::arg("folds") = 10,
        py::arg("seed") = calib::GuessOptions().seed, py::arg("workers") = 0,
        py::arg("lenses") = py::none(), py::arg("steady") = false, py::arg("progress") = py::none(),
        "A rig from a survey (a Survey or a path), without an initial guess.\n\n"
        "lens: 'rectilinear', or 'fisheye' (wide angle). order: its terms; 'auto' chooses by\n"
        "cross-validation. need: error of a found point that is aimed at [m]; 0: a 2000th of the\n"
        "surveyed box. folds: of the held-out check, 2 or more. seed: of the search for gross\n"
        "errors. workers: threads, 0 for all cores; changes no result. lenses: a rig (or a path to "
        "one)\n"
        "of the same cameras, calibrated before they were moved; their lenses are known from it,\n"
        "8 points do, and lens and order do not count. steady: station and cameras did not move\n"
        "during the survey, as something else shows. progress(done): is called\n"
        "between the steps with the share that is done.\n"
        "A calibration that is not good is a result: see verdict and reasons.");
}

void BindCheck(py::module_& m) {
  using calib::CheckResult;
  py::class_<calib::CheckedCamera>(m, "CheckedCamera", "A camera's part in a check.")
      .def_readonly("name", &calib::CheckedCamera::name)
      .def_readonly("readings", &calib::CheckedCamera::readings, "Number of its readings.")
      .def_readonly("shift", &calib::CheckedCamera::shift_px,
                    "By how much all its readings are off [px].")
      .def_readonly("shift_sigma", &calib::CheckedCamera::shift_sigma_px,
                    "Its standard deviation [px].")
      .def_readonly("shows", &calib::CheckedCamera::shows_px,
                    "The least shift that is found and named nine times in ten [px].");
  py::class_<calib::CheckedCause>(m, "CheckedCause", "What explains a misfit.")
      .def_property_readonly(
          "kind", [](const calib::CheckedCause& self) { return calib::Name(self.kind); },
          "'camera', 'point', 'reading' or 'frame'.")
      .def_readonly("camera", &calib::CheckedCause::camera, "Index; -1: does not apply.")
      .def_readonly("point", &calib::CheckedCause::point,
                    "Index of the point or placement; -1: does not apply.")
      .def_readonly("size", &calib::CheckedCause::size, "Of a camera or a reading [px], else [m].")
      .def_readonly("sigma", &calib::CheckedCause::sigma, "Its standard deviation.")
      .def_readonly("probability", &calib::CheckedCause::probability,
                    "Of all that may be wrong [-].")
      .def_readonly("text", &calib::CheckedCause::text, "A sentence.");
  py::class_<CheckResult>(m, "CheckResult", "Whether a calibration is still valid.")
      .def_readonly("verdict", &CheckResult::verdict,
                    "'still valid', 'doubtful' or 'no longer valid'.")
      .def_readonly("reasons", &CheckResult::reasons)
      .def_readonly("chance", &CheckResult::chance,
                    "Probability of so large a misfit, were the calibration valid [-].")
      .def_readonly("rms", &CheckResult::rms, "Of the found points' errors [m].")
      .def_readonly("rms_predicted", &CheckResult::rms_predicted, "What it should be [m].")
      .def_readonly("cameras", &CheckResult::cameras, "What was found of each camera.")
      .def_readonly("causes", &CheckResult::causes,
                    "What explains the misfit, most telling first; empty where all is well.")
      .def_readonly("explained", &CheckResult::explained,
                    "Whether the rest is probable without the causes.")
      .def_property_readonly(
          "usable", [](const CheckResult& self) { return !self.invalid; },
          "Whether it is not 'no longer valid'.")
      .def("__repr__", [](const CheckResult& self) {
        return fmt::format("<unfurl.CheckResult: {}, chance {:.2g}>", self.verdict, self.chance);
      });
  m.def(
      "check", &Check, py::arg("rig"), py::arg("survey"), py::kw_only(), py::arg("bar") = 0.0,
      py::arg("bar_sigma") = 0.0, py::arg("need") = 0.0,
      py::arg("doubtful") = calib::CheckOptions().doubtful,
      py::arg("invalid") = calib::CheckOptions().invalid,
      "Is a calibration still valid? Against a survey of some points; both may be paths.\n\n"
      "bar, bar_sigma: instead, the length of a bar and its standard deviation [m]; survey is "
      "then\n"
      "the path of a CSV of readings of its ends, ids 1a, 1b, 2a, 2b ... need: error of a found\n"
      "point that matters [m]; 0: a 2000th of the surveyed box. doubtful, invalid: probabilities\n"
      "of a misfit below which it is called so.");
}

}  // namespace

void BindCalibration(py::module_& m) {
  BindCalibrate(m);
  BindCheck(m);
}

}  // namespace unfurl::python
