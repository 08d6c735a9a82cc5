#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "data/formats.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/survey.h"
#include "data/trial.h"
#include "measure/camera_model.h"
#include "measure/survey_readings.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Survey = Recorded<data::Survey>;
using Rig = Recorded<data::Rig>;

std::vector<std::string> SetUpsFrom(const py::object& set_up, std::size_t points) {
  std::vector<std::string> out = NamesFrom(set_up, "set_up");
  if (out.size() != points) {
    throw py::value_error(
        fmt::format("id and set_up: expected the same length, got {} and {}", points, out.size()));
  }
  if (std::count(out.begin(), out.end(), "") > 0) {
    throw py::value_error("set_up: expected a name for each point");
  }
  return out;
}

Survey MakeSurvey(const py::object& ids, const py::object& p, const py::object& u,
                  const py::object& s, const py::object& camera_names, const py::object& sigma,
                  const py::object& cov, const py::object& set_up) {
  const std::vector<std::string> id = NamesFrom(ids, "id");
  const std::vector<std::string> cameras = NamesFrom(camera_names, "cameras");
  Survey out;
  data::Survey& d = out.data;
  d.id = id;
  d.p = PointsFrom(p, {3}, "p");
  d.cameras = cameras;
  const Eigen::Index n = d.p.cols();
  if (static_cast<Eigen::Index>(id.size()) != n) {
    throw py::value_error(
        fmt::format("id and p: expected the same length, got {} and {}", id.size(), n));
  }
  if (std::set<std::string>(id.begin(), id.end()).size() != id.size()) {
    throw py::value_error("id: expected a different name for each point");
  }
  if (!d.p.allFinite()) throw py::value_error("p: expected finite numbers");
  if (cov.is_none() == sigma.is_none()) {
    throw py::value_error("give either cov, shape (n, 6) [m^2], or sigma, one number [m]");
  }
  if (cov.is_none()) {
    if (!IsNumber(sigma)) throw py::type_error("sigma: expected one number [m]");
    const double each = sigma.cast<double>();
    if (!(each > 0.0) || !std::isfinite(each)) {
      throw py::value_error("sigma: expected a positive number");
    }
    d.cov.setZero(6, n);
    for (const Eigen::Index k : {0, 3, 5}) d.cov.row(k).setConstant(each * each);
  } else {
    d.cov = PointsFrom(cov, {6}, "cov");
  }
  ReadingsFrom(u, s, cameras.size(), &d.u_px, &d.s_px);
  if (d.cov.cols() != n || d.u_px.rows() != n) {
    throw py::value_error("p, cov and u: expected the same number of rows");
  }
  if (!set_up.is_none()) d.set_up = SetUpsFrom(set_up, id.size());
  if (!d.cov.allFinite()) throw py::value_error("cov: expected finite numbers");
  return out;
}

void WriteSurvey(const Survey& survey, const fs::path& path) {
  if (data::FormatOf(path.string()) == data::FileFormat::kCsv) {
    data::Survey readings = survey.data;  // a CSV holds numbers, not lines
    measure::FindSurveyReadings(&readings);
    data::WriteSurveyCsv(path.string(), readings);
  } else {
    data::WriteSurvey(path.string(), survey.data, ProvenanceOf(survey.sources));
  }
}

