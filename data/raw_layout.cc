#include "data/raw_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "base/error.h"
#include "base/folder.h"
#include "base/text.h"
#include "data/beside.h"
#include "data/lab.h"
#include "data/toml.h"
#include "data/toml_kind.h"

namespace unfurl::data {

namespace {

namespace fs = std::filesystem;

// Names relative to the description; one '*' in the last part stands for anything, in order of
// names.
std::vector<std::string> FilesOf(const TomlTable& table, const char* key, const fs::path& folder) {
  std::vector<std::string> names;
  for (const std::string& name : table.Strings(key)) {
    const fs::path path = fs::path(name).is_absolute() ? fs::path(name) : folder / name;
    const std::string last = path.filename().string();
    if (last.find('*') == std::string::npos) {
      if (std::error_code failed; !fs::is_regular_file(path, failed)) {
        table.Fail(key, fmt::format("there is no file '{}'", path.string()), "check the name");
      }
      names.push_back(path.string());
      continue;
    }
    const std::vector<std::string> found = FilesLike(path.string());
    if (found.empty()) {
      table.Fail(key, fmt::format("no file is named like '{}'", path.string()), "check the name");
    }
    names.insert(names.end(), found.begin(), found.end());
  }
  if (names.empty()) table.Fail(key, "names no file", "list the files in order");
  return names;
}

RawLayout::Files ReadFiles(const TomlTable& table, const fs::path& folder) {
  RawLayout::Files files{.where = table.Where("files"), .lines = FilesOf(table, "files", folder)};
  if (table.Has("flat") != table.Has("flat_dark")) {
    table.Fail(table.Has("flat") ? "flat" : "flat_dark", "a flat field needs lit and dark lines",
               "give both `flat` and `flat_dark`, or none");
  }
  if (table.Has("flat")) {
    files.flat = FilesOf(table, "flat", folder);
    files.flat_dark = FilesOf(table, "flat_dark", folder);
  }
  return files;
}

// `own`: of one camera, whose table need only hold what differs from *f.
void ReadSensor(const TomlTable& t, bool own, LineFormat* f) {
  f->sensor = t.StringOr("name", f->sensor);
  f->dummy = t.IntegerOr("dummy", f->dummy, 0, 1000);
  f->dark = t.IntegerOr("dark", f->dark, 0, 1000);
  f->active = t.IntegerOr("active", f->active, 64, 100000);
  f->dark_after = t.IntegerOr("dark_after", f->dark_after, 0, 1000);
  f->parity = t.IntegerOr("parity", f->parity, 0, 1000);
  f->pitch = t.NumberOr("pitch", f->pitch, kPositive);
  f->bits = own ? t.IntegerOr("bits", f->bits, 8, 16) : t.Integer("bits", 8, 16);
  f->electrons_per_count =
      own ? t.NumberOr("electrons_per_count", f->electrons_per_count, kPositive)
          : t.Number("electrons_per_count", kPositive);
  f->read_noise_counts = own ? t.NumberOr("read_noise_counts", f->read_noise_counts, kNonNegative)
                             : t.Number("read_noise_counts", kNonNegative);
}

// [camera.NAME.sensor]: of a camera whose lines are not like the others'.
void ReadSensorsByCamera(const std::vector<std::pair<std::string, TomlTable>>& cameras,
                         LineFormats* formats) {
  const bool any = std::any_of(cameras.begin(), cameras.end(), [](const auto& camera) {
    return camera.second.TableOrNone("sensor").has_value();
  });
  if (!any) return;
  for (const auto& [name, table] : cameras) {
    formats->by_camera.emplace_back(static_cast<const LineFormat&>(*formats));
    if (const auto own = table.TableOrNone("sensor")) {
      ReadSensor(*own, true, &formats->by_camera.back());
    }
  }
}

void ReadSchedule(const TomlTable& t, bool survey, RawLayout* layout) {
  const std::vector<std::string> slots = t.Strings("slots");
  std::vector<std::string>& known = layout->header.slots;
  for (const std::string& slot : slots) {
    if (Trim(slot).empty())
      t.Fail("slots", "a slot has no name", R"(give a mark's name or "dark")");
    auto at = std::find(known.begin(), known.end(), slot);
    if (at == known.end()) at = known.insert(known.end(), slot);
    layout->cycle.push_back(static_cast<std::int32_t>(at - known.begin()));
  }
  if (std::count(known.begin(), known.end(), kDarkSlot) == 0) {
    t.Fail("slots", "no dark slot", R"(add "dark": the background is taken from it)");
  }
  layout->first_slot =
      static_cast<std::size_t>(t.IntegerOr("first_slot", 0, 0, static_cast<int>(slots.size()) - 1));
  // Of a survey nothing depends on it.
  layout->header.line_rate =
      survey ? t.NumberOr("line_rate", 1.0, kPositive) : t.Number("line_rate", kPositive);
  layout->start = t.NumberOr("start", 0.5 / layout->header.line_rate);
}

void ReadSurveyTable(const TomlTable& t, const TomlTable& recording, RawLayout* layout) {
  layout->survey.points = FileBeside(t, "points", layout->path);
  if (t.Has("ids") == t.Has("lines_each")) {
    t.Fail(t.Has("ids") ? "ids" : "points",
           "which line shows which point must be given in one way only",
           "give `lines_each`, or `ids`, a CSV with a row a line");
  }
  if (t.Has("ids")) {
    layout->survey.ids = FileBeside(t, "ids", layout->path);
  } else {
    layout->survey.lines_each = t.Integer("lines_each", 2, 1 << 20);
  }
  if (layout->header.slots.size() != 2) {
    recording.Fail("slots", "a survey lights one LED",
                   R"(give "dark" and one other name, in their turn)");
  }
}

void ReadBinary(const TomlTable& t, RawLayout* layout) {
  constexpr int kMostBytes = 1 << 30;  // of a header: more is a mistake
  layout->bytes = t.IntegerOr("bytes", 2, 1, 2);
  layout->big_endian = t.ChoiceOr("byte_order", "little", {"little", "big"}) == "big";
  layout->shift = t.IntegerOr("shift", 0, 0, 8);
  layout->file_header = static_cast<std::size_t>(t.IntegerOr("file_header", 0, 0, kMostBytes));
  layout->line_header = static_cast<std::size_t>(t.IntegerOr("line_header", 0, 0, kMostBytes));
  layout->line_trailer = static_cast<std::size_t>(t.IntegerOr("line_trailer", 0, 0, kMostBytes));
  for (std::size_t c = 0; c < std::max<std::size_t>(1, layout->header.cameras.size()); ++c) {
    const int bits = layout->header.format.Of(c).bits;
    if (bits + layout->shift <= 8 * layout->bytes) continue;
    t.Fail("bytes",
           fmt::format("{} bits shifted by {} do not fit into {} byte(s)", bits, layout->shift,
                       layout->bytes),
           "correct bytes, shift or sensor.bits");
  }
}

// Where lines lie in HDF5: a name for all cameras, or one for each. A camera's own counts.
void ReadDatasets(const TomlTable& recording,
                  const std::vector<std::pair<std::string, TomlTable>>& cameras,
                  RawLayout* layout) {
  const std::string common = recording.StringOr("dataset", "");
  for (std::size_t f = 0; f < layout->files.size(); ++f) {
    const bool own = f < cameras.size();
    layout->files[f].dataset = own ? cameras[f].second.StringOr("dataset", common) : common;
    if (!layout->files[f].dataset.empty()) continue;
    (own ? cameras[f].second : recording)
        .Fail("files", "does not say which dataset of the file holds the lines",
              R"(name it, as in dataset = "/entry/lines")");
  }
}

}  // namespace

RawLayout ReadRawLayout(const std::string& path) {
  const TomlTable root = LoadToml(path);
  RequireKind(root, "raw lines");
  const fs::path folder = fs::path(path).parent_path();
  RawLayout layout;
  layout.path = path;
  ReadSensor(root.Table("sensor"), false, &layout.header.format);
  const TomlTable recording = root.Table("recording");
  const std::string format = recording.Choice("format", {"binary", "csv", "png", "hdf5"});
  layout.format = format == "binary" ? RawLayout::Format::kBinary
                  : format == "csv"  ? RawLayout::Format::kCsv
                  : format == "png"  ? RawLayout::Format::kPng
                                     : RawLayout::Format::kHdf5;
  const std::optional<TomlTable> survey = root.TableOrNone("survey");
  ReadSchedule(recording, survey.has_value(), &layout);
  if (survey) ReadSurveyTable(*survey, recording, &layout);
  if (recording.Has("stamps")) {
    if (survey) {
      recording.Fail("stamps", "the lines of a survey need no stamps",
                     "leave it out; survey.ids already assigns lines to points");
    }
    layout.stamps = FileBeside(recording, "stamps", layout.path);
  }

  const auto cameras = root.NamedTables("camera");
  if (recording.Has("cameras")) {
    if (!cameras.empty()) {
      recording.Fail("cameras", "cameras are named here and in tables of their own",
                     "list them here with `files`, or give each a table [camera.NAME]");
    }
    layout.header.cameras = recording.Strings("cameras");
    layout.files.push_back(ReadFiles(recording, folder));
  } else {
    for (const auto& [name, table] : cameras) {
      layout.header.cameras.push_back(name);
      layout.files.push_back(ReadFiles(table, folder));
    }
    ReadSensorsByCamera(cameras, &layout.header.format);
  }
  if (layout.format == RawLayout::Format::kBinary) ReadBinary(recording, &layout);
  if (layout.format == RawLayout::Format::kPng || layout.format == RawLayout::Format::kHdf5) {
    layout.shift = recording.IntegerOr("shift", 0, 0, 8);
  }
  if (layout.format == RawLayout::Format::kHdf5) ReadDatasets(recording, cameras, &layout);
  std::vector<std::string> names = layout.header.cameras;
  std::sort(names.begin(), names.end());
  if (names.empty() || std::adjacent_find(names.begin(), names.end()) != names.end()) {
    root.Fail("camera", names.empty() ? "no camera" : "a camera is named twice",
              "add a table [camera.NAME], or list recording.cameras");
  }
  for (const RawLayout::Files& files : layout.files) {
    if (files.flat.empty() != layout.files[0].flat.empty()) {
      throw Error("some cameras have a flat field and some have none", files.where,
                  "give `flat` and `flat_dark` to all of them");
    }
  }
  root.RefuseUnknownKeys();
  return layout;
}

}  // namespace unfurl::data
