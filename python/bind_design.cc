#include <fmt/format.h>

#include "base/error.h"
#include "data/design.h"
#include "data/lab.h"
#include "data/rig.h"
#include "measure/camera_model.h"
#include "python/bindings.h"
#include "python/fit_object.h"
#include "study/design.h"
#include "study/design_advice.h"

namespace unfurl::python {
namespace {

// A case, or a part of what was measured, with the parameters' names that its figures go by.
struct DesignCase {
  study::DesignCase found;
  std::vector<std::string> parameters;
  double factor = 0.0;
};

struct Contribution {
  correlate::Contribution found;
  std::vector<std::string> parameters;
};

struct Design {
  study::StudyDesign found;  // but for its fit
  std::shared_ptr<Fit> fit;
  bool usable = false;
  std::string advice;
  std::vector<DesignCase> schedule, marks, channels, trials;  // schedule: again, and the best cycle
};

py::dict ByName(const std::vector<std::string>& names, const std::vector<double>& values) {
  py::dict out;
  for (std::size_t j = 0; j < values.size(); ++j) out[py::str(names[j])] = values[j];
  return out;
}

std::vector<DesignCase> CasesOf(const study::StudyDesign& design,
                                const std::vector<study::DesignCase>& cases) {
  std::vector<DesignCase> out;
  out.reserve(cases.size());
  for (const study::DesignCase& one : cases) {
    out.push_back({one, design.tells.parameters, study::FactorOf(design, one)});
  }
  return out;
}

Design DesignStudy(const py::object& study_or_path, const py::object& set,
                   const py::object& candidates, const std::vector<std::string>& wanted,
                   const std::vector<std::string>& kept, const std::string& trial,
                   const py::object& lab_or_path, const py::object& rig_or_path, int stretches,
                   std::size_t workers, bool allow_programs, const py::object& progress) {
  study::DesignOptions options;
  options.wanted = wanted;
  options.kept = kept;
  options.trial = trial;
  options.stretches = stretches;
  options.workers = workers;
  options.allow_programs = allow_programs;
  const data::Study study = StudyFrom(study_or_path, set);
  if (!candidates.is_none()) {
    options.candidates = data::ReadDesign(PathFrom(candidates, "a path of candidates").string());
  }
  if (!lab_or_path.is_none()) {
    const auto lab = LabFrom(lab_or_path);
    options.cycle = lab->strobe.slots;
    options.line_rate = lab->strobe.line_rate;
  }
  if (!rig_or_path.is_none()) {
    const auto rig = RecordFrom<Recorded<data::Rig>>(rig_or_path, "a Rig", &data::ReadRig);
    for (const data::RigCamera& camera : rig->data.cameras) {
      options.cameras.names.push_back(camera.name);
    }
    options.cameras.gradient = [rig](std::size_t camera, const Eigen::Vector3d& p) {
      return measure::ReadingGradient(rig->data.cameras[camera], p);
    };
  }
  CallbackError errors;
  options.progress = StepProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    Design out;
    out.found = study::DesignStudy(study, options);
    out.usable = out.found.fit.Usable();
    if (out.usable) {
      out.advice = study::Advice(out.found);
      std::vector<study::DesignCase> again = {out.found.again};
      if (!out.found.cycle.empty()) again.push_back(out.found.schedule);
      out.schedule = CasesOf(out.found, again);
      out.marks = CasesOf(out.found, out.found.marks);
      out.channels = CasesOf(out.found, out.found.channels);
      out.trials = CasesOf(out.found, out.found.trials);
    }
    out.fit = std::make_shared<Fit>(FitOf(std::move(out.found.fit)));
    return out;
  });
}

std::vector<Contribution> Told(const Design& design,
                               const std::vector<correlate::Contribution>& parts) {
  std::vector<Contribution> out;
  out.reserve(parts.size());
  for (const correlate::Contribution& part : parts) {
    out.push_back({part, design.found.tells.parameters});
  }
  return out;
}

void BindDesignParts(py::module_& m) {
  py::class_<Contribution>(m, "Contribution", "A part of what was measured, and what it tells.")
      .def_property_readonly(
          "name", [](const Contribution& c) { return c.found.name; }, "Such as 'mark2'.")
      .def_property_readonly(
          "readings", [](const Contribution& c) { return c.found.readings; }, "How many.")
      .def_property_readonly(
          "share", [](const Contribution& c) { return ByName(c.parameters, c.found.share); },
          "Of the information about each parameter [-].")
      .def_property_readonly(
          "without", [](const Contribution& c) { return ByName(c.parameters, c.found.without); },
          "Standard error of each parameter without this part over that with all [-].")
      .def("__repr__", [](const Contribution& c) {
        return fmt::format("<unfurl.Contribution '{}': {}>", c.found.name,
                           Plural(c.found.readings, "reading"));
      });
  py::class_<DesignCase>(m, "DesignCase", "What could be measured next, and what it leaves open.")
      .def_property_readonly("name", [](const DesignCase& c) { return c.found.name; })
      .def_property_readonly(
          "message", [](const DesignCase& c) { return c.found.message; },
          "Why there are no figures; else empty.")
      .def_property_readonly(
          "alone", [](const DesignCase& c) { return ByName(c.parameters, c.found.alone); },
          "Standard error of each parameter by that trial alone [its unit].")
      .def_property_readonly(
          "together", [](const DesignCase& c) { return ByName(c.parameters, c.found.together); },
          "With what the study has [its unit].")
      .def_readonly("factor", &DesignCase::factor,
                    "Geometric mean of the wanted parameters' errors, together, over today's [-].")
      .def_property_readonly(
          "cycle", [](const DesignCase& c) { return c.found.cycle; },
          "Of the strobe, a mark or 'dark' in each line, where it has one of its own.")
      .def("__repr__", [](const DesignCase& c) {
        return c.found.message.empty()
                   ? fmt::format("<unfurl.DesignCase '{}': {:.3g} of today's errors>", c.found.name,
                                 c.factor)
                   : fmt::format("<unfurl.DesignCase '{}': {}>", c.found.name, c.found.message);
      });
}

