#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "calib/layout.h"
#include "calib/verdict.h"
#include "calib/wand.h"
#include "calib/wand_given.h"
#include "data/formats.h"
#include "data/survey.h"
#include "data/wand.h"
#include "measure/survey_readings.h"
#include "python/bindings.h"
#include "python/lens_names.h"

namespace unfurl::python {
namespace {

using Wand = Recorded<data::WandReadings>;

struct WandResult {
  std::shared_ptr<Recorded<data::Rig>> rig;
  calib::WandReport report;
};

Wand MakeWand(const py::object& poses, const py::object& marks, const py::object& u,
              const py::object& s, const py::object& camera_names, const py::object& time,
              const std::vector<int>& pixels) {
  Wand out;
  data::WandReadings& w = out.data;
  w.pose = NamesFrom(poses, "pose");
  w.mark = NamesFrom(marks, "mark");
  w.cameras = NamesFrom(camera_names, "cameras");
  w.pixels = pixels;
  const auto n = static_cast<Eigen::Index>(w.pose.size());
  ReadingsFrom(u, s, w.cameras.size(), &w.u_px, &w.s_px);
  if (!time.is_none()) w.time = NumbersFrom(time, "time");
  if (w.mark.size() != w.pose.size() || w.u_px.rows() != n ||
      (!w.time.empty() && w.time.size() != w.pose.size())) {
    throw py::value_error("pose, mark, u, s and time: expected the same number of flashes");
  }
  if (!w.pixels.empty() && w.pixels.size() != w.cameras.size()) {
    throw py::value_error("pixels: expected a number for each camera");
  }
  for (const double t : w.time) {
    if (!std::isfinite(t)) throw py::value_error("time: expected finite numbers");
  }
  return out;
}

void WriteWandFile(const Wand& wand, const fs::path& path) {
  if (data::FormatOf(path.string()) == data::FileFormat::kCsv) {
    data::WriteWandCsv(path.string(), wand.data);
  } else {
    data::WriteWand(path.string(), wand.data, ProvenanceOf(wand.sources));
  }
}

// As text, or numbers with their standard deviation.
calib::WandBar BarFrom(const py::object& bar, double sigma) {
  if (py::isinstance<py::str>(bar)) {
    if (sigma == 0.0) return calib::ParseBar(bar.cast<std::string>(), "bar");
    throw Error("is said by the bar's own text", "bar_sigma", "leave it out, or give bar a number");
  }
  calib::WandBar out;
  out.sigma = sigma;
  out.places = IsNumber(bar) ? std::vector<double>{bar.cast<double>()} : NumbersFrom(bar, "bar");
  for (const double place : out.places) {
    if (place == 0.0 || !std::isfinite(place)) {
      throw Error(fmt::format("{} m is no length", place), "bar",
                  "give the length [m]; of more than two marks the distances from the first");
    }
    if (!(sigma > 0.0 && sigma < std::abs(place))) {
      throw Error(fmt::format("{} +- {} m does not say how well it is known", place, sigma),
                  "bar_sigma", "give the length's standard deviation [m]");
    }
  }
  return out;
}

// Three cameras, or two poses, or none of them.
void SetFrameOf(const std::vector<std::string>& frame, const std::string& plumb,
                const std::string& origin, calib::WandFrame* out) {
  out->cameras = frame;
  out->plumb = plumb;
  out->origin = origin;
  if (!frame.empty() && (!plumb.empty() || frame.size() != 3)) {
    throw Error(plumb.empty() ? "is not three cameras" : "is given beside plumb", "frame",
                "give the cameras of origin, x and y, or a plumb pose with its origin");
  }
  if (plumb.empty() != origin.empty()) {
    throw Error("is given without its other half", plumb.empty() ? "origin" : "plumb",
                "give both poses: one in which the bar hung plumb, one for origin and x");
  }
}

WandResult CalibrateWand(const py::object& readings, const py::object& bar, double bar_sigma,
                         const py::object& points, const std::string& lens,
                         const std::string& order, double need, int folds, std::uint64_t seed,
                         std::size_t workers, const py::object& lenses, const py::object& start,
                         const py::object& layout, const std::vector<std::string>& frame,
                         const std::string& plumb, const std::string& origin,
                         const py::object& progress) {
  using Rig = Recorded<data::Rig>;
  calib::WandOptions options;
  options.fit.guess.lens = LensNamed(lens);
  options.fit.guess.seed = seed;
  options.fit.order = OrderNamed(options.fit.guess.lens, order);
  options.verdict.need = need;
  options.folds = folds;
  options.workers = workers;
  SetFrameOf(frame, plumb, origin, &options.frame);
  const calib::WandBar length = BarFrom(bar, bar_sigma);
  const auto wand = RecordFrom<Wand>(readings, "a Wand", &data::ReadWand);
  std::vector<Source> sources = wand->sources;
  std::optional<data::Survey> survey;
  std::string survey_name;
  if (!points.is_none()) {
    using Survey = Recorded<data::Survey>;
    const auto read = RecordFrom<Survey>(points, "a Survey", &data::ReadSurvey);
    survey = read->data;
    survey_name = NameOf(read->sources, "points");
    sources = Joined(std::move(sources), read->sources);
  }
  std::shared_ptr<data::Lab> lab;
  if (!layout.is_none()) {
    lab = LabFrom(layout);
    sources = Joined(std::move(sources), {SourceOf(lab->path)});
  }
  const std::string name = NameOf(wand->sources, "readings");
  const auto rig_from = [&](const py::object& rig) {
    auto read = RecordFrom<Rig>(rig, "a Rig", &data::ReadRig);
    sources = Joined(std::move(sources), read->sources);
    return read;
  };
  if (!lenses.is_none()) options.fit.lenses = calib::KnownLensesOf(rig_from(lenses)->data);
  if (!start.is_none()) {
    const auto rig = rig_from(start);
    options.fit.from =
        calib::CamerasOf(rig->data, wand->data.cameras, NameOf(rig->sources, "start"));
  }
  if (lab) options.frame.layout = calib::PlannedPlaces(*lab);
  options.Check();
  CallbackError errors;
  options.progress = ProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    if (survey) measure::FindSurveyReadings(&*survey, workers);
    const calib::WandData data =
        calib::MakeWandData(wand->data, length, survey ? &*survey : nullptr, name, survey_name);
    calib::WandCalibration found = calib::CalibrateWand(data, options, name);
    if (lab) {
      calib::JudgeLayout(
          *lab, &found.rig,
          found.fit.by_points ? calib::ScaleFrom::kBarWithPoints : calib::ScaleFrom::kBar);
    }
    return WandResult{std::make_shared<Rig>(Rig{std::move(found.rig), sources}),
                      std::move(found.report)};
  });
}

