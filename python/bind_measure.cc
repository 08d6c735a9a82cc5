#include <fmt/format.h>

#include <optional>

#include "base/error.h"
#include "base/progress.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "data/trial_health.h"
#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "measure/trial_record.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Tracks = Recorded<data::Tracks>;
using Run = Recorded<data::Run>;
using Rig = Recorded<data::Rig>;
using Survey = Recorded<data::Survey>;

py::tuple Expose(const py::object& run_or_path, const py::object& lab_or_path,
                 const fs::path& output, std::size_t workers, const py::object& progress) {
  const auto run = RecordFrom<Run>(run_or_path, "a Run",
                                   [](const std::string& path) { return data::ReadRun(path); });
  const auto lab = LabFrom(lab_or_path);
  const data::Provenance provenance = [&] {
    data::Provenance made = ProvenanceOf(Joined(run->sources, {SourceOf(lab->path)}));
    made.seed = lab->seed;
    return made;
  }();
  CallbackError errors;
  auto truth = LongWithCallbacks(errors, [&] {
    Tracks truth_tracks{{}, run->sources};
    data::TrialWriter writer(output.string(), measure::HeaderOf(*lab), provenance);
    const measure::ExposeOptions options{.workers = workers,
                                         .progress = ProgressOf(progress, &errors)};
    measure::ExposeTrial(*lab, run->data, writer, options, &truth_tracks.data);
    writer.Commit();
    return truth_tracks;
  });
  return py::make_tuple(std::make_shared<data::TrialReader>(output.string()), std::move(truth));
}

Survey ExposeSurvey(const py::object& points_or_path, const py::object& lab_or_path,
                    std::size_t workers, const py::object& progress) {
  const auto points = RecordFrom<Survey>(points_or_path, "a Survey", &data::ReadPointsCsv);
  const auto lab = LabFrom(lab_or_path);
  CallbackError errors;
  return LongWithCallbacks(errors, [&] {
    const measure::ExposeOptions options{.workers = workers,
                                         .progress = ProgressOf(progress, &errors)};
    return Survey{measure::ExposeSurvey(*lab, points->data, options),
                  Joined(points->sources, {SourceOf(lab->path)})};
  });
}

std::map<std::string, Eigen::Vector3d> StartsFrom(const py::object& start) {
  std::map<std::string, Eigen::Vector3d> out;
  if (start.is_none()) return out;
  for (const auto& [mark, place] : start.cast<py::dict>()) {
    const auto p = place.cast<std::vector<double>>();
    if (p.size() != 3) throw py::value_error("start: expected {mark: (x, y, z)}");
    out[mark.cast<std::string>()] = {p[0], p[1], p[2]};
  }
  return out;
}

struct Reconstruction {
  Tracks tracks;
  data::TrialHealth health;
};

Reconstruction ReconstructBoth(const py::object& trial_or_path, const py::object& rig_or_path,
                               const py::object& start, double start_sigma, double max_speed,
                               bool correct, std::size_t workers, const py::object& progress) {
  measure::ReconstructOptions options;
  options.start = StartsFrom(start);
  options.start_sigma = start_sigma;
  options.max_speed = max_speed;
  options.workers = workers;
  options.Check();
  std::shared_ptr<data::TrialReader> trial;
  std::optional<measure::TrialRecord> record;
  if (py::isinstance<data::TrialReader>(trial_or_path)) {
    trial = trial_or_path.cast<std::shared_ptr<data::TrialReader>>();
  } else {
    record.emplace(PathFrom(trial_or_path, "a Trial or a path").string());
  }
  const auto rig = RecordFrom<Rig>(rig_or_path, "a Rig", &data::ReadRig);
  CallbackError errors;
  options.progress = ProgressOf(progress, &errors);
  return LongWithCallbacks(errors, [&] {
    measure::HealthReport health;
    Tracks tracks{
        trial ? measure::Reconstruct(*trial, rig->data, options, nullptr, correct, &health)
              : measure::Reconstruct(*record, rig->data, options, nullptr, correct, &health),
        Joined({SourceOf(trial ? trial->path() : record->path())}, rig->sources)};
    const std::vector<std::string> cameras = tracks.data.cameras, marks = tracks.data.marks;
    return Reconstruction{std::move(tracks), measure::RecordOf(health, cameras, marks, correct)};
  });
}

Tracks Reconstruct(const py::object& trial, const py::object& rig, const py::object& start,
                   double start_sigma, double max_speed, bool correct, std::size_t workers,
                   const py::object& progress) {
  return ReconstructBoth(trial, rig, start, start_sigma, max_speed, correct, workers, progress)
      .tracks;
}

data::TrialHealth Health(const py::object& trial, const py::object& rig, std::size_t workers,
                         const py::object& progress) {
  return ReconstructBoth(trial, rig, py::none(), 0.0, 0.0, true, workers, progress).health;
}

}  // namespace

void BindMeasure(py::module_& m) {
  m.def(
      "expose", &Expose, py::arg("run"), py::arg("lab"), py::arg("output"), py::kw_only(),
      py::arg("workers") = 0, py::arg("progress") = py::none(),
      "The virtual experiment: what the cameras of a lab would have recorded of a run.\n\n"
      "run, lab: records or paths. output: the trial to write (HDF5). progress: called with the\n"
      "share that is done. Returns (Trial, Tracks): what was recorded, and where each flash truly\n"
      "was.");
  m.def("expose_survey", &ExposeSurvey, py::arg("points"), py::arg("lab"), py::kw_only(),
        py::arg("workers") = 0, py::arg("progress") = py::none(),
        "A virtual survey: points (a Survey, or the path of a CSV of points) as the cameras of a "
        "lab\n"
        "would have seen them, with what the station states.");
  m.def("reconstruct", &Reconstruct, py::arg("trial"), py::arg("rig"), py::kw_only(),
        py::arg("start") = py::none(), py::arg("start_sigma") = 0.0, py::arg("max_speed") = 0.0,
        py::arg("correct") = false, py::arg("workers") = 0, py::arg("progress") = py::none(),
        "Marks in time from the raw lines of a trial; trial and rig are records or paths. A path "
        "may\n"
        "also be that of readings (CSV, HDF5), in place of lines.\n\n"
        "start: {mark: (x, y, z)} where marks that are lit together start [m], to within "
        "start_sigma\n"
        "[m], 0: a hundredth of the volume. max_speed: no mark is ever faster [m/s]; 0: derived "
        "from\n"
        "the record. correct: readings of cameras that moved, drifted or are late are put right;\n"
        "otherwise these are left out while they are wrong (see health). workers: threads, 0 for "
        "all cores; changes no result. progress(done) is called\n"
        "with the share that is done.");
  m.def(
      "health", &Health, py::arg("trial"), py::arg("rig"), py::kw_only(), py::arg("workers") = 0,
      py::arg("progress") = py::none(),
      "What a trial says of its cameras: which moved, drifts or is late, and each in time; trial\n"
      "and rig as for reconstruct.");
  m.def(
      "read_health", [](const fs::path& path) { return data::ReadTrialHealth(path.string()); },
      py::arg("path"),
      "The health that a file of tracks (HDF5) keeps; without cameras where it keeps none.");
}

}  // namespace unfurl::python
