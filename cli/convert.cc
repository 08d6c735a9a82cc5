#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/error.h"
#include "base/progress.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/raw_layout.h"
#include "data/run.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "data/wand.h"
#include "measure/raw_lines.h"
#include "measure/raw_survey.h"
#include "measure/survey_readings.h"

namespace unfurl::cli {

namespace {

// Block by block: a run may be larger than memory.
void RunToCsv(const std::string& in, const std::string& out) {
  constexpr std::size_t kBlockRows = 4096;  // samples in memory at once
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

// The files of a description, by their hashes.
data::Provenance ProvenanceOf(const Common& common, const data::RawLayout& layout) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(layout.path);
  for (const data::RawLayout::Files& files : layout.files) {
    for (const auto* list : {&files.lines, &files.flat, &files.flat_dark}) {
      for (const std::string& file : *list) provenance.AddInput(file);
    }
  }
  for (const auto* file : {&layout.stamps, &layout.survey.points, &layout.survey.ids}) {
    if (!file->empty()) provenance.AddInput(*file);
  }
  return provenance;
}

// Raw lines, described by a person, into a trial.
void RawToTrial(const Common& common, const data::RawLayout& layout, const std::string& out) {
  constexpr std::size_t kBlock = 256;  // lines held at once
  const data::Provenance provenance = ProvenanceOf(common, layout);
  Progress progress("convert", !common.quiet && !common.json);
  measure::RawLines lines(layout);
  data::TrialWriter trial(out, lines.header(), provenance);
  data::TrialBlock block;
  while (lines.Read(kBlock, &block)) {
    trial.Append(block);
    progress.Update(lines.done());
  }
  trial.Commit();
}

// The same of a survey's points, into readings.
std::vector<std::string> RawToSurvey(const Common& common, const data::RawLayout& layout,
                                     const std::string& out) {
  const data::CsvTable table = data::CsvTable::Load(layout.survey.points);
  data::Survey survey;
  if (!data::ReadSurveyPoints(table, &survey)) {
    throw Error("states no uncertainty of its points", layout.survey.points,
                "add columns 'sx [m]', 'sy [m]' and 'sz [m]'");
  }
  const data::Provenance provenance = ProvenanceOf(common, layout);
  Progress progress("convert", !common.quiet && !common.json);
  const data::ReadingTable readings =
      measure::ReadRawSurvey(layout, survey.id, [&](double done) { progress.Update(done); });
  data::JoinReadings(readings, layout.path, &survey);
  Eigen::Index unseen = 0;
  for (Eigen::Index i = 0; i < survey.u_px.rows(); ++i) {
    unseen += survey.u_px.row(i).array().isNaN().all() ? 1 : 0;
  }
  if (unseen > 0)
    survey.notes.push_back(fmt::format("{} {} seen by no camera",
                                       Counted(static_cast<std::size_t>(unseen), "point"),
                                       unseen == 1 ? "is" : "are"));
  data::WriteSurvey(out, survey, provenance);
  return survey.notes;
}

[[noreturn]] void Refuse(const std::string& what, const std::string& out) {
  throw Error(
      fmt::format("{} cannot become '{}'", what, std::filesystem::path(out).extension().string()),
      out,
      "runs become .csv; surveys and readings of a bar go between .h5 and .csv; tracks between "
      ".h5, .csv, .c3d and .uff; a description of raw lines (.toml) becomes a trial or a survey "
      "(.h5)");
}

void ConvertWand(const std::string& in, const std::string& out, data::Provenance& provenance) {
  const data::FileFormat to = data::FormatOf(out);
  const bool to_csv = to == data::FileFormat::kCsv;
  if (!to_csv && to != data::FileFormat::kHdf5) Refuse("readings of a bar", out);
  const data::WandReadings readings = data::ReadWand(in);
  provenance.AddInput(in);
  if (to_csv) {
    data::WriteWandCsv(out, readings);
  } else {
    data::WriteWand(out, readings, provenance);
  }
}

std::string ConvertFile(const Common& common, const std::string& in, const std::string& out,
                        double sigma, std::vector<std::string>* notes) {
  const data::FileFormat from = data::FormatOf(in), to = data::FormatOf(out);
  std::error_code ignored;
  if (!std::filesystem::exists(in, ignored)) throw Error("no such file", in, "check the name");
  if (from == data::FileFormat::kToml) {
    const data::RawLayout layout = data::ReadRawLayout(in);
    if (to != data::FileFormat::kHdf5) Refuse("a description of raw lines", out);
    if (!layout.survey.points.empty()) {
      *notes = RawToSurvey(common, layout, out);
      return data::kSurveySchema;
    }
    RawToTrial(common, layout, out);
    return data::kTrialSchema;
  }
  data::Provenance provenance = StartProvenance(common);
  std::string schema = data::KindOf(in);
  if (schema == data::kTracksSchema) {
    if (!data::HoldsTracks(to)) Refuse("tracks", out);
    const data::Tracks tracks = data::ReadTracksAny(in, sigma);
    provenance.AddInput(in);
    data::WriteTracksAny(out, tracks, provenance);
    return schema;
  }
  if (schema == data::kWandSchema) {
    ConvertWand(in, out, provenance);
    return schema;
  }
  if (from == data::FileFormat::kCsv) {
    if (to != data::FileFormat::kHdf5) Refuse("a CSV file", out);
    const data::Survey survey = data::ReadSurvey(in);
    provenance.AddInput(in);
    data::WriteSurvey(out, survey, provenance);
    return data::kSurveySchema;
  }
  if (to != data::FileFormat::kCsv) Refuse(schema, out);
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
  Verb verb = DeclareVerb(program, common, "convert",
                          "A run, tracks, survey or readings of a bar in another format; raw "
                          "lines into a trial or a survey",
                          "unfurl convert tracks.h5 tracks.c3d\n"
                          "  unfurl convert lines.toml trial.h5     (raw lines of a frame "
                          "grabber, described in TOML)");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  struct Arguments {
    std::string in, out;
    double sigma = 0.0;
  };
  auto arguments = std::make_shared<Arguments>();
  files
      .Read("IN", &arguments->in,
            "A run, tracks or survey (.h5), tracks or a survey (.csv), tracks (.c3d, .uff), "
            "a description of raw lines (.toml)")
      ->required();
  files.Write("OUT", &arguments->out, "The file to write; its ending gives the format")->required();
  app->add_option("--sigma", arguments->sigma,
                  "Standard deviation of a point per axis [m], where a .c3d or .uff states none");
  verb.run = [&common, arguments] {
    std::vector<std::string> notes;
    const std::string schema =
        ConvertFile(common, arguments->in, arguments->out, arguments->sigma, &notes);
    nlohmann::ordered_json summary = {
        {"in", arguments->in}, {"out", arguments->out}, {"schema", schema}};
    std::string text = fmt::format("{} -> {}  ({})", arguments->in, arguments->out, schema);
    if (!notes.empty()) summary["notes"] = notes;
    for (const std::string& note : notes) text += "\n  - " + note;
    Finish(common, summary, text);
    return kExitGood;
  };
  return verb;
}

}  // namespace unfurl::cli