void BindWandReadings(py::module_& m) {
  py::class_<Wand, std::shared_ptr<Wand>>(
      m, "Wand", "Readings of a bar of marks that is moved by hand: f flashes seen by c cameras.")
      .def(py::init(&MakeWand), py::arg("pose"), py::arg("mark"), py::arg("u"), py::arg("s"),
           py::kw_only(), py::arg("cameras"), py::arg("time") = py::none(),
           py::arg("pixels") = std::vector<int>(),
           "Readings of your own.\n\n"
           "pose, mark: f names each; a flash is one mark, lit once in one pose. u: (f, c) "
           "readings\n"
           "[px], NaN: not seen. s: (f, c) or one number, their standard deviations [px]. "
           "cameras: c\n"
           "names. time: f, of each flash [s]; None: the bar stood still in each pose. pixels: c,\n"
           "lengths of the rows; empty: not stated.")
      .def(PickledAsFile<data::WandReadings>(&data::WriteWand, &data::ReadWand))
      .def("__len__", [](const Wand& self) { return self.data.size(); })
      .def_property_readonly(
          "pose", [](const Wand& self) { return self.data.pose; }, "f names.")
      .def_property_readonly(
          "mark", [](const Wand& self) { return self.data.mark; }, "f names.")
      .def_property_readonly(
          "cameras", [](const Wand& self) { return self.data.cameras; }, "c names.")
      .def_property_readonly(
          "time", [](const py::object& self) { return View(self.cast<Wand&>().data.time, self); },
          "(f,) of each flash [s]; empty: the bar stood still in each pose.")
      .def_property_readonly(
          "u",
          [](const py::object& self) { return MatrixView(self.cast<Wand&>().data.u_px, self); },
          "(f, c) readings; NaN: not seen [px].")
      .def_property_readonly(
          "s",
          [](const py::object& self) { return MatrixView(self.cast<Wand&>().data.s_px, self); },
          "(f, c) their standard deviations [px].")
      .def("write", &WriteWandFile, py::arg("path"), "Writes them: .csv, else HDF5.")
      .def("__repr__", [](const Wand& self) {
        return fmt::format("<unfurl.Wand: {} flash{}, {}>", self.data.size(),
                           self.data.size() == 1 ? "" : "es",
                           Plural(self.data.cameras.size(), "camera"));
      });
  m.def(
      "read_wand",
      [](const py::object& path) {
        return RecordFrom<Wand>(py::cast(PathFrom(path, "a path")), "a Wand", &data::ReadWand);
      },
      py::arg("path"),
      "Readings of a bar: HDF5, or CSV with pose and mark (or id: 12a), time [s] or not, and u1 "
      "[px],\n"
      "s1 [px] .. or camera, u [px], s [px].");
}

