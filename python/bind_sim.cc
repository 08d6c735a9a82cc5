#include <fmt/format.h>

#include <fstream>
#include <sstream>

#include "base/error.h"
#include "base/progress.h"
#include "data/modes.h"
#include "data/run.h"
#include "data/scene.h"
#include "python/bindings.h"
#include "python/scene_object.h"
#include "sim/dynamics/observables.h"
#include "sim/implicit/find_modes.h"
#include "sim/methods/events.h"
#include "sim/record/record.h"

namespace unfurl::python {
namespace {

using Run = Recorded<data::Run>;

struct Model {
  std::shared_ptr<const sim::Model> model;
  std::shared_ptr<Scene> scene;
};

struct Modes {
  data::ModesRecord record;
  std::optional<sim::SceneModes> found;  // none: read from a file
  std::vector<Source> sources;
};

// What an observer is shown: one sample of every quantity, its own copy.
struct Sample {
  double t = 0.0;
  std::shared_ptr<const std::vector<std::string>> names;
  std::vector<double> values;
};

Scene ReadScene(const fs::path& path, const py::object& set) {
  Scene out;
  out.scene = data::ReadScene(path.string(), OverridesFrom(set));
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  out.text = text.str();
  for (const std::string& file : out.scene.files) out.sources.push_back(SourceOf(file));
  return out;
}

Model ModelFrom(const py::object& object, const py::object& set) {
  if (py::isinstance<Model>(object)) {
    if (set.is_none()) return object.cast<Model&>();
    throw Error("keys are set where a scene is read", "set", "use read_scene(path, set=..)");
  }
  const auto scene = SceneFrom(object, set);
  return {sim::CompileModel(scene->scene), scene};
}

data::RunEvent EventOf(const sim::Model& model, const sim::Event& event) {
  data::RunEvent out{event.t, sim::EventName(event.kind), sim::PlaceOf(model, event), {}};
  if (event.kind == sim::EventKind::kWatch) {
    out.data["direction [1]"] = event.upper ? 1.0 : -1.0;
    return out;
  }
  out.data["theta_rate [rad/s]"] = event.theta_rate;
  if (event.kind == sim::EventKind::kContactEnd) {
    out.data["duration [s]"] = event.duration;
    out.data["restitution [1]"] = event.restitution;
  }
  return out;
}

// Hands what happens to Python callables. An exception there ends the run and is raised by
// simulate.
class PythonObserver : public sim::Observer {
 public:
  PythonObserver(const sim::Model& model, const std::vector<std::string>& quantities,
                 const py::object& on_sample, const py::object& on_event,
                 const py::object& progress)
      : model_(model),
        on_sample_(Shared(on_sample)),
        on_event_(Shared(on_event)),
        progress_(Shared(progress)) {
    if (on_sample_ == nullptr) return;
    observables_ = std::make_unique<sim::Observables>(model, quantities);
    auto names = std::make_shared<std::vector<std::string>>();
    for (const data::Quantity& quantity : observables_->quantities()) {
      names->push_back(quantity.name);
    }
    names_ = std::move(names);
  }

  void OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) override {
    if (on_sample_ == nullptr) return;
    const std::vector<double>& row = observables_->Row(t, state, modes);
    errors_.Call([&] { (*on_sample_)(Sample{t, names_, row}); });
  }
  void OnEvent(const sim::Event& event) override {
    if (on_event_ != nullptr) errors_.Call([&] { (*on_event_)(EventOf(model_, event)); });
  }
  void OnProgress(double fraction) override {
    ThrowIfInterrupted();
    if (progress_ != nullptr) errors_.Call([&] { (*progress_)(fraction); });
  }

  CallbackError& errors() { return errors_; }

