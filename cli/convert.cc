#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/raw_layout.h"
#include "data/run.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/tracks_exchange.h"
#include "data/trial.h"
#include "measure/raw_lines.h"
#include "measure/survey_readings.h"

namespace unfurl::cli {

namespace {

std::string Ending(const std::string& path) {
  return std::filesystem::path(path).extension().string();
}

// Block by block: a run may be larger than memory.
void RunToCsv(const std::string& in, const std::string& out) {
  constexpr std::size_t kBlockRows = 4096;
  const data::RunReader run(in);
  std::vector<data::CsvColumn> columns = {{"t", "s"}};
  for (const data::Quantity& quantity : run.quantities()) {
    columns.push_back({quantity.name, quantity.units});
  }
  data::TextFileWriter file(out);
  data::CsvWriter writer(columns);
  std::vector<double> row(columns.size()), t;
  std::vector<std::vector<double>> block;
  for (std::size_t first = 0; first < run.samples(); first += kBlockRows) {
    const std::size_t count = std::min(kBlockRows, run.samples() - first);
    run.Read(first, count, &t, &block);
    for (std::size_t i = 0; i < count; ++i) {
      row[0] = t[i];
      for (std::size_t q = 0; q < block.size(); ++q) row[q + 1] = block[q][i];
      writer.Row(row);
    }
    file.Append(writer.Take());
  }
  file.Append(writer.Take());
  file.Commit();
}

// Raw lines, described by a person, into a trial. Returns the number of lines.
std::size_t RawToTrial(const Common& common, const std::string& in, const std::string& out) {
  constexpr std::size_t kBlock = 256;  // lines held at once
  const data::RawLayout layout = data::ReadRawLayout(in);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(in);
  for (const data::RawLayout::Files& files : layout.files) {
    for (const auto* list : {&files.lines, &files.flat, &files.flat_dark}) {
      for (const std::string& file : *list) provenance.AddInput(file);
    }
  }
  if (!layout.stamps.empty()) provenance.AddInput(layout.stamps);
  Progress progress("convert", !common.quiet && !common.json);
  measure::RawLines lines(layout);
  data::TrialWriter trial(out, lines.header(), provenance);
  data::TrialBlock block;
  std::size_t count = 0;
  while (lines.Read(kBlock, &block)) {
    trial.Append(block);
    count += block.size();
    progress.Update(lines.done());
  }
  trial.Commit();
  return count;
}

[[noreturn]] void Refuse(const std::string& what, const std::string& out) {
  throw Error(
      fmt::format("{} cannot become '{}'", what, Ending(out)), out,
      "runs become .csv; surveys go between .h5 and .csv; tracks between .h5, .csv, .c3d and "
      ".uff; a description of raw lines (.toml) becomes a trial (.h5)");
}

bool IsUff(const std::string& path) {
  return Ending(path) == ".uff" || Ending(path) == ".unv" || Ending(path) == ".uf";
}

// Tracks from another field's file, if it is one.
bool ReadForeign(const std::string& in, double sigma, data::Tracks* tracks) {
  if (Ending(in) == ".c3d") {
    *tracks = data::ReadTracksC3d(in, sigma);
  } else if (IsUff(in)) {
    *tracks = data::ReadTracksUff(in, sigma);
  } else {
    return false;
  }
  return true;
}

void WriteTracksAs(const std::string& out, const data::Tracks& tracks,
                   const data::Provenance& provenance) {
  if (Ending(out) == ".h5") {
    data::WriteTracks(out, tracks, provenance);
  } else if (Ending(out) == ".csv") {
    data::WriteTracksCsv(out, tracks);
  } else if (Ending(out) == ".c3d") {
    data::WriteTracksC3d(out, tracks);
  } else if (IsUff(out)) {
    data::WriteTracksUff(out, tracks);
  } else {
    Refuse("tracks", out);
  }
}

std::string ConvertFile(const Common& common, const std::string& in, const std::string& out,
                        double sigma) {
  if (Ending(in) == ".toml") {
    if (Ending(out) != ".h5") Refuse("a description of raw lines", out);
    RawToTrial(common, in, out);
    return data::kTrialSchema;
  }
  data::Provenance provenance = StartProvenance(common);
  data::Tracks foreign;
  if (ReadForeign(in, sigma, &foreign)) {
    provenance.AddInput(in);
    WriteTracksAs(out, foreign, provenance);
    return data::kTracksSchema;
  }
  if (Ending(in) == ".csv") {
    provenance.AddInput(in);
    if (data::CsvTable::Load(in).Find("mark") >= 0) {
      WriteTracksAs(out, data::ReadTracksCsv(in), provenance);
      return data::kTracksSchema;
    }
    if (Ending(out) != ".h5") Refuse("a CSV file", out);
    data::WriteSurvey(out, data::ReadSurvey(in), provenance);
    return data::kSurveySchema;
  }
  const std::string schema = data::H5Reader::SchemaOf(in);
  if (schema == data::kTracksSchema) {
    provenance.AddInput(in);
    WriteTracksAs(out, data::ReadTracks(in), provenance);
    return schema;
  }
  if (Ending(out) != ".csv") Refuse(schema, out);
  if (schema == data::kRunSchema) {
    RunToCsv(in, out);
  } else if (schema == data::kSurveySchema) {
    data::Survey survey = data::ReadSurvey(in);
    measure::FindSurveyReadings(&survey);  // a CSV holds numbers, not lines
    data::WriteSurveyCsv(out, survey);
  } else {
    Refuse(schema, out);
  }
  return schema;
}

}  // namespace

Verb AddConvert(CLI::App& program, Common& common) {
  CLI::App* app = DeclareVerb(program, common, "convert",
                              "A run, tracks or survey in another format; raw lines into a trial",
                              "unfurl convert tracks.h5 tracks.c3d\n"
                              "  unfurl convert lines.toml trial.h5     (raw lines of a frame "
                              "grabber, described in TOML)");
  struct Arguments {
    std::string in, out;
    double sigma = 0.0;
  };
  auto arguments = std::make_shared<Arguments>();
  app->add_option("IN", arguments->in,
                  "A run, tracks or survey (.h5), tracks or a survey (.csv), tracks (.c3d, .uff), "
                  "a description of raw lines (.toml)")
      ->required();
  app->add_option("OUT", arguments->out, "The file to write; its ending tells the format")
      ->required();
  app->add_option("--sigma", arguments->sigma,
                  "Of one axis of a point [m], where a .c3d or .uff tells none");
  return {app, [&common, arguments] {
            const std::string schema =
                ConvertFile(common, arguments->in, arguments->out, arguments->sigma);
            Finish(common, {{"in", arguments->in}, {"out", arguments->out}, {"schema", schema}},
                   fmt::format("{} -> {}  ({})", arguments->in, arguments->out, schema));
            return kExitGood;
          }};
}

}  // namespace unfurl::cli