void BindWandParts(py::module_& m) {
  py::class_<calib::WandCameraReport>(m, "WandCamera", "A camera's part in a wand's calibration.")
      .def_readonly("name", &calib::WandCameraReport::name)
      .def_readonly("readings", &calib::WandCameraReport::readings, "Of the bar.")
      .def_readonly("gross", &calib::WandCameraReport::gross, "Of them, left out.")
      .def_readonly("residual_rms", &calib::WandCameraReport::residual_rms_px,
                    "Of the others [px].")
      .def_readonly("floor", &calib::WandCameraReport::floor_px, "Its model error [px].")
      .def("__repr__", [](const calib::WandCameraReport& c) {
        return fmt::format("<unfurl.WandCamera '{}': {}, residual {:.4f} px>", c.name,
                           Plural(static_cast<std::size_t>(c.readings), "reading"),
                           c.residual_rms_px);
      });
  py::class_<calib::WandShape>(m, "WandShape",
                               "A change of shape of the found points that readings leave open.")
      .def_readonly("name", &calib::WandShape::name, "Such as 'scale along (0.00, 0.00, 1.00)'.")
      .def_readonly("sigma", &calib::WandShape::sigma, "Standard deviation of the strain [-].")
      .def_readonly("moved", &calib::WandShape::moved,
                    "What one sigma moves points at the volume's edge by [m].")
      .def_readonly("by_bar", &calib::WandShape::by_bar,
                    "Whether it is the bar's length that is not known better.")
      .def("__repr__", [](const calib::WandShape& s) {
        return fmt::format("<unfurl.WandShape: {}, {:.3g}>", s.name, s.sigma);
      });
}

py::array VectorView(const Eigen::VectorXd& vector, const py::object& owner) {
  return View(vector.data(), {vector.size()}, owner);
}

// Errors of the bar's length in poses that took no part, and what they should be.
template <class Value>
py::array LengthColumn(const WandResult& of, Value calib::WandLength::*member) {
  std::vector<Value> values;
  for (const calib::WandLength& length : of.report.lengths) values.push_back(length.*member);
  return Owned(std::move(values));
}

