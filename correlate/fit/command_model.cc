#include "correlate/fit/command_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "correlate/sampled_model.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/csv_cell.h"
#include "data/formats.h"
#include "data/run.h"
#include "data/scratch_folder.h"

namespace unfurl::correlate {

namespace {

namespace fs = std::filesystem;

constexpr char kParametersFile[] = "parameters.json";

// One mark's columns, of any of the forms.
struct MarkTable {
  std::vector<double> t;
  std::vector<double> column[6];  // x, y, z, vx, vy, vz; empty: not there
};
constexpr const char* kColumns[] = {"x", "y", "z", "vx", "vy", "vz"};

SampledModel FromTables(const std::string& path, const std::vector<std::string>& marks,
                        const std::vector<MarkTable>& tables) {
  Stamps stamps;
  Prediction prediction;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const MarkTable& table = tables[m];
    const auto n = static_cast<Eigen::Index>(table.t.size());
    if (n < 2) {
      throw Error(fmt::format("holds {} samples of {}", n, marks[m]), path, "write its motion");
    }
    for (std::size_t i = 1; i < table.t.size(); ++i) {
      if (!(table.t[i] > table.t[i - 1])) {
        throw Error(fmt::format("the times of {} do not rise at {} s", marks[m], table.t[i]), path,
                    "write each mark's samples in order of time");
      }
    }
    MarkMotion motion;
    motion.p = Eigen::Matrix3Xd::Zero(3, n);
    motion.v = Eigen::Matrix3Xd::Zero(3, n);
    const bool velocities = !table.column[3].empty() && !table.column[4].empty();
    for (int c = 0; c < 6; ++c) {
      const std::vector<double>& from = table.column[c];
      if (from.empty()) continue;
      auto to = c < 3 ? motion.p.row(c) : motion.v.row(c - 3);
      to = Eigen::Map<const Eigen::RowVectorXd>(from.data(), n);
    }
    if (!velocities) motion.v.resize(3, 0);
    stamps.marks.push_back(marks[m]);
    stamps.t.push_back(table.t);
    prediction.marks.push_back(std::move(motion));
  }
  return SampledModel(stamps, std::move(prediction));
}

}  // namespace

SampledModel ReadProgramTracks(const std::string& path, const std::vector<std::string>& marks,
                               const std::vector<std::string>& quantities) {
  if (data::FormatOf(path) == data::FileFormat::kHdf5)
    return SampledModel(data::ReadRun(path), marks, quantities);
  const data::CsvTable table = data::CsvTable::Load(path);
  std::vector<MarkTable> tables(marks.size());
  const int t = table.Require("t", "s");
  const int mark = table.Find("mark");
  for (std::size_t m = 0; m < marks.size(); ++m) {
    int column[6];
    for (int c = 0; c < 6; ++c) {
      const std::string name = mark >= 0 ? kColumns[c] : marks[m] + "." + kColumns[c];
      const char* unit = c < 3 ? "m" : "m/s";
      column[c] = c < 2 || table.Find(name) >= 0 ? table.Require(name, unit) : -1;
    }
    for (std::size_t i = 0; i < table.rows(); ++i) {
      if (mark >= 0 && table.Text(i, mark) != marks[m]) continue;
      tables[m].t.push_back(table.Number(i, t));
      for (int c = 0; c < 6; ++c) {
        if (column[c] >= 0) tables[m].column[c].push_back(table.Number(i, column[c]));
      }
    }
  }
  return FromTables(path, marks, tables);
}

CommandModel::CommandModel(CommandModelOptions options) : options_(std::move(options)) {
  for (const std::string& file : options_.files) {
    files_.emplace_back(fs::path(file).filename().string(), data::ReadTextFile(file));
  }
  std::vector<std::string> known = options_.parameters;
  known.insert(known.end(), {"folder", "study", "parameters", "stamps"});
  for (const std::string& word : options_.words) {
    for (std::size_t at = 0; (at = word.find('{', at)) != std::string::npos;) {
      const std::size_t end = word.find('}', at);
      if (end == std::string::npos) break;
      const std::string name = word.substr(at + 1, end - at - 1);
      // A name and nothing else; programs have braces of their own.
      const bool plain = !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-';
      });
      if (plain && std::find(known.begin(), known.end(), name) == known.end()) {
        throw Error(fmt::format("{{{}}} stands for nothing", name), "model.command",
                    "known here: " + JoinWords(known));
      }
      at = end;
    }
  }
}

Prediction CommandModel::Evaluate(std::span<const double> theta, const Stamps& stamps) const {
  Prediction out;
  for (int round = 0; round <= options_.retries; ++round) {
    out = Once(theta, stamps);
    if (out.status == ModelStatus::kGood) break;
  }
  return out;
}

Prediction CommandModel::Once(std::span<const double> theta, const Stamps& stamps) const {
  const auto start = std::chrono::steady_clock::now();
  Prediction out;
  const data::ScratchFolder scratch("unfurl-evaluation-");
  auto fail = [&](std::string why) {
    // The folder's name differs each time, and a record is to be the same each time.
    data::ReplaceAll(&why, scratch.path() + "/", "");
    out.status = ModelStatus::kFailed;
    out.message = why;
    return out;
  };
  nlohmann::ordered_json values;
  std::vector<std::pair<std::string, std::string>> names = {
      {"folder", scratch.path()},
      {"study", options_.study_folder},
      {"parameters", scratch.File(kParametersFile)},
      {"stamps", scratch.File("stamps.csv")}};
  for (std::size_t j = 0; j < options_.parameters.size(); ++j) {
    values[options_.parameters[j]] = theta[j];
    names.emplace_back(options_.parameters[j], fmt::format("{:.17g}", theta[j]));
  }
  data::WritePlain(scratch.File(kParametersFile), values.dump(2) + "\n");
  std::string list = "mark,t [s]\n";
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    const std::string mark = data::CsvCell(stamps.marks[m]);
    for (double t : stamps.t[m]) list += fmt::format("{},{:.17g}\n", mark, t);
  }
  data::WritePlain(scratch.File("stamps.csv"), list);
  for (auto [name, text] : files_) {
    for (const auto& [key, value] : names) data::ReplaceAll(&text, "{{" + key + "}}", value);
    data::WritePlain(scratch.File(name), text);
  }
  std::vector<std::string> words = options_.words;
  for (std::string& word : words) {
    for (const auto& [key, value] : names) data::ReplaceAll(&word, "{" + key + "}", value);
  }
  const std::string err = scratch.File(".stderr");
  const ProgramOutcome outcome =
      RunProgram(words, scratch.path(), scratch.File(".stdout"), err, options_.timeout);
  if (!outcome.started) return fail(fmt::format("{} does not start", words.front()));
  if (outcome.timed_out) return fail(fmt::format("not done in {} s", options_.timeout));
  if (outcome.code != 0) {
    const std::string last = data::LastLineOf(err);
    return fail(fmt::format("exit code {}{}{}", outcome.code, last.empty() ? "" : ": ", last));
  }
  try {
    std::vector<std::string> quantities;
    for (const QuantityStamps& q : stamps.quantities) quantities.push_back(q.quantity);
    out = ReadProgramTracks(scratch.File(options_.tracks), stamps.marks, quantities)
              .Evaluate({}, stamps);
  } catch (const Error& e) {
    return fail(e.what());
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

}  // namespace unfurl::correlate
