#include <fmt/format.h>

#include "base/error.h"
#include "data/atomic_file.h"
#include "python/bindings.h"
#include "python/fit_object.h"
#include "study/effects.h"
#include "study/rivals.h"
#include "study/trial_effects.h"

namespace unfurl::python {
namespace {

using study::EffectChange;
using study::TrialEffect;

// A scene whose effects were weighed, which the reduced one is written from.
struct WeighedScene {
  std::string path;
  std::vector<std::string> set;
};

struct SceneEffects {
  study::SceneEffects found;
  WeighedScene of;
};

struct StudyEffects {
  study::TrialEffects found;  // but for its fit
  std::shared_ptr<Fit> fit;
  bool usable = false, explains = false;
  WeighedScene of;
};

void WriteReduced(const WeighedScene& of, const std::vector<std::string>& left_out,
                  const std::vector<std::string>& set, const fs::path& path) {
  data::WriteTextFile(
      path.string(),
      fmt::format("# Made from {} by unfurl.effects; {}.\n{}", of.path,
                  left_out.empty() ? "nothing can be left out" : "without what is not needed",
                  study::ReducedScene(of.path, of.set, set)));
}

SceneEffects EffectsOfScene(const py::object& scene, const py::object& set, double sigma,
                            double part, double rtol, double duration, bool each,
                            const py::object& progress) {
  study::SceneEffectsOptions options;
  options.sigma = sigma;
  options.part = part;
  options.rtol = rtol;
  options.duration = duration;
  options.each = each;
  options.Check();
  SceneEffects out;
  out.of = {PathFrom(scene, "the path of a scene").string(), OverridesFrom(set)};
  CallbackError errors;
  options.progress = StepProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    out.found = study::WeighEffects(out.of.path, out.of.set, options);
    return out;
  });
}

StudyEffects EffectsOfStudy(const py::object& study_or_path, const py::object& set, double part,
                            double budget, bool each, std::size_t workers, bool allow_programs,
                            const py::object& progress) {
  study::TrialEffectsOptions options;
  options.part = part;
  options.budget = budget;
  options.each = each;
  options.workers = workers;
  options.allow_programs = allow_programs;
  options.Check();
  const data::Study study = StudyFrom(study_or_path, set);
  CallbackError errors;
  options.progress = StepProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    StudyEffects out;
    out.of = {study.scene, study.set};
    out.found = study::WeighTrialEffects(study, options);
    out.usable = out.found.fit.Usable();
    out.explains = out.usable && study::Explains(out.found.fit);
    out.fit = std::make_shared<Fit>(FitOf(std::move(out.found.fit)));
    return out;
  });
}

// What both kinds of effect have.
template <class Effect>
py::class_<Effect> BindEffect(py::module_& m, const char* name, const char* words) {
  return py::class_<Effect>(m, name, words)
      .def_property_readonly(
          "name", [](const Effect& e) { return e.effect.name; }, "Such as 'clearance'.")
      .def_property_readonly(
          "there", [](const Effect& e) { return e.effect.there; },
          "Whether the scene has it, and was run without it; else with it.")
      .def_property_readonly(
          "set", [](const Effect& e) { return e.effect.set; },
          "Overrides of the scene that switch it.")
      .def_property_readonly(
          "verdict", [](const Effect& e) { return study::Name(e.verdict); },
          "'needed', 'not needed', ..")
      .def_readonly("message", &Effect::message, "Why nothing can be told; else empty.")
      .def_readonly("latches", &Effect::latches,
                    "In words: those that come at another time, or not at all.")
      .def_readonly("seconds", &Effect::seconds, "Of CPU [s].")
      .def("__repr__", [name](const Effect& e) {
        return fmt::format("<unfurl.{} {} {}: {}>", name, e.effect.there ? "without" : "with",
                           e.effect.name, study::Name(e.verdict));
      });
}

// And both results.
template <class Effects>
void BindBoth(py::class_<Effects>& of) {
  of.def_property_readonly(
        "effects",
        [](const py::object& self) { return PartsOf(self, self.cast<Effects&>().found.effects); },
        "One of each.")
      .def_property_readonly(
          "left_out", [](const Effects& e) { return e.found.left_out; },
          "Names of what the scene can do without, all together.")
      .def_property_readonly(
          "set", [](const Effects& e) { return e.found.set; },
          "Overrides of the scene that leave it out, as simulate(set=) takes them.")
      .def_property_readonly(
          "seconds", [](const Effects& e) { return e.found.seconds; },
          "Of CPU, as the scene or study is [s].")
      .def(
          "write",
          [](const Effects& e, const py::object& path) {
            WriteReduced(e.of, e.found.left_out, e.found.set, PathFrom(path, "a path"));
          },
          py::arg("path"), "Writes the reduced scene (TOML).");
}

void BindSceneEffects(py::module_& m) {
  BindEffect<EffectChange>(m, "SceneEffect", "What an effect does to a scene's motion.")
      .def_readonly("mark", &EffectChange::mark, "That moves most.")
      .def_readonly("rms", &EffectChange::rms, "By how much over the run [m].")
      .def_readonly("largest", &EffectChange::largest, "At its largest [m].");
  py::class_<SceneEffects> all(m, "SceneEffects", "What a scene's effects count for.");
  BindBoth(all);
  all.def_property_readonly(
         "duration", [](const SceneEffects& e) { return e.found.duration; }, "Simulated [s].")
      .def_property_readonly(
          "floor", [](const SceneEffects& e) { return e.found.floor; },
          "What a tolerance ten times tighter moves the worst mark by, RMS [m].")
      .def_property_readonly(
          "reduced_rms", [](const SceneEffects& e) { return e.found.reduced_rms; },
          "What the reduced scene moves the worst mark by, RMS [m].")
      .def_property_readonly(
          "reduced_seconds", [](const SceneEffects& e) { return e.found.reduced_seconds; },
          "Of CPU, of the reduced scene [s].")
      .def("__repr__", [](const SceneEffects& e) {
        return fmt::format("<unfurl.SceneEffects: {}, {} left out>",
                           Plural(e.found.effects.size(), "effect"), e.found.left_out.size());
      });
}