void BindSurvey(py::module_& m) {
  py::class_<Survey, std::shared_ptr<Survey>>(
      m, "Survey",
      "n points that a total station measured, and what each of c cameras saw of them.")
      .def(py::init(&MakeSurvey), py::arg("id"), py::arg("p"), py::arg("u"), py::arg("s"),
           py::kw_only(), py::arg("cameras"), py::arg("sigma") = py::none(),
           py::arg("cov") = py::none(), py::arg("set_up") = py::none(),
           "A survey of your own.\n\n"
           "id: n names. p: (n, 3) in the station's frame [m]. u: (n, c) readings [px], NaN: not\n"
           "seen. s: (n, c) or one number, their standard deviations [px]. cameras: c names. "
           "sigma:\n"
           "of the station per axis [m], or cov: (n, 6) xx, xy, xz, yy, yz, zz [m^2]. set_up: n\n"
           "names of the station's set-ups, where it was moved; None: all from one.")
      .def(PickledAsFile<data::Survey>(&data::WriteSurvey, &data::ReadSurvey))
      .def("__len__", [](const Survey& self) { return self.data.size(); })
      .def_property_readonly(
          "id", [](const Survey& self) { return self.data.id; }, "n names.")
      .def_property_readonly(
          "set_up", [](const Survey& self) { return self.data.set_up; },
          "n names of the station's set-ups; empty: all points are from one.")
      .def_property_readonly(
          "cameras", [](const Survey& self) { return self.data.cameras; }, "c names.")
      .def_property_readonly(
          "p",
          [](const py::object& self) { return PointsView<3>(self.cast<Survey&>().data.p, self); },
          "(n, 3) coordinates in the station's frame [m].")
      .def_property_readonly(
          "cov",
          [](const py::object& self) { return PointsView<6>(self.cast<Survey&>().data.cov, self); },
          "(n, 6) covariance: xx, xy, xz, yy, yz, zz [m^2].")
      .def_property_readonly(
          "u",
          [](const py::object& self) { return MatrixView(self.cast<Survey&>().data.u_px, self); },
          "(n, c) readings; NaN: not seen [px]. (0, 0) where there are raw lines only.")
      .def_property_readonly(
          "s",
          [](const py::object& self) { return MatrixView(self.cast<Survey&>().data.s_px, self); },
          "(n, c) their standard deviations [px].")
      .def_property_readonly(
          "has_lines", [](const Survey& self) { return self.data.has_lines(); },
          "Whether it holds raw lines, from which calibrate finds the readings.")
      .def_property_readonly(
          "notes", [](const Survey& self) { return self.data.notes; },
          "What was made of the file that it was read from.")
      .def("write", &WriteSurvey, py::arg("path"), "Writes it: .csv, else HDF5.")
      .def("__repr__", [](const Survey& self) {
        return fmt::format("<unfurl.Survey: {}, {}, {}>", Plural(self.data.size(), "point"),
                           Plural(self.data.cameras.size(), "camera"),
                           self.data.has_lines() ? "raw lines" : "readings");
      });
}

py::array_t<double> ReadingsOf(const Rig& rig, const py::object& points) {
  const Eigen::Matrix3Xd p = PointsFrom(points, {3}, "p");
  const auto& cameras = rig.data.cameras;
  const auto n = static_cast<py::ssize_t>(p.cols()), c = static_cast<py::ssize_t>(cameras.size());
  py::array_t<double> out({n, c});
  for (py::ssize_t j = 0; j < c; ++j) {
    const data::RigCamera& camera = cameras[static_cast<std::size_t>(j)];
    for (py::ssize_t i = 0; i < n; ++i) {
      double u = 0.0;
      const bool seen = p.col(i).allFinite() && measure::Project(camera, p.col(i), &u) &&
                        (camera.pixels == 0 || (u > -0.5 && u < camera.pixels - 0.5));
      out.mutable_at(i, j) = seen ? u : std::nan("");
    }
  }
  return out;
}

