#include "tests/fuzz/inner_readers.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "base/error.h"
#include "base/length.h"
#include "correlate/fit/command_model.h"
#include "correlate/fit/evaluation_store.h"
#include "correlate/sampled_model.h"
#include "data/atomic_file.h"
#include "data/expression.h"
#include "data/h5.h"
#include "data/h5_walk.h"
#include "data/journal.h"
#include "data/live_stream.h"
#include "data/run.h"
#include "data/toml.h"
#include "data/trial.h"
#include "measure/raw_lines.h"

namespace unfurl::fuzz {

void ReadInfo(const std::string& path) {
  const std::string schema = data::H5Reader::SchemaOf(path);
  const data::H5Reader reader(path, schema, 1 << 30);
  reader.ReadProvenance();
  reader.Attributes("/");
  for (const std::string& set : data::H5ListDatasets(path)) {
    reader.Dims(set);
    reader.Units(set);
    reader.Description(set);
  }
}

void ReadTrialBlocks(const std::string& path) {
  const data::TrialReader trial(path);
  data::TrialBlock block;
  for (std::size_t first = 0; first < trial.size(); first += 512) {
    trial.Read(first, std::min<std::size_t>(512, trial.size() - first), &block);
  }
}

void ReadRunRows(const std::string& path) {
  const data::RunReader run(path);
  std::vector<double> t;
  std::vector<std::vector<double>> columns;
  for (std::size_t first = 0; first < run.samples(); first += 512) {
    run.Read(first, std::min<std::size_t>(512, run.samples() - first), &t, &columns);
  }
}

void ReadRawLines(data::RawLayout::Format format, const std::string& path) {
  data::RawLayout layout;
  layout.path = "lines.toml";
  layout.format = format;
  layout.header.cameras = {"left", "right"};
  layout.header.slots = {"tip", "dark"};
  data::LineFormat& line = layout.header.format;
  line.dummy = 1, line.dark = 4, line.active = 12, line.dark_after = 2, line.parity = 1;
  line.bits = format == data::RawLayout::Format::kPng ? 8 : 10;
  line.electrons_per_count = 10.0;
  layout.header.line_rate = 1000.0;
  layout.cycle = {0, 1};
  layout.file_header = 4, layout.line_header = 2, layout.line_trailer = 1;
  layout.files.resize(1);
  layout.files[0].lines = {path};
  layout.files[0].dataset = "/lines";
  measure::RawLines lines(layout);
  data::TrialBlock block;
  while (lines.Read(64, &block)) {
  }
}

void ReadJournal(const std::string& path) {
  struct None : correlate::Workers {
    void Run(std::span<const correlate::Job>,
             const std::function<void(std::size_t, correlate::Prediction)>&) override {}
  } none;
  const std::string result = fmt::format("/dev/shm/unfurl-fuzz-{}-journal", getpid());
  const std::string partial = result + ".partial";
  std::filesystem::copy_file(path, partial, std::filesystem::copy_options::overwrite_existing);
  std::filesystem::permissions(partial, std::filesystem::perms::owner_all);
  struct Remove {
    std::string path;
    ~Remove() { unlink(path.c_str()); }
  } const remove{partial};
  data::Journal journal(result, "fuzz", true);
  const correlate::JournaledWorkers workers(none, journal);
}

void ReadEvaluation(const std::string& path) {
  correlate::Prediction prediction;
  if (!correlate::ParseAnswer(data::ReadTextFile(path), &prediction)) {
    throw Error("is no evaluation", path, "start anew");
  }
}

void ReadExpression(const std::string& path) {
  const data::Expression expression(data::ReadTextFile(path), "scene.toml:1:value");
  expression.At(0.3);
  expression.Value(0.7);
  if (expression.text().size() > 200) return;  // what follows looks at thousands of times
  expression.FindFault(1.0, 2, 64);
  expression.Edges(1.0);
}

void ReadOverrides(const std::string& path) {
  std::istringstream lines(data::ReadTextFile(path));
  std::vector<std::string> overrides;
  for (std::string line; std::getline(lines, line);) overrides.push_back(line);
  const std::string scene = fmt::format("/dev/shm/unfurl-fuzz-{}-scene.toml", getpid());
  if (!std::filesystem::exists(scene)) {
    data::WriteTextFile(scene,
                        "a = 1\n[b]\nc = [1, 2.5, 'x']\n[[d]]\ne = true\n[[d]]\nf = {g = 1}\n");
  }
  data::LoadToml(scene, overrides).Outline();
}

void ReadLength(const std::string& path) {
  double metres = 0.0;
  if (!ParseLength(data::ReadTextFile(path), &metres)) throw Error("is no length", path, "0.5mm");
}

void ReadAnswerOfProgram(const std::string& path) {
  correlate::ReadProgramTracks(path, {"tip", "mid"});
}

void ReadLiveStream(const std::string& path) {
  constexpr std::size_t kPiece = 777;  // bytes: no line ends where a piece does
  const std::string bytes = data::ReadTextFile(path);
  data::LiveStreamReader reader(path);
  data::TrialBlock lines;
  data::TrialReadings flashes;
  for (std::size_t at = 0; at < bytes.size(); at += kPiece) {
    reader.Feed(std::string_view(bytes).substr(at, kPiece));
    if (reader.header() == nullptr) continue;
    while ((reader.header()->readings ? reader.Take(3, &flashes) : reader.Take(3, &lines)) > 0) {
    }
  }
  reader.Close();
}

}  // namespace unfurl::fuzz
