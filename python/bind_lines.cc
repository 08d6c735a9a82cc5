#include <fmt/format.h>

#include "base/error.h"
#include "base/progress.h"
#include "data/raw_layout.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "data/trial.h"
#include "measure/raw_lines.h"
#include "measure/raw_survey.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Survey = Recorded<data::Survey>;

std::vector<Source> FilesOf(const data::RawLayout& layout) {
  std::vector<Source> sources = {SourceOf(layout.path)};
  const auto add = [&](const std::string& file) {
    if (!file.empty()) sources.push_back(SourceOf(file));
  };
  for (const data::RawLayout::Files& files : layout.files) {
    for (const auto* list : {&files.lines, &files.flat, &files.flat_dark}) {
      for (const std::string& file : *list) add(file);
    }
  }
  for (const auto* file : {&layout.stamps, &layout.survey.points, &layout.survey.ids}) add(*file);
  return sources;
}

void WriteTrial(const data::RawLayout& layout, const std::string& path,
                const data::Provenance& provenance, const std::function<void(double)>& done) {
  constexpr std::size_t kBlock = 256;  // lines held at once
  measure::RawLines lines(layout);
  data::TrialWriter trial(path, lines.header(), provenance);
  data::TrialBlock block;
  while (lines.Read(kBlock, &block)) {
    trial.Append(block);
    done(lines.done());
  }
  trial.Commit();
}

data::Survey SurveyOfLines(const data::RawLayout& layout, const std::function<void(double)>& done) {
  data::Survey survey;
  if (!data::ReadSurveyPoints(data::CsvTable::Load(layout.survey.points), &survey)) {
    throw Error("states no uncertainty of its points", layout.survey.points,
                "add columns 'sx [m]', 'sy [m]' and 'sz [m]'");
  }
  data::JoinReadings(measure::ReadRawSurvey(layout, survey.id, done), layout.path, &survey);
  return survey;
}

// A trial or a survey, as the description says.
py::object ReadLines(const py::object& description, const fs::path& output,
                     const py::object& progress) {
  const data::RawLayout layout =
      data::ReadRawLayout(PathFrom(description, "the path of a description").string());
  const std::vector<Source> sources = FilesOf(layout);
  const data::Provenance provenance = ProvenanceOf(sources);
  CallbackError errors;
  const auto done = ProgressOf(progress, &errors);
  if (layout.survey.points.empty()) {
    LongWithCallbacks(errors, [&] { WriteTrial(layout, output.string(), provenance, done); });
    return py::cast(std::make_shared<data::TrialReader>(output.string()));
  }
  return py::cast(LongWithCallbacks(errors, [&] {
    auto survey = std::make_shared<Survey>(Survey{SurveyOfLines(layout, done), sources});
    data::WriteSurvey(output.string(), survey->data, provenance);
    return survey;
  }));
}

Survey ReadSurvey(const py::object& path_like, const std::optional<fs::path>& readings,
                  double sigma, double angle_sigma, double distance_sigma,
                  const py::object& station, const py::object& distance_error,
                  double zenith_error) {
  const fs::path path = PathFrom(path_like, "a path");
  Survey out;
  out.sources = {SourceOf(path)};
  if (readings) out.sources.push_back(SourceOf(*readings));
  out.data = data::ReadSurveyInParts(path.string(), readings.value_or("").string(),
                                     {sigma, angle_sigma, distance_sigma});
  if (!station.is_none()) {
    const std::vector<double> place = NumbersFrom(station, "station");
    if (place.size() != 3) throw py::value_error("station: expected (x, y, z) [m]");
    out.data.station = Eigen::Vector3d::Map(place.data());
  }
  if (!distance_error.is_none()) {
    const std::vector<double> error = NumbersFrom(distance_error, "distance_error");
    if (error.size() != 2 || !(error[0] >= 0.0) || !(error[1] >= 0.0)) {
      throw py::value_error("distance_error: expected (offset [m], scale [1]), not negative");
    }
    out.data.station_errors.distance_offset = error[0];
    out.data.station_errors.distance_scale = error[1];
  }
  if (zenith_error > 0.0) out.data.station_errors.zenith = zenith_error;
  return out;
}

}  // namespace

void BindLines(py::module_& m) {
  m.def("read_lines", &ReadLines, py::arg("description"), py::arg("output"), py::kw_only(),
        py::arg("progress") = py::none(),
        "Raw lines of a frame grabber, which a TOML file describes (docs/formats.md), into a "
        "file.\n\n"
        "Returns the Trial, or the Survey, that was written (HDF5). progress(done) is called with "
        "the\n"
        "share that is done.");
  m.def("read_survey", &ReadSurvey, py::arg("path"), py::arg("readings") = py::none(),
        py::kw_only(), py::arg("sigma") = 0.0, py::arg("angle_sigma") = 0.0,
        py::arg("distance_sigma") = 0.0, py::arg("station") = py::none(),
        py::arg("distance_error") = py::none(), py::arg("zenith_error") = 0.0,
        "A survey (.h5, .csv), or its points (.csv, .gsi) with readings in a file of their own.\n\n"
        "readings: CSV of readings by id; repeats are averaged. sigma: of a point per axis where "
        "the\n"
        "file states none [m]; angle_sigma [rad], distance_sigma [m]: of a GSI file's. station:\n"
        "(x, y, z) of the total station in the survey's frame [m]; distance_error: standard\n"
        "deviations of its offset [m] and scale [1]; zenith_error: of its index [rad].");
}

}  // namespace unfurl::python
