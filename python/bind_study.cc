#include <fmt/format.h>

#include "base/error.h"
#include "data/study.h"
#include "python/bindings.h"
#include "python/fit_object.h"
#include "study/fit_study.h"
#include "study/repeat.h"

namespace unfurl::python {
namespace {

void AddSources(const data::Provenance& from, Fit* fit) {
  for (const data::InputFile& input : from.inputs) fit->sources.push_back(SourceOf(input.path));
}

Fit FitStudy(const py::object& study_or_path, const py::object& set,
             const std::optional<fs::path>& tracks, const std::optional<fs::path>& output,
             bool resume, std::size_t workers, bool compare, bool allow_programs,
             const py::object& progress, std::optional<bool> repeat) {
  data::Study study = StudyFrom(study_or_path, set);
  study.repeat.wanted = repeat.value_or(study.repeat.wanted);
  if (study.repeat.wanted && compare) {
    throw Error("compares one trial with one model, and here every trial has its own", "compare",
                "leave it out");
  }
  CallbackError errors;
  study::FitStudyOptions options;
  options.tracks = tracks.value_or("").string();
  options.output = output.value_or("").string();
  options.resume = resume;
  options.workers = workers;
  options.compare = compare;
  options.allow_programs = allow_programs;
  options.provenance = ProvenanceOf({});
  options.progress = FitProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    if (!study.repeat.wanted) return FitOf(study::Fit(study, options), compare);
    study::RepeatFit fitted = study::FitRepeat(study, options);
    Fit fit;
    fit.data = std::move(fitted.record);
    AddSources(fitted.provenance, &fit);
    return fit;
  });
}

}  // namespace

Fit FitOf(study::StudyFit fitted, bool compare) {
  Fit fit;
  fit.data = std::move(fitted.record);
  AddSources(fitted.provenance, &fit);
  if (compare && fitted.Usable()) {
    fit.comparison = std::make_shared<correlate::Comparison>(std::move(fitted.comparison));
  }
  return fit;
}

data::Study StudyFrom(const py::object& study_or_path, const py::object& set) {
  if (!py::isinstance<data::Study>(study_or_path)) {
    return data::ReadStudy(PathFrom(study_or_path, "a Study or a path").string(),
                           OverridesFrom(set));
  }
  if (!set.is_none()) {
    throw Error("keys are set where a study is read", "set", "use read_study(path, set=..)");
  }
  return study_or_path.cast<data::Study&>();
}

py::object LoadStudy(const fs::path& path) {
  return py::cast(std::make_shared<data::Study>(data::ReadStudy(path.string())));
}

void BindStudy(py::module_& m) {
  py::class_<data::Study, std::shared_ptr<data::Study>>(
      m, "Study", "What is to be learnt from which trial with which model; keys: docs/study.md.")
      .def_readonly("name", &data::Study::name)
      .def_property_readonly("path", [](const data::Study& s) { return FileText(s.path); })
      .def_property_readonly(
          "scene", [](const data::Study& s) { return FileText(s.scene); },
          "Path of the scene; empty: a program.")
      .def_property_readonly(
          "parameters",
          [](const data::Study& s) {
            std::vector<std::string> names;
            for (const data::StudyParameter& p : s.parameters) names.push_back(p.name);
            return names;
          },
          "Their names.")
      .def("__repr__", [](const data::Study& s) {
        return fmt::format("<unfurl.Study '{}': {}, {}>", s.name,
                           Plural(s.parameters.size(), "parameter"),
                           Plural(s.trials.size(), "trial"));
      });
  m.def(
      "read_study",
      [](const fs::path& path, const py::object& set) {
        return data::ReadStudy(path.string(), OverridesFrom(set));
      },
      py::arg("path"), py::kw_only(), py::arg("set") = py::none(),
      "A study (TOML). set: other values for some of its keys.");
  m.def(
      "fit_study", &FitStudy, py::arg("study"), py::kw_only(), py::arg("set") = py::none(),
      py::arg("tracks") = py::none(), py::arg("output") = py::none(), py::arg("resume") = false,
      py::arg("workers") = 0, py::arg("compare") = false, py::arg("allow_programs") = false,
      py::arg("progress") = py::none(), py::arg("repeat") = py::none(),
      "The parameters of a study (a Study or a path), from its trials.\n\n"
      "tracks: a file of tracks in place of the study's. output: also write the fit (HDF5); an\n"
      "interrupted fit leaves OUTPUT.partial, which resume=True takes over. workers: simulations\n"
      "at a time, 0 for one per core; changes no result. compare: also compare trial and model at\n"
      "the estimate. allow_programs: run the program that a study names as its model (only of a "
      "study\n"
      "that you trust). progress(FitProgress) is called now and then, from any thread. repeat: "
      "whether\n"
      "the trials are deployments that differ (mean, scatter and the next one: Fit.repeat); None: "
      "as\nthe study says.");
}

}  // namespace unfurl::python
