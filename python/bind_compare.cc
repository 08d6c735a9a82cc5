#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "correlate/compare/comparison.h"
#include "correlate/compare/comparison_json.h"
#include "data/atomic_file.h"
#include "data/run.h"
#include "data/tracks.h"
#include "python/bindings.h"
#include "python/placement.h"

namespace unfurl::python {
namespace {

using Tracks = Recorded<data::Tracks>;
using Run = Recorded<data::Run>;
using correlate::ComparedSignal;
using correlate::ComparedSpectrum;
using correlate::Comparison;

correlate::SpectralWindow WindowNamed(const std::string& name) {
  using W = correlate::SpectralWindow;
  static const std::vector<std::pair<std::string, W>> kAll = {
      {"hann", W::kHann},        {"rectangular", W::kRectangular},
      {"hamming", W::kHamming},  {"blackman", W::kBlackman},
      {"flat-top", W::kFlatTop}, {"blackman-harris", W::kBlackmanHarris}};
  std::string known;
  for (const auto& [text, window] : kAll) {
    if (text == name) return window;
    known += (known.empty() ? "'" : ", '") + text + "'";
  }
  throw Error("there is no window '" + name + "'", "window", "it is one of " + known);
}

std::string JsonText(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

// One side of a comparison, and what keeps it alive.
struct Side {
  std::shared_ptr<Run> run;
  std::shared_ptr<Tracks> tracks;
  correlate::ComparedRecord record() const {
    if (run != nullptr) return {run->data, NameOf(run->sources, "record")};
    return {tracks->data, NameOf(tracks->sources, "record")};
  }
};

Side SideFrom(const py::object& object) {
  if (py::isinstance<Run>(object)) return {object.cast<std::shared_ptr<Run>>(), nullptr};
  if (py::isinstance<Tracks>(object)) return {nullptr, object.cast<std::shared_ptr<Tracks>>()};
  // A path: what it is, the loader knows.
  PathFrom(object, "a Run, Tracks or a path");
  const py::object loaded = py::module_::import("unfurl._core").attr("load")(object);
  if (!py::isinstance<Run>(loaded) && !py::isinstance<Tracks>(loaded)) {
    throw Error("is neither a run nor tracks", object.cast<fs::path>().string(),
                "give two of those");
  }
  return SideFrom(loaded);
}

std::shared_ptr<Comparison> Compare(const py::object& record, const py::object& reference,
                                    const std::vector<std::string>& marks,
                                    std::optional<double> start, std::optional<double> end,
                                    const std::string& window, const std::string& modes,
                                    bool clock_drift, const py::object& offset,
                                    const py::object& drift, const py::object& frame) {
  const Side a = SideFrom(record), b = SideFrom(reference);
  correlate::ComparisonOptions options;
  options.marks = marks;
  options.from = start;
  options.to = end;
  options.window = WindowNamed(window);
  options.modes = correlate::ParseExcitation(modes, "modes");
  options.clock_drift = clock_drift;
  options.placement = PlacementFrom(offset, drift, frame);
  if (start && end && !(*start < *end)) {
    throw Error(fmt::format("no time between {} and {} s", *start, *end), "start, end",
                "give the earlier one first");
  }
  return Long([&] {
    return std::make_shared<Comparison>(correlate::Compare(a.record(), b.record(), options));
  });
}

py::list ModeTable(const correlate::ModalFit& fit) {
  py::list rows;
  for (const correlate::Mode& mode : fit.decay.modes) {
    rows.append(py::dict(
        py::arg("frequency") = mode.frequency, py::arg("frequency_sigma") = mode.frequency_sigma,
        py::arg("damping") = mode.damping, py::arg("damping_sigma") = mode.damping_sigma));
  }
  return rows;
}

void BindParts(py::module_& m) {
  using correlate::MarkError;
  py::class_<MarkError>(m, "MarkError", "Errors of one mark, or of all.")
      .def_readonly("mark", &MarkError::mark, "Its name, or 'all'.")
      .def_readonly("samples", &MarkError::samples)
      .def_readonly("rmse", &MarkError::rmse, "Of the distance [m].")
      .def_readonly("rmse_in_plane", &MarkError::rmse_in_plane, "[m]")
      .def_readonly("rmse_across", &MarkError::rmse_across, "[m]")
      .def_readonly("largest", &MarkError::largest, "Distance [m].")
      .def_readonly("largest_at", &MarkError::largest_at, "On the record's clock [s].")
      .def_readonly("sigmas", &MarkError::sigmas,
                    "RMS in the marks' own sigmas: 1 where model and covariances are right; 0\n"
                    "without a sigma [-].")
      .def("__repr__", [](const MarkError& e) {
        return fmt::format("<unfurl.MarkError '{}': {:.3g} m RMS of {}>", e.mark, e.rmse,
                           Plural(e.samples, "sample"));
      });
  py::class_<correlate::ComparedScore>(m, "Score", "How alike two histories are.")
      .def_readonly("name", &correlate::ComparedScore::name)
      .def_property_readonly("unit", [](const correlate::ComparedScore& s) { return s.Unit(); })
      .def_property_readonly(
          "rmse", [](const correlate::ComparedScore& s) { return s.score.rmse; },
          "RMS error [unit].")
      .def_readonly("sigmas", &correlate::ComparedScore::sigmas,
                    "RMS in the readings' own sigmas: 1 where model and sigmas are right; 0\n"
                    "where none are told [-].")
      .def_property_readonly(
          "nrmse", [](const correlate::ComparedScore& s) { return s.score.nrmse; },
          "RMS error over the range of the test [-].")
      .def_property_readonly(
          "r2", [](const correlate::ComparedScore& s) { return s.score.r2; },
          "Share of the test's variance that is explained [-].")
      .def_property_readonly(
          "sprague_geers", [](const correlate::ComparedScore& s) { return s.score.sprague_geers; },
          "Combined error of Sprague and Geers, 0 for equal histories [-].")
      .def_property_readonly(
          "russell", [](const correlate::ComparedScore& s) { return s.score.russell; },
          "Russell's comprehensive error: to 0.15 excellent, to 0.28 acceptable [-].")
      .def_property_readonly(
          "rating",
          [](const correlate::ComparedScore& s) -> std::optional<double> {
            return s.rated ? std::optional(s.rating.overall) : std::nullopt;
          },
          "Overall rating of ISO/TS 18571; None: too few even samples.")
      .def("__repr__", [](const correlate::ComparedScore& s) {
        return fmt::format("<unfurl.Score '{}': R2 = {:.5f}>", s.name, s.score.r2);
      });
  py::class_<ComparedSignal>(m, "Signal", "One scalar in time, of both records.")
      .def_readonly("name", &ComparedSignal::name)
      .def_property_readonly("unit", [](const ComparedSignal& s) { return s.id.Unit(); })
      .def_property_readonly("t", ViewOf(&ComparedSignal::t), "(n,) on the record's clock [s].")
      .def_property_readonly("measured", ViewOf(&ComparedSignal::measured), "(n,) the record's.")
      .def_property_readonly("sigma", ViewOf(&ComparedSignal::sigma),
                             "(n,) standard deviation; may be empty.")
      .def_property_readonly("reference", ViewOf(&ComparedSignal::reference), "(n,)")
      .def("__repr__", [](const ComparedSignal& s) {
        return fmt::format("<unfurl.Signal '{}' [{}]: {}>", s.name, s.id.Unit(),
                           Plural(s.t.size(), "sample"));
      });
  py::class_<correlate::Spectrum>(m, "Spectrum", "A single-sided amplitude spectrum.")
      .def_property_readonly("frequency", ViewOf(&correlate::Spectrum::frequency), "(n,) [Hz]")
      .def_property_readonly("amplitude", ViewOf(&correlate::Spectrum::amplitude),
                             "(n,) in the signal's unit: a sine of amplitude A shows as A.")
      .def_readonly("convention", &correlate::Spectrum::convention, "All of this in words.");
  py::class_<ComparedSpectrum>(m, "SpectrumPair", "The spectra of one signal, of both records.")
      .def_readonly("name", &ComparedSpectrum::name)
      .def_readonly("measured", &ComparedSpectrum::measured)
      .def_readonly("reference", &ComparedSpectrum::reference)
      .def_property_readonly(
          "peaks",
          [](const ComparedSpectrum& s) {
            std::vector<std::pair<std::optional<double>, std::optional<double>>> out;
            const auto at = [](const std::vector<correlate::Peak>& peaks, int k) {
              return k < 0 ? std::nullopt
                           : std::optional(peaks[static_cast<std::size_t>(k)].frequency);
            };
            for (const correlate::PeakPair& pair : s.pairs) {
              out.emplace_back(at(s.measured_peaks, pair.a), at(s.reference_peaks, pair.b));
            }
            return out;
          },
          "[(measured, reference)] frequencies that belong together; None: no partner [Hz].");
}

}  // namespace

void BindCompare(py::module_& m) {
  BindParts(m);
  py::class_<Comparison, std::shared_ptr<Comparison>>(
      m, "Comparison", "Two records beside each other, aligned in time and frame.")
      .def_property_readonly(
          "status",
          [](const Comparison& c) { return std::string(correlate::Name(c.alignment.status)); },
          "How the alignment ended.")
      .def_property_readonly(
          "usable", [](const Comparison& c) { return c.alignment.Usable(); },
          "Whether the two share a motion.")
      .def_property_readonly("message", [](const Comparison& c) { return c.alignment.message; })
      .def_readonly("verdict", &Comparison::verdict)
      .def_readonly("reasons", &Comparison::reasons)
      .def_readonly("marks", &Comparison::marks)
      .def_property_readonly(
          "offset", [](const Comparison& c) { return c.alignment.at.offset; },
          "What the record's clock shows when the reference's shows 0 [s].")
      .def_property_readonly(
          "r2", [](const Comparison& c) { return c.alignment.r2; },
          "Share of the marks' motion that the reference explains.")
      .def_property_readonly(
          "errors",
          [](const py::object& self) { return PartsOf(self, self.cast<Comparison&>().errors); },
          "List of MarkError: per mark, then all.")
      .def_property_readonly(
          "scores",
          [](const py::object& self) { return PartsOf(self, self.cast<Comparison&>().scores); },
          "List of Score: angles, marks, then all.")
      .def_property_readonly(
          "signals",
          [](const py::object& self) { return PartsOf(self, self.cast<Comparison&>().signals); },
          "List of Signal.")
      .def_property_readonly(
          "spectra",
          [](const py::object& self) { return PartsOf(self, self.cast<Comparison&>().spectra); },
          "List of SpectrumPair.")
      .def_property_readonly(
          "measured_modes", [](const Comparison& c) { return ModeTable(c.measured_modes); },
          "List of dicts: frequency, frequency_sigma [Hz], damping, damping_sigma [-].")
      .def_property_readonly(
          "reference_modes", [](const Comparison& c) { return ModeTable(c.reference_modes); },
          "The same of the reference.")
      .def_property_readonly(
          "channels",
          [](const Comparison& c) {
            py::list rows;
            for (const correlate::ComparedChannel& one : c.channels) {
              rows.append(py::dict(py::arg("name") = one.name, py::arg("unit") = one.unit,
                                   py::arg("of") = one.of));
            }
            return rows;
          },
          "List of dicts: name, unit, of (what it is held against; '' of a record alone).")
      .def_property_readonly(
          "vibration",
          [](const Comparison& c) { return std::string(c.measured_ambient ? "ambient" : "decay"); },
          "What the record's vibration was taken for: 'decay' or 'ambient'.")
      .def_property_readonly(
          "left_out", [](const Comparison& c) { return c.left_out; },
          "Marks or channels that only one of the two has.")
      .def(
          "write",
          [](const Comparison& c, const fs::path& path) {
            data::WriteTextFile(path.string(), JsonText(correlate::ComparisonJson(c)));
          },
          py::arg("path"), "Writes all numbers as JSON; keys: docs/formats.md.")
      .def("__repr__", [](const Comparison& c) {
        const std::string error =
            c.errors.empty() ? "" : fmt::format(", {:.3g} m RMS", c.errors.back().rmse);
        return fmt::format("<unfurl.Comparison: {}, {}{}>", correlate::Name(c.alignment.status),
                           Plural(c.marks.size(), "mark"), error);
      });
  m.def(
      "compare", &Compare, py::arg("record"), py::arg("reference"), py::kw_only(),
      py::arg("marks") = std::vector<std::string>{}, py::arg("start") = py::none(),
      py::arg("end") = py::none(), py::arg("window") = "hann", py::arg("modes") = "auto",
      py::arg("clock_drift") = false, py::arg("offset") = py::none(), py::arg("drift") = py::none(),
      py::arg("frame") = py::none(),
      "Two of runs and tracks (or paths) side by side: aligned, then errors, scores, spectra and\n"
      "modes.\n\n"
      "marks: those to compare; none: all in common. start, end: of spectra and modes on the\n"
      "record's clock [s]; none: from the last latch, to the end. window: of the spectra.\n"
      "modes: 'auto', 'decay' or 'ambient', what the vibration is. "
      "clock_drift: the record's clock may run at another rate. offset [s], drift [-], frame: "
      "what\n"
      "is known of the record's clock and frame: 'free', 'known', a number, (mean, sigma); of the\n"
      "frame (shift, rotation), standard deviations [m, rad]. Two that share no motion are a\n"
      "result: see usable and message.");
}

}  // namespace unfurl::python