void BindStudyEffects(py::module_& m) {
  BindEffect<TrialEffect>(m, "TrialEffect", "What a trial says of an effect.")
      .def_readonly("fitted", &TrialEffect::fitted, "There is a fit; else the rest says nothing.")
      .def_readonly("settled", &TrialEffect::settled, "It came to its end within the budget.")
      .def_readonly("released", &TrialEffect::released, "Names of parameters that go with it.")
      .def_readonly("probability", &TrialEffect::probability,
                    "That the effect is in the trial, one against the other [0, 1].")
      .def_readonly("deviance", &TrialEffect::deviance,
                    "By how much -2 log likelihood rises without it [-].")
      .def_readonly("deviance_least", &TrialEffect::deviance_least,
                    "Of it, what no values of the parameters take away [-].")
      .def_readonly("deviance_error", &TrialEffect::deviance_error,
                    "What the simulator's own scatter may have wrong of it [-].")
      .def_readonly("share", &TrialEffect::share,
                    "Of the residuals' squares without it, what it takes away [0, 1].")
      .def_readonly("change", &TrialEffect::change,
                    "Of the fitted marks and channels, RMS in their sigmas [-].")
      .def_readonly("change_sigma", &TrialEffect::change_sigma, "How uncertain that is [-].")
      .def_readonly("change_rms", &TrialEffect::change_rms, "Of the fitted marks, RMS [m].")
      .def_property_readonly(
          "held_out",
          [](const TrialEffect& e) { return py::make_tuple(e.held_out.gain, e.held_out.sigma); },
          "How much better stretches of the record are predicted with it, and the error [nats].")
      .def_property_readonly(
          "shifts",
          [](const TrialEffect& e) {
            py::dict out;
            for (const TrialEffect::Shift& s : e.shifts) out[py::str(s.name)] = s.sigmas;
            return out;
          },
          "Of each parameter that stays, in standard errors of the fit as it is [-].")
      .def_property_readonly(
          "size",
          [](const TrialEffect& e) {
            return e.size_sigma > 0.0 ? std::optional(e.size) : std::nullopt;
          },
          "Of an effect that the scene lacks, where only the trial tells it [unit]; or None.")
      .def_readonly("size_sigma", &TrialEffect::size_sigma, "Its standard error [unit].")
      .def_readonly("unit", &TrialEffect::unit, "Of the size.")
      .def_readonly("saved", &TrialEffect::saved,
                    "Of a run's time, without the effect; negative: costs [-].")
      .def_readonly("runs", &TrialEffect::runs, "Evaluations that it took.");
  py::class_<StudyEffects> all(m, "TrialEffects", "What the effects count for in a trial.");
  BindBoth(all);
  all.def_readonly("fit", &StudyEffects::fit, "Of the study as it is.")
      .def_readonly("usable", &StudyEffects::usable, "Whether that fit is; else nothing is told.")
      .def_readonly(
          "explains", &StudyEffects::explains,
          "Whether it explains the data: if not, what is missing may speak for or against "
          "any effect.")
      .def_property_readonly(
          "reduced_change", [](const StudyEffects& e) { return e.found.reduced_change; },
          "Of the fit without all that is left out, as TrialEffect.change [-].")
      .def("__repr__", [](const StudyEffects& e) {
        return fmt::format("<unfurl.TrialEffects: {}, {} left out>",
                           Plural(e.found.effects.size(), "effect"), e.found.left_out.size());
      });
}

}  // namespace

void BindEffects(py::module_& m) {
  BindSceneEffects(m);
  BindStudyEffects(m);
  const study::SceneEffectsOptions scene;
  m.def("effects", &EffectsOfScene, py::arg("scene"), py::kw_only(), py::arg("set") = py::none(),
        py::arg("sigma") = scene.sigma, py::arg("part") = scene.part, py::arg("rtol") = scene.rtol,
        py::arg("duration") = scene.duration, py::arg("each") = scene.each,
        py::arg("progress") = py::none(),
        "Which effects a scene calls for (its path): each off, or on, at fixed parameters.\n\n"
        "sigma: error of a mark's coordinate in the trial that is meant [m]; 0: no verdicts.\n"
        "part: of it, what all that is left out together may move a mark by. rtol, duration: 0:\n"
        "the scene's [-], [s]. each: each joint, beam and spring for itself. progress(done): is\n"
        "called with the share that is done.");
  const study::TrialEffectsOptions trial;
  m.def("effects_study", &EffectsOfStudy, py::arg("study"), py::kw_only(),
        py::arg("set") = py::none(), py::arg("part") = trial.part, py::arg("budget") = trial.budget,
        py::arg("each") = trial.each, py::arg("workers") = 0, py::arg("allow_programs") = false,
        py::arg("progress") = py::none(),
        "Which effects the trials of a study call for (a Study or a path): the parameters are\n"
        "fitted again without each, or with one that the scene lacks.\n\n"
        "part: of a sigma, by which marks and parameters may move. budget: runs for each effect,\n"
        "in parts of those that the fit takes. each: each joint, beam and spring for itself.\n"
        "workers: simulations at a time, 0 for one per core. allow_programs: as of fit_study.\n"
        "progress(done): is called with the share that is done.");
}

}  // namespace unfurl::python
