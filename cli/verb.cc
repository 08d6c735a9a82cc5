#include "cli/verb.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/text.h"

namespace unfurl::cli {

CLI::App* DeclareVerb(CLI::App& program, Common& common, const std::string& name,
                      const std::string& summary, const std::string& example) {
  CLI::App* verb = program.add_subcommand(name, summary);
  verb->add_flag("--json", common.json, "Print a machine-readable summary on stdout");
  verb->add_flag("--quiet", common.quiet, "Print nothing but errors");
  verb->footer("Example:\n  " + example);
  return verb;
}

std::string DefaultOutput(const std::string& input, const std::string& suffix) {
  return std::filesystem::path(input).stem().string() + suffix;
}

data::Provenance StartProvenance(const Common& common) {
  data::Provenance provenance;
  provenance.program = data::ProgramVersion();
  provenance.command = common.command_line;
  return provenance;
}

void Finish(const Common& common, const nlohmann::ordered_json& summary, const std::string& text) {
  if (common.json) {
    std::fputs((summary.dump(2) + "\n").c_str(), stdout);
  } else if (!common.quiet) {
    std::fputs(text.c_str(), stdout);
    if (!text.empty() && text.back() != '\n') std::fputc('\n', stdout);
  }
}

namespace {

bool IsNumber(const std::string& cell) {
  double value;
  return ParseDouble(cell, &value);
}

// Columns in UTF-8 are as wide as their code points.
std::size_t Width(const std::string& cell) {
  return static_cast<std::size_t>(
      std::count_if(cell.begin(), cell.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace

std::string AlignedTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> width;
  std::vector<bool> numeric;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      if (c >= width.size()) width.push_back(0), numeric.push_back(true);
      width[c] = std::max(width[c], Width(rows[r][c]));
      if (r > 0 && !rows[r][c].empty() && !IsNumber(rows[r][c])) numeric[c] = false;
    }
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line = " ";
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string pad(width[c] - Width(row[c]), ' ');
      line += " " + (numeric[c] ? pad + row[c] : row[c] + pad) + " ";
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

}  // namespace unfurl::cli
