#include <fmt/format.h>

#include <limits>
#include <map>
#include <utility>

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

// A change of light, with the names that its indices mean.
struct LightChange {
  data::TrialLight change;
  std::string kind, camera, mark;
};

std::vector<LightChange> LightOf(const TrialHealth& health) {
  constexpr const char* kKinds[] = {"led", "gain", "focus", "all_light"};
  std::vector<LightChange> out;
  for (const data::TrialLight& one : health.light) {
    const auto name = [](const std::vector<std::string>& names, std::int32_t at) {
      return at < 0 ? std::string() : names[static_cast<std::size_t>(at)];
    };
    out.push_back(
        {one, kKinds[one.kind], name(health.cameras, one.camera), name(health.marks, one.mark)});
  }
  return out;
}

void BindLight(py::module_& m) {
  const auto number = [](double data::TrialLight::*member) {
    return [member](const LightChange& self) { return self.change.*member; };
  };
  py::class_<LightChange>(m, "LightChange", "Light or focus that changed within a trial.")
      .def_property_readonly(
          "words", [](const LightChange& self) { return self.change.words; }, "What it is.")
      .def_readonly("kind", &LightChange::kind, "'led', 'gain', 'focus' or 'all_light'.")
      .def_readonly("camera", &LightChange::camera, "Its name; '': all.")
      .def_readonly("mark", &LightChange::mark, "Its name; '': all.")
      .def_property_readonly(
          "certain", [](const LightChange& self) { return self.change.certain != 0; },
          "False: something else explains it as well.")
      .def_property_readonly("earliest", number(&data::TrialLight::from),
                             "It began between this [s] and latest.")
      .def_property_readonly("latest", number(&data::TrialLight::to), "See earliest [s].")
      .def_property_readonly("until", number(&data::TrialLight::until), "When it has its size [s].")
      .def_property_readonly("size", number(&data::TrialLight::size),
                             "Of brightness or width, relative [-]: -0.3 is 30% less.")
      .def_property_readonly("sigma", number(&data::TrialLight::sigma), "Its standard deviation.")
      .def("__repr__",
           [](const LightChange& self) { return "<LightChange " + self.change.words + ">"; });
}

// How readings scatter over what is stated.
struct ReadingScatter {
  std::string words, unknown;
  bool wide = false;
  double factor = 0.0, sigma = 0.0;
  std::map<std::string, std::pair<double, double>> cameras;
  std::map<std::string, std::map<std::string, double>> marks;
  std::string wrong;
  std::map<std::string, int> wrong_readings;
};

ReadingScatter ScatterOf(const TrialHealth& health) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const bool known = health.scatter_unknown.empty();
  ReadingScatter out{health.scatter_words, health.scatter_unknown, health.scatter_wide,
                     known ? health.scatter : kNone, known ? health.scatter_sigma : kNone};
  out.wrong = health.wrong_words;
  for (std::size_t c = 0; c < health.wrong.size(); ++c) {
    out.wrong_readings[health.cameras[c]] = health.wrong[c];
  }
  for (std::size_t c = 0; c < health.camera_scatter.size(); ++c) {
    out.cameras[health.cameras[c]] = {health.camera_scatter[c], health.camera_scatter_sigma[c]};
  }
  for (Eigen::Index k = 0; k < health.mark_scatter.size(); ++k) {
    const Eigen::Index c = k % health.mark_scatter.cols(), m = k / health.mark_scatter.cols();
    out.marks[health.marks[static_cast<std::size_t>(m)]]
             [health.cameras[static_cast<std::size_t>(c)]] = health.mark_scatter(m, c);
  }
  return out;
}

void BindScatter(py::module_& m) {
  py::class_<ReadingScatter>(m, "ReadingScatter",
                             "By how much readings scatter over what is stated of them.")
      .def_readonly("words", &ReadingScatter::words, "In words.")
      .def_readonly("unknown", &ReadingScatter::unknown,
                    "Why nothing can be told; empty: it was looked at.")
      .def_readonly("wide", &ReadingScatter::wide,
                    "They scatter more than stated, and covariances are widened by that.")
      .def_readonly("factor", &ReadingScatter::factor, "Of all readings [-]; NaN: unknown.")
      .def_readonly("sigma", &ReadingScatter::sigma, "Standard deviation of factor [-].")
      .def_readonly("cameras", &ReadingScatter::cameras,
                    "Where wide: by camera, by which its stated sigmas were multiplied and the "
                    "standard deviation of that [-].")
      .def_readonly("marks", &ReadingScatter::marks,
                    "Where wide: by mark and camera, by which the stated sigmas of its readings "
                    "were multiplied [-].")
      .def_readonly("wrong", &ReadingScatter::wrong,
                    "Readings of three that were left out, in words; empty: none.")
      .def_readonly("wrong_readings", &ReadingScatter::wrong_readings,
                    "By camera, how many readings were left out because they depart from the "
                    "course of their mark where no other camera vouches for them; empty: nobody "
                    "looked.")
      .def("__repr__",
           [](const ReadingScatter& self) { return "<ReadingScatter: " + self.words + ">"; });
}

}  // namespace

void BindHealth(py::module_& m) {
  BindLight(m);
  BindScatter(m);
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
      .def_property_readonly("scatter", &ScatterOf,
                             "How the readings scatter over what is stated, ReadingScatter.")
      .def_property_readonly("light", &LightOf, "Changes of light and focus, list of LightChange.")
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
