#include <fmt/format.h>

#include "base/error.h"
#include "campaign/record.h"
#include "data/csv.h"
#include "data/fit.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/lab.h"
#include "data/modes.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/scene.h"
#include "data/study.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "data/wand.h"
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
  if (schema == data::kRunSchema)
    return Loaded<data::Run>(path, [](const std::string& p) { return data::ReadRun(p, true); });
  if (schema == data::kRigSchema) return Loaded<data::Rig>(path, &data::ReadRig);
  if (schema == data::kSurveySchema) return Loaded<data::Survey>(path, &data::ReadSurvey);
  if (schema == data::kWandSchema) return Loaded<data::WandReadings>(path, &data::ReadWand);
  if (schema == campaign::kCampaignSchema) return LoadCampaign(path);
  if (schema == data::kFitSchema) return LoadFit(path);
  if (schema == data::kModesSchema) return LoadModes(path);
  if (schema == data::kTrialSchema) {
    return py::cast(std::make_shared<data::TrialReader>(path.string()));
  }
  throw Error(fmt::format("holds '{}', which is not known here", schema), path.string(),
              "use a newer unfurl");
}

py::object LoadToml(const fs::path& path) {
  const std::string kind = data::KindOf(path.string());
  if (kind == "study") return LoadStudy(path);
  if (kind == "lab") return py::cast(std::make_shared<data::Lab>(data::ReadLab(path.string())));
  if (kind == "campaign") {
    throw Error("is a plan of many runs", path.string(), "unfurl.campaign(path) runs it");
  }
  if (kind == "raw lines") {
    throw Error("describes raw lines, which are read into a trial or a survey first", path.string(),
                "unfurl.read_lines(path, 'trial.h5')");
  }
  return LoadScene(path);
}

// Tracks, readings of a bar, a survey, or its points alone.
py::object LoadCsv(const fs::path& path) {
  const std::string kind = data::KindOf(path.string());
  if (kind == data::kTracksSchema) return Loaded<data::Tracks>(path, &data::ReadTracksCsv);
  if (kind == data::kWandSchema) return Loaded<data::WandReadings>(path, &data::ReadWand);
  const bool readings = data::CsvTable::Load(path.string()).Find("u1") >= 0;
  return readings ? Loaded<data::Survey>(path, &data::ReadSurvey)
                  : Loaded<data::Survey>(path, &data::ReadPointsCsv);
}

py::object Load(const py::object& path_like, double sigma) {
  const fs::path path = PathFrom(path_like, "a path");
  switch (data::FormatOf(path.string())) {
    case data::FileFormat::kToml:
      return LoadToml(path);
    case data::FileFormat::kCsv:
      return LoadCsv(path);
    case data::FileFormat::kC3d:
    case data::FileFormat::kUff:
      return Loaded<data::Tracks>(
          path, [&](const std::string& name) { return data::ReadTracksAny(name, sigma); });
    case data::FileFormat::kHdf5:
    case data::FileFormat::kUnknown:
      break;
  }
  return LoadH5(path);
}

}  // namespace

void BindLoad(py::module_& m) {
  m.def("load", &Load, py::arg("path"), py::kw_only(), py::arg("sigma") = 0.0,
        "Any file of Unfurl's: Tracks, Run, Rig, Survey, Wand, Trial, Fit, Modes, Scene, Study, "
        "Lab or\n"
        "Campaign, by what it holds. sigma: of one axis of a point, where a .c3d or .uff tells\n"
        "none [m].");
}

}  // namespace unfurl::python