void BindRig(py::module_& m) {
  py::class_<data::RigCamera>(
      m, "RigCamera",
      "What is known of one camera: u = u0 + f x + terms, with x = X / Z and\n"
      "y = Y / (Z + e) of a point (X, Y, Z) in the camera's frame.")
      .def_readonly("name", &data::RigCamera::name)
      .def_property_readonly(
          "R_CW",
          [](const py::object& self) {
            constexpr py::ssize_t kSize = sizeof(double);
            return View(self.cast<data::RigCamera&>().R_CW.data(), {3, 3}, self,
                        {kSize, 3 * kSize});
          },
          "(3, 3) rotation from world to camera.")
      .def_property_readonly(
          "p_WC",
          [](const py::object& self) {
            return View(self.cast<data::RigCamera&>().p_WC.data(), {3}, self);
          },
          "(3,) centre of the slit in the world [m].")
      .def_property_readonly(
          "terms",
          [](const py::object& self) {
            const auto& terms = self.cast<data::RigCamera&>().terms_px;
            return View(terms.data(), {static_cast<py::ssize_t>(terms.size())}, self);
          },
          "(22,) coefficients of the lens' terms; docs/physics-optics.md has their order [px].")
      .def_readonly("f", &data::RigCamera::f_px, "Image scale [px].")
      .def_readonly("u0", &data::RigCamera::u0_px, "Reading on the optical axis [px].")
      .def_readonly("e", &data::RigCamera::e, "Distance between the two centres [m].")
      .def_readonly("pixels", &data::RigCamera::pixels,
                    "Of its row; readings lie from 0 to pixels - 1.")
      .def("__repr__", [](const data::RigCamera& c) {
        return fmt::format("<unfurl.RigCamera '{}': f = {:.2f} px, at ({:.3f}, {:.3f}, {:.3f}) m>",
                           c.name, c.f_px, c.p_WC.x(), c.p_WC.y(), c.p_WC.z());
      });

  py::class_<Rig, std::shared_ptr<Rig>>(
      m, "Rig",
      "What is known of c cameras: parameters with their joint covariance, and a verdict.")
      .def(PickledAsFile<data::Rig>(&data::WriteRig, &data::ReadRig))
      .def("__len__", [](const Rig& self) { return self.data.cameras.size(); })
      .def_property_readonly(
          "cameras",
          [](const py::object& self) {
            py::list cameras;
            for (const data::RigCamera& camera : self.cast<Rig&>().data.cameras) {
              cameras.append(py::cast(&camera, py::return_value_policy::reference_internal, self));
            }
            return cameras;
          },
          "List of RigCamera.")
      .def_property_readonly(
          "covariance",
          [](const py::object& self) {
            return MatrixView(self.cast<Rig&>().data.covariance, self);
          },
          "Joint covariance of all parameters, camera by camera: rotation vector (3) [rad], p_WC "
          "(3)\n"
          "[m], f, u0 [px], e [m], terms [px]; zeros for what was held fixed.")
      .def_property_readonly(
          "volume",
          [](const Rig& self) { return CornersOf(self.data.volume_low, self.data.volume_high); },
          "Corners of the box of the surveyed points, (3,) each [m].")
      .def_property_readonly(
          "model_floor", [](const Rig& self) { return self.data.model_floor_px; },
          "Largest of the cameras' model errors [px].")
      .def_property_readonly(
          "checks", [](const Rig& self) { return self.data.checks; },
          "Numbers by name with unit: {'held_out_rms [m]': 2.1e-4, ..}.")
      .def_property_readonly(
          "verdict", [](const Rig& self) { return self.data.verdict; },
          "'good', 'usable with care' or 'do not use'.")
      .def_property_readonly(
          "reasons", [](const Rig& self) { return self.data.reasons; }, "Why.")
      .def_property_readonly(
          "usable", [](const Rig& self) { return self.data.verdict != "do not use"; },
          "Whether the verdict is any but 'do not use'.")
      .def("readings", &ReadingsOf, py::arg("p"),
           "What the cameras read of points (n, 3) [m]: (n, c) [px]; NaN: not in front, or off the "
           "row.")
      .def(
          "write",
          [](const Rig& self, const fs::path& path) {
            data::WriteRig(path.string(), self.data, ProvenanceOf(self.sources));
          },
          py::arg("path"), "Writes it as HDF5.")
      .def("__repr__", [](const Rig& self) {
        return fmt::format("<unfurl.Rig: {}, {}>", Plural(self.data.cameras.size(), "camera"),
                           self.data.verdict.empty() ? "no verdict" : self.data.verdict);
      });
}

