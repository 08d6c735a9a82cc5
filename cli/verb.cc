#include "cli/verb.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace unfurl::cli {

Verb DeclareVerb(CLI::App& program, Common& common, const std::string& name,
                 const std::string& summary, const std::string& example) {
  CLI::App* verb = program.add_subcommand(name, summary);
  verb->add_flag("--json", common.json, "Print a machine-readable summary on stdout");
  verb->add_flag("--quiet", common.quiet, "Print nothing but errors");
  verb->footer("Example:\n  " + example);
  return {verb, std::make_shared<VerbFiles>(verb), {}};
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

int NotUsable(const std::string& where, const std::string& why) {
  std::fputs(("unfurl: " + where + ": " + why + "\n").c_str(), stderr);
  return kExitNotUsable;
}

void Finish(const Common& common, const nlohmann::ordered_json& summary, const std::string& text) {
  if (common.json) {
    std::fputs((summary.dump(2) + "\n").c_str(), stdout);
  } else if (!common.quiet) {
    std::fputs(text.c_str(), stdout);
    if (!text.empty() && text.back() != '\n') std::fputc('\n', stdout);
  }
}

}  // namespace unfurl::cli