template <class Cases>
auto ListOf(Cases Design::*member) {
  return [member](const py::object& self) { return PartsOf(self, self.cast<Design&>().*member); };
}

}  // namespace

void BindDesign(py::module_& m) {
  BindDesignParts(m);
  py::class_<Design>(m, "Design", "What a study's trials tell, and what would tell more.")
      .def_readonly("fit", &Design::fit, "Of the study.")
      .def_readonly("usable", &Design::usable, "Whether that fit is; else nothing is told.")
      .def_readonly("advice", &Design::advice, "What it comes to, in a sentence.")
      .def_property_readonly(
          "sigma", [](const Design& d) { return ByName(d.found.tells.parameters, d.found.now); },
          "Standard error of each parameter by the data at hand [its unit].")
      .def_property_readonly(
          "priors",
          [](const Design& d) { return ByName(d.found.tells.parameters, d.found.tells.priors); },
          "Share of each parameter's information that was known beforehand [-].")
      .def_property_readonly(
          "wanted", [](const Design& d) { return d.found.wanted; }, "Parameters that count.")
      .def_property_readonly(
          "series", [](const Design& d) { return Told(d, d.found.tells.series); },
          "List of Contribution: marks, channels, events.")
      .def_property_readonly(
          "times", [](const Design& d) { return Told(d, d.found.tells.times); },
          "List of Contribution: stretches of the record.")
      .def_property_readonly(
          "lines", [](const Design& d) { return Told(d, d.found.tells.lines); },
          "List of Contribution: lines of the strobe's cycle.")
      .def_property_readonly(
          "cameras", [](const Design& d) { return Told(d, d.found.tells.cameras); },
          "List of Contribution: cameras; without a rig empty.")
      .def_property_readonly(
          "cycle", [](const Design& d) { return d.found.cycle; },
          "Of the strobe as it is, a mark or 'dark' in each line; empty: it has none.")
      .def_property_readonly(
          "no_cycle", [](const Design& d) { return d.found.no_cycle; }, "Why it has none.")
      .def_property_readonly(
          "schedule", ListOf(&Design::schedule),
          "List of DesignCase: the same trial again, and with the best cycle of its marks.")
      .def_property_readonly("marks", ListOf(&Design::marks),
                             "List of DesignCase: each candidate, in the best cycle with it.")
      .def_property_readonly("channels", ListOf(&Design::channels),
                             "List of DesignCase: each candidate instrument beside what is there.")
      .def_property_readonly("trials", ListOf(&Design::trials),
                             "List of DesignCase: each candidate trial.")
      .def_property_readonly(
          "notes", [](const Design& d) { return d.found.notes; },
          "In sentences: what the figures do not know.")
      .def("__repr__", [](const Design& d) {
        return fmt::format("<unfurl.Design: {}>",
                           d.usable ? d.advice : "of a fit that is not usable");
      });
  const study::DesignOptions defaults;
  m.def(
      "design", &DesignStudy, py::arg("study"), py::kw_only(), py::arg("set") = py::none(),
      py::arg("candidates") = py::none(), py::arg("wanted") = defaults.wanted,
      py::arg("kept") = defaults.kept, py::arg("trial") = defaults.trial,
      py::arg("lab") = py::none(), py::arg("rig") = py::none(),
      py::arg("stretches") = defaults.stretches, py::arg("workers") = 0,
      py::arg("allow_programs") = false, py::arg("progress") = py::none(),
      "What a study's trials tell of each parameter, and what to measure next.\n\n"
      "candidates: path of marks, instruments and trials to choose from (TOML, docs/design.md).\n"
      "wanted: parameters whose errors count; []: all. kept: marks that stay lit in some line of\n"
      "the cycle. trial: in whose manner the next is planned. lab: a Lab (or a path) for the\n"
      "strobe's cycle; None: as the tracks show. rig: that saw the marks, for what each camera\n"
      "tells. stretches: of time, to tell apart. workers: simulations at a time, 0 for one per\n"
      "core. allow_programs: as of fit_study. progress(done): is called with the share done.");
}

}  // namespace unfurl::python