 private:
  const sim::Model& model_;
  std::shared_ptr<py::object> on_sample_, on_event_, progress_;
  std::unique_ptr<sim::Observables> observables_;
  std::shared_ptr<const std::vector<std::string>> names_;
  CallbackError errors_;
};

struct SimulateArguments {
  std::optional<double> duration, rate, rtol;
  std::optional<std::string> method;
  std::vector<std::string> quantities;
  std::optional<fs::path> output;
};

sim::RecordOptions OptionsOf(const Model& model, const SimulateArguments& arguments) {
  if (arguments.duration && !(*arguments.duration > 0.0)) {
    throw Error(fmt::format("{} is not a duration", *arguments.duration), "duration",
                "use a positive number of seconds");
  }
  sim::SimulateOptions simulate =
      sim::SolverOptions(model.scene->scene, arguments.duration.value_or(0.0));
  if (arguments.method) simulate.method = sim::MethodOf(*arguments.method);
  if (arguments.rtol) simulate.rtol = *arguments.rtol;
  if (arguments.rate) simulate.rate = *arguments.rate;
  sim::RecordOptions options;
  options.simulate = simulate;
  options.quantities = arguments.quantities;
  if (arguments.output) {
    options.provenance = ProvenanceOf(model.scene->sources);
    options.provenance.options["method"] = sim::MethodName(simulate.method);
    options.provenance.options["rtol"] = fmt::format("{}", simulate.rtol);
    options.provenance.options["rate"] = fmt::format("{}", simulate.rate);
  }
  return options;
}

Run Simulate(const py::object& scene, const py::object& set, std::optional<double> duration,
             std::optional<double> rate, std::optional<double> rtol,
             const std::optional<std::string>& method, std::vector<std::string> quantities,
             const std::optional<fs::path>& output, const py::object& observer,
             const py::object& on_event, const py::object& progress) {
  const Model model = ModelFrom(scene, set);
  const SimulateArguments arguments{duration, rate, rtol, method, std::move(quantities), output};
  sim::RecordOptions options = OptionsOf(model, arguments);
  PythonObserver watching(*model.model, arguments.quantities, observer, on_event, progress);
  options.observer = &watching;
  return LongWithCallbacks(watching.errors(), [&] {
    sim::Recording recording =
        sim::Record(model.model, options, output.value_or("").string(), model.scene->text);
    if (recording.status == "interrupted") throw Interrupted();
    if (!output) return Run{std::move(recording.run), model.scene->sources};
    return Run{data::ReadRun(recording.path, true), model.scene->sources};
  });
}

Modes FindModes(const py::object& scene_or_path, const py::object& set, int count,
                const std::string& state, std::optional<double> at, bool as_is, bool mesh_error) {
  const auto scene = SceneFrom(scene_or_path, set);
  sim::ModesOptions options;
  options.count = count;
  options.state = sim::ModesStateOf(state);
  options.at = at;
  options.find_equilibrium = !as_is;
  options.mesh_error = mesh_error;
  options.Check();
  return Long([&] {
    sim::SceneModes found = sim::FindModes(scene->scene, options);
    return Modes{found.record, std::move(found), scene->sources};
  });
}

template <class Value>
py::array_t<double> OfModes(const Modes& modes, Value data::ModesRecord::Mode::*member) {
  std::vector<double> values;
  for (const auto& mode : modes.record.modes) values.push_back(mode.*member);
  return Owned(std::move(values));
}

py::array_t<double> Shapes(const Modes& modes) {
  const data::ModesRecord& record = modes.record;
  py::array_t<double> out({record.modes.size(), record.places.size(), std::size_t{3}});
  double* to = out.mutable_data();
  for (const auto& mode : record.modes) {
    for (const auto& pose : mode.shape) to = std::copy(pose.begin(), pose.end(), to);
  }
  return out;
}

template <class Named>
std::vector<std::string> NamesOf(const std::vector<Named>& all) {
  std::vector<std::string> names;
  names.reserve(all.size());
  for (const Named& one : all) names.push_back(one.name);
  return names;
}

void BindScene(py::module_& m) {
  py::class_<Scene, std::shared_ptr<Scene>>(
      m, "Scene", "A planar flexible mechanism as a person wrote it; keys: docs/scene.md.")
      .def_property_readonly("name", [](const Scene& s) { return s.scene.name; })
      .def_property_readonly("path", [](const Scene& s) { return FileText(s.scene.path); })
      .def_property_readonly(
          "text", [](const Scene& s) { return s.text; }, "The file's text.")
      .def_property_readonly(
          "duration", [](const Scene& s) { return s.scene.duration; }, "[s]")
      .def_property_readonly("bodies", [](const Scene& s) { return NamesOf(s.scene.bodies); })
      .def_property_readonly("beams", [](const Scene& s) { return NamesOf(s.scene.beams); })
      .def_property_readonly("joints", [](const Scene& s) { return NamesOf(s.scene.joints); })
      .def_property_readonly("marks", [](const Scene& s) { return NamesOf(s.scene.marks); })
      .def("__repr__", [](const Scene& s) {
        return fmt::format(
            "<unfurl.Scene '{}': {}, {}, {}, {:g} s>", s.scene.name,
            s.scene.bodies.size() == 1 ? "1 body" : fmt::format("{} bodies", s.scene.bodies.size()),
            Plural(s.scene.beams.size(), "beam"), Plural(s.scene.joints.size(), "joint"),
            s.scene.duration);
      });
  m.def("read_scene", &ReadScene, py::arg("path"), py::kw_only(), py::arg("set") = py::none(),
        "A scene (TOML). set: other values for some of its keys, {'beam.beam1.segments': 8}.");
  m.def(
      "parse_scene",
      [](const std::string& text, const std::string& name) {
        return Scene{data::ParseScene(text, name), text, {}};
      },
      py::arg("text"), py::arg("name") = "scene", "A scene from TOML in a string.");

  py::class_<Model, std::shared_ptr<Model>>(m, "Model", "A scene made ready to be simulated.")
      .def_property_readonly("name", [](const Model& s) { return s.model->name; })
      .def_property_readonly(
          "duration", [](const Model& s) { return s.model->duration; }, "[s]")
      .def_property_readonly("joints", [](const Model& s) { return NamesOf(s.model->joints); })
      .def_property_readonly("marks", [](const Model& s) { return NamesOf(s.model->marks); })
      .def_property_readonly("warnings", [](const Model& s) { return s.model->warnings; })
      .def("__repr__", [](const Model& s) {
        return fmt::format("<unfurl.Model '{}': {} moving bodies, {}>", s.model->name,
                           s.model->DynamicBodies(), Plural(s.model->joints.size(), "joint"));
      });
  m.def(
      "compile",
      [](const py::object& scene, const py::object& set) { return ModelFrom(scene, set); },
      py::arg("scene"), py::kw_only(), py::arg("set") = py::none(),
      "A Model of a scene (or of its path): loops closed, places found, redundancy refused.");
}

void BindSimulate(py::module_& m) {
  py::class_<Sample>(m, "Sample", "One sample of a run, as an observer sees it.")
      .def_readonly("t", &Sample::t, "[s]")
      .def(
          "keys", [](const Sample& s) { return *s.names; }, "Names of the quantities.")
      .def_property_readonly(
          "values", [](const py::object& self) { return View(self.cast<Sample&>().values, self); },
          "(q,) in the order of keys().")
      .def("__len__", [](const Sample& s) { return s.values.size(); })
      .def("__getitem__",
           [](const Sample& s, const std::string& name) {
             const auto found = std::find(s.names->begin(), s.names->end(), name);
             if (found == s.names->end()) RefuseName("quantity", name, *s.names);
             return s.values[static_cast<std::size_t>(found - s.names->begin())];
           })
      .def("__repr__", [](const Sample& s) {
        return fmt::format("<unfurl.Sample: t = {:g} s, {} quantities>", s.t, s.values.size());
      });
  m.def(
      "simulate", &Simulate, py::arg("scene"), py::kw_only(), py::arg("set") = py::none(),
      py::arg("duration") = py::none(), py::arg("rate") = py::none(), py::arg("rtol") = py::none(),
      py::arg("method") = py::none(), py::arg("quantities") = std::vector<std::string>{},
      py::arg("output") = py::none(), py::arg("observer") = py::none(),
      py::arg("on_event") = py::none(), py::arg("progress") = py::none(),
      "The motion of a scene (a Scene, a Model or a path), every quantity in time.\n\n"
      "set: other values for keys of the scene, where a path is given. duration [s], rate: "
      "samples\n"
      "per second [1/s], rtol: error allowed per step, method: 'auto', 'projected', 'partitioned'\n"
      "or 'implicit'; each the scene's, if it is not given. quantities: what to keep, '*' and '?'\n"
      "standing for letters. output: also write the run, beams' shapes included (HDF5).\n"
      "observer(sample), on_event(event), progress(done) are called on the way; an exception in\n"
      "one ends the run and is raised here.\n"
      "A run that fails on the way is a result: see status and message.");
}

void BindModes(py::module_& m) {
  py::class_<Modes>(m, "Modes", "Natural modes of a scene about a state at rest.")
      .def("__len__", [](const Modes& s) { return s.record.modes.size(); })
      .def_property_readonly(
          "frequency",
          [](const Modes& s) { return OfModes(s, &data::ModesRecord::Mode::frequency); },
          "(n,) undamped natural frequencies; 0 for an unstable motion [Hz].")
      .def_property_readonly(
          "damping", [](const Modes& s) { return OfModes(s, &data::ModesRecord::Mode::damping); },
          "(n,) damping ratios [-].")
      .def_property_readonly(
          "growth", [](const Modes& s) { return OfModes(s, &data::ModesRecord::Mode::growth); },
          "(n,) of unstable motions [1/s].")
      .def_property_readonly(
          "error", [](const Modes& s) { return OfModes(s, &data::ModesRecord::Mode::error); },
          "(n,) what the mesh leaves wrong of frequency [Hz] or growth [1/s], as a finer one has\n"
          "it; NaN: not known.")
      .def_property_readonly(
          "places", [](const Modes& s) { return s.record.places; },
          "Names of the k places: bodies, segments of beams, marks.")
      .def_property_readonly("shape", &Shapes,
                             "(n, k, 3) dx, dy [m], dtheta [rad]; the largest displacement is 1 m.")
      .def_property_readonly(
          "rigid",
          [](const Modes& s) { return s.found ? std::optional(s.found->rigid) : std::nullopt; },
          "Motions without stiffness or slower than rigid_below, left out. None: read from a "
          "file,\n"
          "which does not say.")
      .def_property_readonly(
          "rigid_below",
          [](const Modes& s) {
            return s.found ? std::optional(s.found->rigid_below) : std::nullopt;
          },
          "Below it rounding hides a stiffness [Hz]; 0 where it hides none. None: read from a "
          "file.")
      .def_property_readonly(
          "rounding",
          [](const Modes& s) { return s.found ? std::optional(s.found->rounding) : std::nullopt; },
          "The largest error that rounding leaves of a frequency, of itself. None: read from a "
          "file.")
      .def_property_readonly(
          "latched",
          [](const Modes& s) { return s.found ? std::optional(s.found->latched) : std::nullopt; },
          "Whether every latch was closed first. None: read from a file.")
      .def_property_readonly(
          "usable",
          [](const Modes& s) { return s.found ? std::optional(s.found->usable) : std::nullopt; },
          "Whether an equilibrium was found, or none was asked for. None: read from a file.")
      .def(
          "write",
          [](const Modes& s, const fs::path& path) {
            data::WriteModes(path.string(), s.record, ProvenanceOf(s.sources));
          },
          py::arg("path"), "Writes them: .h5 or .csv.")
      .def("__repr__", [](const Modes& s) {
        std::string first;
        for (const auto& mode : s.record.modes) {
          if (first.size() > 40) {
            first += ", ..";
            break;
          }
          first += fmt::format("{}{:.4g}", first.empty() ? "" : ", ", mode.frequency);
        }
        return fmt::format("<unfurl.Modes: {} at {} Hz{}>", Plural(s.record.modes.size(), "mode"),
                           first.empty() ? "no" : first,
                           !s.found || s.found->usable ? "" : ", no equilibrium: not usable");
      });
  m.def("modes", &FindModes, py::arg("scene"), py::kw_only(), py::arg("set") = py::none(),
        py::arg("count") = 12, py::arg("state") = "auto", py::arg("at") = py::none(),
        py::arg("as_is") = false, py::arg("mesh_error") = true,
        "Equilibrium, natural frequencies and shapes of a scene (or a path).\n\n"
        "state: 'drawn', 'latched' (every latch closed) or 'auto'. at: start from what a run "
        "reaches\n"
        "at this time [s]. as_is: look for no equilibrium. mesh_error: find what the mesh\n"
        "leaves wrong, from a finer one.");
}

}  // namespace

std::shared_ptr<Scene> SceneFrom(const py::object& object, const py::object& set) {
  if (!py::isinstance<Scene>(object)) {
    return std::make_shared<Scene>(ReadScene(PathFrom(object, "a Scene or a path"), set));
  }
  if (!set.is_none()) {
    throw Error("keys are set where a scene is read", "set", "use read_scene(path, set=..)");
  }
  return object.cast<std::shared_ptr<Scene>>();
}

py::object LoadScene(const fs::path& path) {
  return py::cast(std::make_shared<Scene>(ReadScene(path, py::none())));
}

py::object LoadModes(const fs::path& path) {
  return py::cast(Modes{data::ReadModes(path.string()), std::nullopt, {SourceOf(path)}});
}

void BindSim(py::module_& m) {
  BindScene(m);
  BindSimulate(m);
  BindModes(m);
}

}  // namespace unfurl::python
