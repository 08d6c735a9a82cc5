#include "data/formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <limits>

#include "base/error.h"
#include "data/h5.h"
#include "data/raw_layout.h"
#include "data/toml.h"
#include "data/toml_kind.h"
#include "data/tracks_exchange.h"
#include "data/trial.h"
#include "data/wand.h"

namespace unfurl::data {

namespace {

struct Ending {
  const char* text;
  FileFormat format;
};

constexpr Ending kEndings[] = {
    {".h5", FileFormat::kHdf5}, {".hdf5", FileFormat::kHdf5}, {".csv", FileFormat::kCsv},
    {".c3d", FileFormat::kC3d}, {".uff", FileFormat::kUff},   {".unv", FileFormat::kUff},
    {".uf", FileFormat::kUff},  {".toml", FileFormat::kToml},
};

// A CSV of tracks has a column of marks; the other CSV that is read here is a survey.
const char* KindOfCsv(const std::string& path) {
  const CsvTable table = CsvTable::Load(path);
  if (table.Find("mark") < 0) return kSurveySchema;
  return table.Find("pose") < 0 ? kTracksSchema : kWandSchema;
}

std::string KindOfToml(const std::string& path) { return KindOfDocument(LoadToml(path)); }

[[noreturn]] void Refuse(const std::string& path, const std::string& kind) {
  throw Error("holds " + kind + ", which is not one record", path,
              "give a run, tracks, a rig, a survey, a fit, a scene, a laboratory or a study");
}

AnyRecord LoadHdf5(const std::string& path) {
  const std::string schema = H5Reader::SchemaOf(path);
  if (schema == kRunSchema) return ReadRun(path);
  if (schema == kTracksSchema) return ReadTracks(path);
  if (schema == kRigSchema) return ReadRig(path);
  if (schema == kSurveySchema) return ReadSurvey(path);
  if (schema == kFitSchema) return ReadFit(path);
  Refuse(path, schema);
}

AnyRecord LoadTomlRecord(const std::string& path) {
  const std::string kind = KindOfToml(path);
  if (kind == "scene") return ReadScene(path);
  if (kind == "lab") return ReadLab(path);
  if (kind == "study") return ReadStudy(path);
  Refuse(path, kind);
}

}  // namespace

std::string EndingOf(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

FileFormat FormatOf(const std::string& path) {
  const std::string ending = EndingOf(path);
  for (const Ending& known : kEndings) {
    if (ending == known.text) return known.format;
  }
  return FileFormat::kUnknown;
}

bool HoldsTracks(FileFormat format) {
  return format != FileFormat::kToml && format != FileFormat::kUnknown;
}

std::string TracksEndings() {
  std::string all;
  for (const Ending& known : kEndings) {
    if (HoldsTracks(known.format)) all += (all.empty() ? "" : ", ") + std::string(known.text);
  }
  return all;
}

namespace {

Tracks ReadTracksByEnding(const std::string& path, double sigma) {
  switch (FormatOf(path)) {
    case FileFormat::kHdf5:
      return ReadTracks(path);
    case FileFormat::kCsv:
      return ReadTracksCsv(path);
    case FileFormat::kC3d:
      return ReadTracksC3d(path, sigma);
    case FileFormat::kUff:
      return ReadTracksUff(path, sigma);
    case FileFormat::kToml:
    case FileFormat::kUnknown:
      break;
  }
  throw Error("is no file of tracks by its ending", path, "tracks end in " + TracksEndings());
}

// Samples of a mark are taken in their order for those of its time.
void CheckOrder(const Tracks& tracks, const std::string& path) {
  for (std::size_t m = 0; m < tracks.marks.size(); ++m) {
    double last = -std::numeric_limits<double>::infinity();
    for (const std::size_t i : tracks.SamplesOf(static_cast<std::int32_t>(m))) {
      if (tracks.t[i] <= last) {
        throw Error(
            fmt::format("the stamps of {} do not ascend at t = {} s", tracks.marks[m], tracks.t[i]),
            path, "write the samples in order of time, one per stamp and mark");
      }
      last = tracks.t[i];
    }
  }
}

}  // namespace

Tracks ReadTracksAny(const std::string& path, double sigma) {
  Tracks tracks = ReadTracksByEnding(path, sigma);
  CheckOrder(tracks, path);
  return tracks;
}

void WriteTracksAny(const std::string& path, const Tracks& tracks, const Provenance& provenance) {
  switch (FormatOf(path)) {
    case FileFormat::kHdf5:
      return WriteTracks(path, tracks, provenance);
    case FileFormat::kCsv:
      return WriteTracksCsv(path, tracks);
    case FileFormat::kC3d:
      return WriteTracksC3d(path, tracks);
    case FileFormat::kUff:
      return WriteTracksUff(path, tracks);
    case FileFormat::kToml:
    case FileFormat::kUnknown:
      break;
  }
  throw Error("tracks cannot be written under this ending", path,
              "end the name in " + TracksEndings());
}

std::string KindOf(const std::string& path) {
  switch (FormatOf(path)) {
    case FileFormat::kToml:
      return KindOfToml(path);
    case FileFormat::kCsv:
      return KindOfCsv(path);
    case FileFormat::kC3d:
    case FileFormat::kUff:
      return kTracksSchema;
    case FileFormat::kUnknown: {
      std::error_code ignored;
      const auto type = std::filesystem::status(path, ignored).type();
      // HDF5 is never read from a pipe.
      if (type == std::filesystem::file_type::fifo ||
          type == std::filesystem::file_type::character) {
        return KindOfToml(path);
      }
      break;
    }
    case FileFormat::kHdf5:
      break;
  }
  return H5Reader::SchemaOf(path);
}

AnyRecord Load(const std::string& path) {
  switch (FormatOf(path)) {
    case FileFormat::kToml:
      return LoadTomlRecord(path);
    case FileFormat::kCsv: {
      const std::string kind = KindOfCsv(path);
      if (kind == kTracksSchema) return ReadTracksCsv(path);
      if (kind == kSurveySchema) return ReadSurvey(path);
      Refuse(path, kind);
    }
    case FileFormat::kC3d:
    case FileFormat::kUff:
      return ReadTracksAny(path);
    case FileFormat::kHdf5:
    case FileFormat::kUnknown:
      break;
  }
  return LoadHdf5(path);
}

}  // namespace unfurl::data
