#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/progress.h"
#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "correlate/observations.h"
#include "data/fit.h"
#include "data/formats.h"
#include "data/study.h"
#include "data/tracks.h"
#include "python/bindings.h"
#include "python/fit_object.h"
#include "python/placement.h"
#include "python/python_model.h"
#include "study/fit_record.h"

namespace unfurl::python {
namespace {

using Tracks = Recorded<data::Tracks>;
using FitParameter = data::FitRecord::Parameter;

correlate::Window WindowFrom(const std::optional<std::pair<double, double>>& window) {
  if (!window) return {};
  if (!(window->first < window->second)) {
    throw Error("the window is empty", "window", "give (start, end) in seconds, start first");
  }
  return {window->first, window->second};
}

struct ModelFitOptions {
  std::vector<std::string> marks;
  std::optional<std::pair<double, double>> window;
  py::object finer;
  double finer_factor = 1.0;
  std::string name;
  correlate::Placement placement;
};

Fit FitModel(const py::object& model, const py::object& tracks_or_path,
             const std::vector<correlate::Parameter>& parameters, const ModelFitOptions& what,
             const correlate::FitOptions& options, CallbackError* errors) {
  const auto tracks = RecordFrom<Tracks>(
      tracks_or_path, "Tracks", [](const std::string& path) { return data::ReadTracksAny(path); });
  if (tracks->data.smoothed) {
    throw Error("these tracks are smoothed: their errors are no longer independent", "tracks",
                "fit to the tracks as reconstructed");
  }
  std::vector<std::string> names;
  data::Study study;
  study.name = what.name;
  for (const correlate::Parameter& p : parameters) {
    if (std::find(names.begin(), names.end(), p.name) != names.end()) {
      throw Error("there are two parameters of this name", "parameter." + p.name,
                  "give each a name of its own");
    }
    names.push_back(p.name);
    data::StudyParameter& named = study.parameters.emplace_back();
    named.name = p.name;
    named.unit = p.unit;
  }
  const std::unique_ptr<correlate::Model> coarse = ModelFrom(model, names, errors);
  std::unique_ptr<correlate::Model> finer;
  if (!what.finer.is_none()) finer = ModelFrom(what.finer, names, errors);
  correlate::Observations observations =
      correlate::FromTracks(tracks->data, what.marks, WindowFrom(what.window));
  observations.placement = what.placement;
  correlate::FitProblem problem;
  problem.parameters = parameters;
  problem.trials.push_back({.name = "trial",
                            .observations = &observations,
                            .model = coarse.get(),
                            .finer = finer.get(),
                            .finer_factor = what.finer_factor});
  return LongWithCallbacks(*errors, [&] {
    const correlate::FitResult result = correlate::Fit(problem, options);
    return Fit{{study::RecordOf(study, problem, result), tracks->sources}, nullptr};
  });
}

Fit FitFunction(const py::object& model, const py::object& tracks,
                const std::vector<correlate::Parameter>& parameters,
                const std::vector<std::string>& marks,
                std::optional<std::pair<double, double>> window, const py::object& finer,
                double finer_factor, const std::vector<double>& stages, int screened, int starts,
                std::uint64_t seed, bool whiten, const std::vector<double>& profile_levels,
                std::size_t workers, const py::object& progress, const std::string& name,
                const py::object& offset, const py::object& drift, const py::object& frame) {
  if (PyCallable_Check(model.ptr()) == 0) throw py::type_error("model: expected a callable");
  CallbackError errors;
  correlate::FitOptions options;
  options.stages = stages;
  options.search.screened = screened;
  options.search.starts = starts;
  options.search.seed = seed;
  options.whiten = whiten;
  options.profile.wanted = !profile_levels.empty();
  options.profile.levels = profile_levels;
  options.workers = workers;
  options.progress = FitProgressOf(progress, &errors);
  return FitModel(model, tracks, parameters,
                  {marks, window, finer, finer_factor, name, PlacementFrom(offset, drift, frame)},
                  options, &errors);
}

const FitParameter& ParameterOf(const Fit& fit, const std::string& name) {
  std::vector<std::string> known;
  for (const FitParameter& parameter : fit.data.parameters) {
    if (parameter.name == name) return parameter;
    known.push_back(parameter.name);
  }
  RefuseName("parameter", name, known);
}

std::optional<double> Known(double x) { return std::isfinite(x) ? std::optional(x) : std::nullopt; }

void BindParameters(py::module_& m) {
  using correlate::Parameter;
  py::class_<Parameter>(m, "Parameter", "An unknown of a fit, for fit().")
      .def(py::init([](const std::string& name, double start, double low, double high,
                       const std::string& unit, bool log,
                       std::optional<std::pair<double, double>> prior) {
             Parameter p{name, unit, start, low, high, log};
             if (prior) {
               p.has_prior = true;
               std::tie(p.prior_mean, p.prior_sigma) = *prior;
             }
             correlate::Check(p);
             return p;
           }),
           py::arg("name"), py::arg("start"), py::arg("low") = -INFINITY,
           py::arg("high") = INFINITY, py::kw_only(), py::arg("unit") = "1", py::arg("log") = false,
           py::arg("prior") = py::none(),
           "start, low, high: in its unit. log: the solver moves the logarithm. prior: (mean, "
           "sigma)\n"
           "of what is known beforehand.")
      .def_readonly("name", &Parameter::name)
      .def_readonly("start", &Parameter::start, "Where the search begins [its unit].")
      .def_readonly("low", &Parameter::low, "Bound; -inf: none [its unit].")
      .def_readonly("high", &Parameter::high, "Bound; inf: none [its unit].")
      .def_readonly("unit", &Parameter::unit)
      .def(py::pickle(
          [](const Parameter& p) {
            return py::make_tuple(p.name, p.unit, p.start, p.low, p.high, p.log, p.has_prior,
                                  p.prior_mean, p.prior_sigma);
          },
          [](const py::tuple& s) {
            return Parameter{
                s[0].cast<std::string>(), s[1].cast<std::string>(), s[2].cast<double>(),
                s[3].cast<double>(),      s[4].cast<double>(),      s[5].cast<bool>(),
                s[6].cast<bool>(),        s[7].cast<double>(),      s[8].cast<double>()};
          }))
      .def("__repr__", [](const Parameter& p) {
        return fmt::format("<unfurl.Parameter '{}': {:g} in [{:g}, {:g}] {}>", p.name, p.start,
                           p.low, p.high, p.unit);
      });
  py::class_<FitParameter>(m, "FitParameter", "What a fit says of one parameter.")
      .def_readonly("name", &FitParameter::name)
      .def_readonly("unit", &FitParameter::unit)
      .def_readonly("value", &FitParameter::value, "In its unit.")
      .def_readonly("sigma", &FitParameter::sigma, "Standard error, all parts together.")
      .def_readonly("sigma_data", &FitParameter::sigma_data,
                    "Of sigma, from the samples [its unit].")
      .def_readonly("sigma_model", &FitParameter::sigma_model,
                    "Of sigma, from the model's own error [its unit].")
      .def_property_readonly(
          "interval",
          [](const FitParameter& p) { return std::pair(Known(p.low95), Known(p.high95)); },
          "95% interval (low, high); None: open on that side.")
      .def_readonly("verdict", &FitParameter::verdict, "What the trial says of it.")
      .def_readonly("reason", &FitParameter::reason, "In words, with numbers.")
      .def_readonly("combined_with", &FitParameter::with,
                    "What it is determined only in combination with.")
      .def("__repr__", [](const FitParameter& p) {
        return fmt::format("<unfurl.FitParameter '{}': {:.6g} +- {:.2g} {}, {}>", p.name, p.value,
                           p.sigma, p.unit, p.verdict);
      });
  py::class_<correlate::FitProgress>(m, "FitProgress", "How far a fit has come.")
      .def_readonly("phase", &correlate::FitProgress::phase)
      .def_readonly("evaluations", &correlate::FitProgress::evaluations)
      .def_readonly("expected", &correlate::FitProgress::expected, "Estimated so far.")
      .def_readonly("best_cost", &correlate::FitProgress::best_cost,
                    "Half the sum of squares of whitened residuals; 0: not known yet [-].")
      .def_readonly("best", &correlate::FitProgress::best_theta, "The parameters there.");
}

void BindResult(py::module_& m) {
  const auto points = [](Eigen::Matrix3Xd data::FitRecord::*member) {
    return [member](const py::object& self) {
      return PointsView<3>(self.cast<Fit&>().data.*member, self);
    };
  };
  py::class_<Fit, std::shared_ptr<Fit>>(
      m, "Fit",
      "Parameters of a model from a trial, what they are worth, and n samples at the estimate.\n\n"
      "fit['clearance'] is a FitParameter. Samples are in the model's frame.")
      .def_property_readonly(
          "status", [](const Fit& f) { return f.data.status; }, "'converged', or how it ended.")
      .def_property_readonly("message", [](const Fit& f) { return f.data.message; })
      .def_property_readonly(
          "usable", [](const Fit& f) { return f.data.status == "converged"; },
          "Whether it converged; each parameter has a verdict of its own.")
      .def_property_readonly(
          "verdict", [](const Fit& f) { return f.data.verdict; }, "Of the whole, in words.")
      .def_property_readonly("reasons", [](const Fit& f) { return f.data.reasons; })
      .def_property_readonly(
          "parameters",
          [](const py::object& self) {
            py::list list;
            for (const FitParameter& p : self.cast<Fit&>().data.parameters) {
              list.append(py::cast(&p, py::return_value_policy::reference_internal, self));
            }
            return list;
          },
          "List of FitParameter.")
      .def(py::pickle(
          [](const Fit& f) {
            const py::bytes bytes = FileBytes(
                [&](const std::string& path) { data::WriteFit(path, f.data, data::Provenance()); });
            return py::make_tuple(bytes, StateOf(f.sources));
          },
          [](const py::tuple& state) {
            auto fit = std::make_shared<Fit>();
            ReadFileBytes(state[0].cast<std::string>(),
                          [&](const std::string& path) { fit->data = data::ReadFit(path); });
            fit->sources = SourcesOf(state[1].cast<SourceState>());
            return fit;
          }))
      .def("__getitem__", &ParameterOf, py::arg("name"),
           py::return_value_policy::reference_internal)
      .def("__len__", [](const Fit& f) { return f.data.parameters.size(); })
      .def_property_readonly(
          "covariance",
          [](const py::object& self) {
            return MatrixView(self.cast<Fit&>().data.covariance, self);
          },
          "(p, p) of the values, all parts, in the products of their units.")
      .def_property_readonly(
          "checks", [](const Fit& f) { return f.data.checks; },
          "Numbers by name with unit: {'chi2_per_dof [1]': 1.02, ..}.")
      .def_property_readonly(
          "evaluations", [](const Fit& f) { return f.data.evaluations.size(); },
          "How often the model was evaluated.")
      .def_property_readonly("marks", [](const Fit& f) { return f.data.marks; })
      .def_property_readonly(
          "t", [](const py::object& self) { return View(self.cast<Fit&>().data.t, self); },
          "(n,) on the tracks' clock [s].")
      .def_property_readonly(
          "mark", [](const py::object& self) { return View(self.cast<Fit&>().data.mark, self); },
          "(n,) index into marks.")
      .def_property_readonly("measured", points(&data::FitRecord::measured), "(n, 3) [m].")
      .def_property_readonly("sigma", points(&data::FitRecord::sigma),
                             "(n, 3) standard deviations of measured [m].")
      .def_property_readonly("simulated", points(&data::FitRecord::simulated),
                             "(n, 3) the model at the estimate [m].")
      .def_property_readonly(
          "channels",
          [](const py::object& self) { return PartsOf(self, self.cast<Fit&>().data.channels); },
          "List of FitChannel: readings, and the model at the estimate.")
      .def_readonly("comparison", &Fit::comparison,
                    "Comparison of trial and model at the estimate; None: not asked for.")
      .def_property_readonly(
          "repeat",
          [](const py::object& self) -> py::object {
            const Fit& fit = self.cast<Fit&>();
            if (fit.data.repeat.empty()) return py::none();
            return py::cast(&fit.data.repeat, py::return_value_policy::reference_internal, self);
          },
          "FitRepeat, where trials were fitted as deployments that differ; else None.")
      .def(
          "write",
          [](const Fit& f, const fs::path& path) {
            data::WriteFit(path.string(), f.data, ProvenanceOf(f.sources));
          },
          py::arg("path"), "Writes it as HDF5.")
      .def("__repr__", [](const Fit& f) {
        if (f.data.status != "converged") {
          return fmt::format("<unfurl.Fit: {}: {}>", f.data.status, f.data.message);
        }
        std::string values;
        for (const FitParameter& p : f.data.parameters) {
          values += fmt::format(", {} = {:.6g} +- {:.2g}", p.name, p.value, p.sigma);
        }
        return fmt::format("<unfurl.Fit: {}{}>", f.data.status, values);
      });
}

}  // namespace

std::function<void(const correlate::FitProgress&)> FitProgressOf(const py::object& progress,
                                                                 CallbackError* errors) {
  const auto callable = Shared(progress);
  return [callable, errors](const correlate::FitProgress& at) {
    ThrowIfInterrupted();
    if (callable != nullptr) errors->Call([&] { (*callable)(at); });
  };
}

py::object LoadFit(const fs::path& path) {
  return py::cast(
      std::make_shared<Fit>(Fit{{data::ReadFit(path.string()), {SourceOf(path)}}, nullptr}));
}

void BindFit(py::module_& m) {
  BindModelFailed(m);
  BindParameters(m);
  BindResult(m);
  m.def(
      "fit", &FitFunction, py::arg("model"), py::arg("tracks"), py::arg("parameters"),
      py::kw_only(), py::arg("marks") = std::vector<std::string>{}, py::arg("window") = py::none(),
      py::arg("finer") = py::none(), py::arg("finer_factor") = 1.0,
      py::arg("stages") = std::vector<double>{}, py::arg("screened") = -1, py::arg("starts") = 1,
      py::arg("seed") = 1, py::arg("whiten") = true,
      py::arg("profile_levels") = std::vector<double>{1.0, 2.0}, py::arg("workers") = 1,
      py::arg("progress") = py::none(), py::arg("name") = "fit", py::arg("offset") = py::none(),
      py::arg("drift") = py::none(), py::arg("frame") = py::none(),
      "The parameters of any model, a Python function, from Tracks (or their path).\n\n"
      "model(parameters, times): parameters is {name: value}, times {mark: (n,) seconds on the\n"
      "model's own clock}; it returns {mark: positions (n, 2) or (n, 3) [m]}, in a frame of its\n"
      "own, or {mark: (positions, velocities [m/s])}. Time and frame are aligned by the fit, so\n"
      "times may lie a little before 0. It raises unfurl.ModelFailed where it cannot be\n"
      "evaluated; any other exception ends the fit. finer: the same with less error of its own,\n"
      "which (finer - model) times finer_factor estimates. marks, window: what to use of the\n"
      "tracks [s]. stages: ends of a growing horizon [s]. screened, starts, seed: of several\n"
      "starts; screened = -1: only where the model does not explain the data at first. "
      "profile_levels: where each parameter is held, in standard errors; []: no profiles.\n"
      "workers: evaluations at a time; more than 1 serves models that release the lock. offset "
      "[s],\n"
      "drift [-], frame: what is known of the tracks' clock and frame: 'free', 'known', a number,\n"
      "(mean, sigma); of the frame (shift, rotation), standard deviations [m, rad].");
}

}  // namespace unfurl::python
