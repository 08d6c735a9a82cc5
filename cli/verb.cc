#include "cli/verb.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/length.h"
#include "base/signals.h"

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
  Complain(where + ": " + why);
  return kExitNotUsable;
}

int FitNotUsable(const std::string& study, const std::string& message) {
  return NotUsable(study, "the study's fit is not usable, see `unfurl fit`: " + message);
}

std::string JsonText(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void Finish(const Common& common, const nlohmann::ordered_json& summary, const std::string& text) {
  if (common.json) {
    std::fputs(JsonText(summary).c_str(), stdout);
  } else if (!common.quiet) {
    const std::string shown = Printable(text);
    std::fputs(shown.c_str(), stdout);
    if (!shown.empty() && shown.back() != '\n') std::fputc('\n', stdout);
  }
}

void AddNeedOption(CLI::App* app, std::string* text) {
  app->add_option(
         "--need", *text,
         "Accuracy needed: error of a reconstructed point, with its unit, as 0.5mm; default: a "
         "2000th of the volume's longest side")
      ->type_name("LENGTH");
}

double NeedOption(const std::string& text) {
  return text.empty() ? 0.0 : LengthOption(text, "--need");
}

double LengthOption(const std::string& text, const std::string& option) {
  double length = 0.0;
  // 0.5, meant as millimetres and taken for metres, would call every rig good.
  const bool has_unit = text.find_last_not_of("+-.0123456789eE ") != std::string::npos;
  if (!has_unit || !ParseLength(text, &length) || !(length > 0.0)) {
    throw Error(fmt::format("'{}' is no length", text), option,
                "give a number above 0 with its unit, as 0.5mm or 20um");
  }
  return length;
}

Error AtOption(const Error& error, const std::map<std::string, std::string>& flags) {
  const auto flag = flags.find(error.where());
  return flag == flags.end() ? error : Error(error.problem(), flag->second, error.remedy());
}

void AddAllowPrograms(CLI::App* app, bool* allowed) {
  app->add_flag(
      "--allow-programs", *allowed,
      "Run the programs that the study (model.command) or plan (job.step) names: only for "
      "one that you trust. UNFURL_ALLOW_PROGRAMS=1 in the environment says the same");
}

bool ProgramsAllowed(bool option) {
  const char* allowed = std::getenv("UNFURL_ALLOW_PROGRAMS");
  return option || (allowed != nullptr && std::string(allowed) == "1");
}

}  // namespace unfurl::cli