void BindWandResult(py::module_& m) {
  py::class_<WandResult>(m, "WandCalibration", "A rig by a bar, and what its readings say of it.")
      .def_readonly("rig", &WandResult::rig)
      .def_property_readonly(
          "verdict", [](const WandResult& self) { return self.rig->data.verdict; },
          "'good', 'usable with care' or 'do not use'.")
      .def_property_readonly(
          "reasons", [](const WandResult& self) { return self.rig->data.reasons; }, "Why.")
      .def_property_readonly(
          "usable",
          [](const WandResult& self) { return self.rig->data.verdict != calib::kDoNotUse; },
          "Whether the verdict is any but 'do not use'.")
      .def_property_readonly(
          "checks", [](const WandResult& self) { return self.rig->data.checks; },
          "Numbers by name with unit.")
      .def_property_readonly(
          "frame", [](const WandResult& self) { return self.report.frame; },
          "Where the frame comes from, in words.")
      .def_property_readonly(
          "handed", [](const WandResult& self) { return self.report.handed; },
          "False: the rig may be the mirror image of what it states.")
      .def_property_readonly(
          "cameras", [](const WandResult& self) { return self.report.cameras; },
          "List of WandCamera.")
      .def_property_readonly(
          "marks", [](const WandResult& self) { return self.report.marks; }, "m names.")
      .def_property_readonly(
          "place",
          [](const py::object& self) {
            return VectorView(self.cast<WandResult&>().report.place, self);
          },
          "(m,) places of the marks along the bar, from the first [m].")
      .def_property_readonly(
          "place_sigma",
          [](const py::object& self) {
            return VectorView(self.cast<WandResult&>().report.place_sigma, self);
          },
          "(m,) their standard deviations [m].")
      .def_property_readonly(
          "poses", [](const WandResult& self) { return self.report.poses; }, "That took part.")
      .def_property_readonly(
          "lost_poses", [](const WandResult& self) { return self.report.lost_poses; },
          "Names of poses that contradict the rest and took no part.")
      .def_property_readonly(
          "gross_readings", [](const WandResult& self) { return self.report.gross_readings; },
          "That were left out, of all poses.")
      .def_property_readonly(
          "gross_points", [](const WandResult& self) { return self.report.gross_points; },
          "Surveyed points that contradict the rest.")
      .def_property_readonly(
          "shapes",
          [](const py::object& self) {
            return PartsOf(self, self.cast<WandResult&>().report.shapes);
          },
          "List of WandShape, the widest first.")
      .def_property_readonly(
          "length_error",
          [](const WandResult& self) { return LengthColumn(self, &calib::WandLength::error); },
          "(h,) found less stated length of the bar in poses that took no part [m].")
      .def_property_readonly(
          "length_sigma",
          [](const WandResult& self) { return LengthColumn(self, &calib::WandLength::predicted); },
          "(h,) standard deviations of those [m].")
      .def_property_readonly(
          "distance_sigma", [](const WandResult& self) { return self.report.distance_sigma; },
          "Of the distance of two found points by the calibration, typical of the volume [m].")
      .def_property_readonly(
          "chi_square", [](const WandResult& self) { return self.report.chi_square; },
          "Sum of the squared residuals of readings, bar and survey, each in its sigma [-].")
      .def_property_readonly(
          "degrees_of_freedom",
          [](const WandResult& self) { return self.report.degrees_of_freedom; },
          "What chi_square is expected to be [-].")
      .def("__repr__", [](const WandResult& self) {
        return fmt::format("<unfurl.WandCalibration: {}, {}, {}>", self.rig->data.verdict,
                           Plural(self.report.cameras.size(), "camera"),
                           Plural(static_cast<std::size_t>(self.report.poses), "pose"));
      });
}

}  // namespace

void BindWand(py::module_& m) {
  BindWandReadings(m);
  BindWandParts(m);
  BindWandResult(m);
  const calib::WandOptions defaults;
  m.def(
      "calibrate_wand", &CalibrateWand, py::arg("readings"), py::arg("bar"), py::kw_only(),
      py::arg("bar_sigma") = 0.0, py::arg("points") = py::none(), py::arg("lens") = "rectilinear",
      py::arg("order") = "auto", py::arg("need") = 0.0, py::arg("folds") = defaults.folds,
      py::arg("seed") = defaults.fit.guess.seed, py::arg("workers") = 0,
      py::arg("lenses") = py::none(), py::arg("start") = py::none(), py::arg("layout") = py::none(),
      py::arg("frame") = std::vector<std::string>(), py::arg("plumb") = "", py::arg("origin") = "",
      py::arg("progress") = py::none(),
      "A rig from readings of a bar that was moved by hand (a Wand or a path); no station.\n\n"
      "bar: '0.7501m+-0.1mm', or its length [m] with bar_sigma, its standard deviation [m]; of\n"
      "more than two marks the distances from the first. points: a Survey of three points or\n"
      "more for the frame (or a path). lens, order, need, folds, seed, workers: as of calibrate;\n"
      "order 'auto' is the usual set of terms. lenses: a rig of the same cameras, calibrated\n"
      "before they were moved. start: a rig of before to start from. layout: a Lab that says\n"
      "where the cameras were meant to stand. frame: three cameras that give it, origin, x\n"
      "towards, y towards. plumb, origin: poses that do, in the first of which the bar hung\n"
      "plumb, its first mark above. progress(done): is called with the share that is done.\n"
      "A calibration that is not good is a result: see verdict and reasons.");
}

}  // namespace unfurl::python
