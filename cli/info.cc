#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/error.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/h5_walk.h"
#include "data/run.h"
#include "data/toml.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

std::string DimsText(const std::vector<std::size_t>& dims) {
  return fmt::format("{}", fmt::join(dims, " x "));
}

void ListDatasets(const data::H5Reader& reader, ordered_json* sets,
                  std::vector<std::vector<std::string>>* rows) {
  for (const std::string& path : data::H5ListDatasets(reader.path())) {
    sets->push_back({{"path", path},
                     {"shape", reader.Dims(path)},
                     {"units", reader.Units(path)},
                     {"description", reader.Description(path)}});
    if (path.starts_with("/letters_")) continue;  // places of letters, of texts
    rows->push_back({path, DimsText(reader.Dims(path)), "[" + reader.Units(path) + "]",
                     reader.Description(path)});
  }
}

// Those of a run, which lie side by side in its tables.
std::string ListQuantities(const std::string& path, ordered_json* list) {
  *list = ordered_json::array();
  std::vector<std::vector<std::string>> rows = {{"quantity", "unit", "what it is"}};
  const data::RunReader run(path);
  for (const data::Quantity& q : run.quantities()) {
    list->push_back({{"name", q.name}, {"units", q.units}, {"description", q.description}});
    rows.push_back({q.name, "[" + q.units + "]", q.description});
  }
  return AlignedTable(rows);
}

// The numbers of the whole run; those that are not known are left out.
std::string ListSummary(const data::H5Reader& file, ordered_json* list) {
  *list = ordered_json::array();
  std::vector<std::vector<std::string>> rows = {{"number", "value", "unit", "what it is"}};
  for (const auto& [of, value] : data::ReadSummary(file)) {
    if (std::isnan(value)) continue;
    list->push_back({{"name", of.name},
                     {"value", value},
                     {"units", of.units},
                     {"description", of.description}});
    rows.push_back({of.name, fmt::format("{:.8g}", value), "[" + of.units + "]", of.description});
  }
  return AlignedTable(rows);
}

int InfoHdf5(const Common& common, const std::string& path) {
  const std::string schema = data::H5Reader::SchemaOf(path);
  const data::H5Reader reader(path, schema, std::numeric_limits<int>::max());
  const data::Provenance made = reader.ReadProvenance();

  ordered_json summary = {{"file", path},
                          {"schema", schema},
                          {"schema_version", reader.schema_version()},
                          {"program", made.program},
                          {"command", made.command}};
  std::string text = fmt::format("{}: {} (version {})\n", path, schema, reader.schema_version());
  text += fmt::format("made by   {}\ncommand   {}\n", made.program, made.command);
  for (const data::InputFile& input : made.inputs) {
    summary["inputs"].push_back({{"path", input.path}, {"sha256", input.sha256}});
    text += fmt::format("from      {}  sha256 {}...\n", input.path, input.sha256.substr(0, 16));
  }
  for (const auto& [key, value] : made.options) {
    summary["options"][key] = value;
    text += fmt::format("option    {} = {}\n", key, value);
  }
  if (made.seed) {
    summary["seed"] = *made.seed;
    text += fmt::format("seed      {}\n", *made.seed);
  }
  for (const auto& [name, value] : reader.Attributes("/")) {
    if (made.options.contains(name) || name == "schema" || name == "schema_version" ||
        name == "program" || name == "command" || name == "inputs" || name == "options" ||
        name == "seed") {
      continue;
    }
    summary["attributes"][name] = value;
    const std::string first = value.substr(0, value.find('\n'));
    text += fmt::format("{:<9} {}{}\n", name, first.substr(0, 100),
                        first.size() < value.size() || first.size() > 100 ? " ..." : "");
  }
  std::vector<std::vector<std::string>> rows = {{"dataset", "shape", "unit", "what it is"}};
  summary["datasets"] = ordered_json::array();
  ListDatasets(reader, &summary["datasets"], &rows);
  text += AlignedTable(rows);
  if (schema == data::kRunSchema) {
    text += ListQuantities(path, &summary["quantities"]);
    text += ListSummary(reader, &summary["numbers"]);
  }
  Finish(common, summary, text);
  return kExitGood;
}

