#include <fmt/format.h>

#include "base/error.h"
#include "data/csv.h"
#include "data/fit.h"
#include "data/h5.h"
#include "data/lab.h"
#include "data/modes.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/scene.h"
#include "data/study.h"
#include "data/survey.h"
#include "data/toml.h"
#include "data/tracks.h"
#include "data/tracks_exchange.h"
#include "data/trial.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

template <class T, class Read>
py::object Loaded(const fs::path& path, const Read& read) {
  const Source source = SourceOf(path);
  std::shared_ptr<Recorded<T>> record;
  {
    const py::gil_scoped_release released;
    record = std::make_shared<Recorded<T>>(Recorded<T>{read(path.string()), {source}});
  }
  return py::cast(record);
}

py::object LoadH5(const fs::path& path) {
  const std::string schema = data::H5Reader::SchemaOf(path.string());
  if (schema == data::kTracksSchema) return Loaded<data::Tracks>(path, &data::ReadTracks);
  if (schema == data::kRunSchema) return Loaded<data::Run>(path, &data::ReadRun);
  if (schema == data::kRigSchema) return Loaded<data::Rig>(path, &data::ReadRig);
  if (schema == data::kSurveySchema) return Loaded<data::Survey>(path, &data::ReadSurvey);
  if (schema == data::kFitSchema) return LoadFit(path);
  if (schema == "unfurl/modes") return LoadModes(path);
  if (schema == data::kTrialSchema) {
    return py::cast(std::make_shared<data::TrialReader>(path.string()));
  }
  throw Error(fmt::format("holds '{}', which is not known here", schema), path.string(),
              "use a newer unfurl");
}

py::object LoadToml(const fs::path& path) {
  const data::TomlTable table = data::LoadToml(path.string());
  if (table.Has("study") || table.Has("parameter")) return LoadStudy(path);
  if (table.Has("camera")) {
    return py::cast(std::make_shared<data::Lab>(data::ReadLab(path.string())));
  }
  return LoadScene(path);
}

py::object LoadCsv(const fs::path& path) {
  const data::CsvTable table = data::CsvTable::Load(path.string());
  if (table.Find("mark") >= 0) return Loaded<data::Tracks>(path, &data::ReadTracksCsv);
  if (table.Find("u1") >= 0) return Loaded<data::Survey>(path, &data::ReadSurvey);
  return Loaded<data::Survey>(path, &data::ReadPointsCsv);
}

py::object Load(const fs::path& path, double sigma) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (ending == ".toml") return LoadToml(path);
  if (ending == ".csv") return LoadCsv(path);
  const auto exchange = [&](auto read) {
    return Loaded<data::Tracks>(path, [&](const std::string& p) { return read(p, sigma); });
  };
  if (ending == ".c3d") return exchange(&data::ReadTracksC3d);
  if (ending == ".uff" || ending == ".unv" || ending == ".uf") {
    return exchange(&data::ReadTracksUff);
  }
  return LoadH5(path);
}

}  // namespace

void BindLoad(py::module_& m) {
  m.def("load", &Load, py::arg("path"), py::kw_only(), py::arg("sigma") = 0.0,
        "Any file of Unfurl's: Tracks, Run, Rig, Survey, Trial, Fit, Modes, Scene, Study or Lab,\n"
        "by what it holds. sigma: of one axis of a point, where a .c3d or .uff tells none [m].");
}

}  // namespace unfurl::python