// Lines of a trial, with the block that holds them.
py::tuple LinesOf(const data::TrialReader& trial, py::ssize_t first, py::ssize_t count) {
  const auto n = static_cast<py::ssize_t>(trial.size());
  if (first < 0 || count < 0 || first + count > n) {
    throw py::index_error(fmt::format("lines {} to {} of {}", first, first + count, n));
  }
  auto* block = new data::TrialBlock;
  const py::capsule owner(block, [](void* p) { delete static_cast<data::TrialBlock*>(p); });
  {
    const py::gil_scoped_release released;
    trial.Read(static_cast<std::size_t>(first), static_cast<std::size_t>(count), block);
  }
  const auto cameras = static_cast<py::ssize_t>(trial.header().cameras.size());
  const auto elements =
      static_cast<py::ssize_t>(trial.header().line_counts()) / std::max<py::ssize_t>(cameras, 1);
  return py::make_tuple(View(block->t, owner), View(block->slot, owner),
                        View(block->counts.data(), {count, cameras, elements}, owner));
}

void BindTrial(py::module_& m) {
  py::class_<data::TrialReader, std::shared_ptr<data::TrialReader>>(
      m, "Trial", "Raw sensor lines with time stamps; read from its file as they are asked for.")
      .def("__len__", &data::TrialReader::size)
      .def_property_readonly("path",
                             [](const data::TrialReader& self) { return FileText(self.path()); })
      .def_property_readonly(
          "cameras", [](const data::TrialReader& self) { return self.header().cameras; },
          "c names.")
      .def_property_readonly(
          "lit", [](const data::TrialReader& self) { return self.header().slots; },
          "What a line may show: a mark's name, several joined by '+', or 'dark'.")
      .def_property_readonly(
          "line_rate", [](const data::TrialReader& self) { return self.header().line_rate; },
          "[1/s]")
      .def("lines", &LinesOf, py::arg("first"), py::arg("count"),
           "Lines [first, first + count) as (t, lit, counts): t (count,) middle of the flash on "
           "the\n"
           "recorder's clock [s]; lit (count,) index into self.lit; counts (count, c, elements).")
      .def("__repr__", [](const data::TrialReader& self) {
        return FileText(fmt::format(
            "<unfurl.Trial '{}': {} of {} at {:g} /s>", self.path(), Plural(self.size(), "line"),
            Plural(self.header().cameras.size(), "camera"), self.header().line_rate));
      });
}

void BindLab(py::module_& m) {
  py::class_<data::Lab, std::shared_ptr<data::Lab>>(
      m, "Lab", "The physical truth of a virtual experiment; only expose and plan read it.")
      .def_property_readonly("path", [](const data::Lab& self) { return FileText(self.path); })
      .def_readonly("seed", &data::Lab::seed)
      .def_property_readonly(
          "cameras",
          [](const data::Lab& self) {
            std::vector<std::string> names;
            for (const data::LabCamera& camera : self.cameras) names.push_back(camera.name);
            return names;
          },
          "Names of the cameras.")
      .def("__repr__", [](const data::Lab& self) {
        return FileText(
            fmt::format("<unfurl.Lab '{}': {}>", self.path, Plural(self.cameras.size(), "camera")));
      });
  m.def(
      "read_lab",
      [](const fs::path& path, const py::object& set) {
        return data::ReadLab(path.string(), OverridesFrom(set));
      },
      py::arg("path"), py::kw_only(), py::arg("set") = py::none(),
      "A laboratory (TOML). set: other values for some of its keys, {'led.peak': 0.5}.");
}

}  // namespace

std::shared_ptr<data::Lab> LabFrom(const py::object& object) {
  if (py::isinstance<data::Lab>(object)) return object.cast<std::shared_ptr<data::Lab>>();
  return std::make_shared<data::Lab>(data::ReadLab(PathFrom(object, "a Lab or a path").string()));
}

void BindOptics(py::module_& m) {
  BindSurvey(m);
  BindRig(m);
  BindTrial(m);
  BindLab(m);
}

}  // namespace unfurl::python