int InfoCsv(const Common& common, const std::string& path) {
  const data::CsvTable table = data::CsvTable::Load(path);
  ordered_json summary = {{"file", path}, {"rows", table.rows()}};
  std::string text = fmt::format("{}: CSV, {}\n", path, Counted(table.rows(), "row"));
  for (const std::string& comment : table.comments()) text += "# " + comment + "\n";
  std::vector<std::vector<std::string>> rows = {{"column", "unit", "first", "last"}};
  for (std::size_t c = 0; c < table.columns().size(); ++c) {
    const data::CsvColumn& column = table.columns()[c];
    summary["columns"].push_back({{"name", column.name}, {"units", column.unit}});
    const int index = static_cast<int>(c);
    rows.push_back({column.name, "[" + column.unit + "]",
                    table.rows() > 0 ? table.Text(0, index) : "",
                    table.rows() > 0 ? table.Text(table.rows() - 1, index) : ""});
  }
  Finish(common, summary, text + AlignedTable(rows));
  return kExitGood;
}

// Tracks of another program: where no standard deviations are given, marks and times still are.
int InfoForeignTracks(const Common& common, const std::string& path) {
  constexpr double kAnySigma = 1.0;  // [m]; nothing of it is shown
  const data::Tracks tracks = data::ReadTracksAny(path, kAnySigma);
  ordered_json summary = {{"file", path},
                          {"schema", data::kTracksSchema},
                          {"sha256", data::FileSha256(path)},
                          {"samples", tracks.size()},
                          {"marks", tracks.marks}};
  std::string text = fmt::format("{}: tracks, {} of {}", path, Counted(tracks.size(), "sample"),
                                 JoinWords(tracks.marks));
  if (tracks.size() > 0) {
    const auto [first, last] = std::minmax_element(tracks.t.begin(), tracks.t.end());
    summary["from"] = *first;
    summary["to"] = *last;
    text += fmt::format(", {:.6g} to {:.6g} s", *first, *last);
  }
  Finish(common, summary, text);
  return kExitGood;
}

int InfoToml(const Common& common, const std::string& path) {
  const data::TomlTable table = data::LoadToml(path);
  const std::string kind = data::KindOf(path);
  ordered_json summary = {{"file", path}, {"kind", kind}, {"sha256", data::FileSha256(path)}};
  std::vector<std::vector<std::string>> rows = {{"key", "holds"}};
  summary["keys"] = ordered_json::object();
  auto& keys = summary["keys"].get_ref<ordered_json::object_t&>();
  for (const auto& [key, holds] : table.Outline()) {
    keys.push_back({key, holds});  // unlike [], which looks through all of them each time
    rows.push_back({key, holds});
  }
  Finish(common, summary, fmt::format("{}: {}\n", path, kind) + AlignedTable(rows));
  return kExitGood;
}

}  // namespace

Verb AddInfo(CLI::App& program, Common& common) {
  Verb verb =
      DeclareVerb(program, common, "info",
                  "What a file is, which program made it from which inputs, and what it holds",
                  "unfurl info tracks.h5");
  auto file = std::make_shared<std::string>();
  verb.files->Read("FILE", file.get(), "Any file that unfurl reads or writes")->required();
  verb.run = [&common, file] {
    switch (data::FormatOf(*file)) {
      case data::FileFormat::kToml:
        return InfoToml(common, *file);
      case data::FileFormat::kCsv:
        return InfoCsv(common, *file);
      case data::FileFormat::kC3d:
      case data::FileFormat::kUff:
        return InfoForeignTracks(common, *file);
      case data::FileFormat::kHdf5:
      case data::FileFormat::kUnknown:
        break;
    }
    return InfoHdf5(common, *file);
  };
  return verb;
}

}  // namespace unfurl::cli
