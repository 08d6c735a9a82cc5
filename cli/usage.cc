#include "cli/usage.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "base/text.h"

namespace unfurl::cli {

namespace {

constexpr char kWhere[] = "command line";

Error UnknownVerb(const std::vector<Verb>& verbs, const std::string& name) {
  std::vector<std::string> known = {"help"};
  for (const Verb& verb : verbs) known.push_back(verb.app->get_name());
  const std::string nearest = NearestName(name, known);
  return {fmt::format("there is no verb '{}'", name), kWhere,
          nearest.empty() ? "see `unfurl --help`"
                          : "did you mean `unfurl " + nearest + "`? see `unfurl --help`"};
}

const Verb* FindVerb(const std::vector<Verb>& verbs, const std::string& name) {
  for (const Verb& verb : verbs) {
    if (verb.app->get_name() == name) return &verb;
  }
  return nullptr;
}

std::string HelpOf(const Verb& verb) { return "see `unfurl " + verb.app->get_name() + " --help`"; }

// Long and short names as they are typed.
std::vector<std::string> NamesOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

// The first option that the verb does not have; empty: it has all. Such an option leaves its value
// for the next positional argument, and what CLI11 then says is about that.
std::string UnknownOption(const Verb& verb, int argc, char** argv) {
  for (int i = 2; i < argc; ++i) {
    std::string name = argv[i];
    name = name.substr(0, name.find('='));
    if (name == "--") break;
    if (name.starts_with("--") && verb.app->get_option_no_throw(name) == nullptr) return name;
  }
  return {};
}

// "5s", "4-8": a number with something behind it.
std::string RemedyFor(const std::string& value, const CLI::Option& option) {
  const std::size_t digits = value.find_first_not_of("+-.0123456789eE");
  if (digits != std::string::npos && digits > 0) {
    return fmt::format("leave '{}' out: {}", value.substr(digits), option.get_description());
  }
  const std::size_t dash = value.find('-', 1);
  if (dash != std::string::npos && option.get_expected_max() > 1) {
    return fmt::format("write each, with commas: {},{}", value.substr(0, dash),
                       value.substr(dash + 1));
  }
  return option.get_description();
}

// Values that an option cannot take. CLI11 says "Could not convert: NAME = VALUE".
Error WrongValue(const Verb& verb, const CLI::Error& error) {
  const std::string text = error.what();
  const std::size_t colon = text.find(": "), equals = text.find(" = ");
  if (colon == std::string::npos || equals == std::string::npos) {
    return {text, kWhere, HelpOf(verb)};
  }
  const std::string name = text.substr(colon + 2, equals - colon - 2);
  const CLI::Option* option = verb.app->get_option_no_throw(name);
  if (option == nullptr) return {text, kWhere, HelpOf(verb)};
  std::string value = text.substr(equals + 3);
  // Of a list, the one that is no number.
  for (const std::string& one : Split(value, ',')) {
    double number = 0.0;
    if (!ParseDouble(Trim(one), &number)) value = std::string(Trim(one));
  }
  const std::string type = option->get_type_name();
  const char* wanted = type.find("INT") != std::string::npos     ? "a whole number"
                       : type.find("FLOAT") != std::string::npos ? "a number"
                                                                 : "another kind of value";
  return {fmt::format("{} takes {}, not '{}'", name, wanted, value), kWhere,
          RemedyFor(value, *option)};
}

}  // namespace

void PrintHelp(const CLI::App& program, const std::vector<Verb>& verbs, int argc, char** argv) {
  if (argc < 3) {
    std::fputs(program.help("unfurl").c_str(), stdout);
    return;
  }
  const Verb* verb = FindVerb(verbs, argv[2]);
  if (verb == nullptr) throw UnknownVerb(verbs, argv[2]);
  std::fputs(verb->app->help("unfurl").c_str(), stdout);
}

Error UsageError(const std::vector<Verb>& verbs, int argc, char** argv, const CLI::Error& error) {
  const std::string first = argv[1];
  const Verb* verb = FindVerb(verbs, first);
  if (verb == nullptr) {
    if (!first.starts_with("-")) return UnknownVerb(verbs, first);
    return {"there is no option " + first + " before the verb", kWhere, "see `unfurl --help`"};
  }
  const std::string unknown = UnknownOption(*verb, argc, argv);
  if (!unknown.empty()) {
    const std::string nearest = NearestName(unknown, NamesOf(*verb->app));
    return {fmt::format("`unfurl {}` has no option {}", first, unknown), kWhere,
            (nearest.empty() ? "" : "did you mean " + nearest + "? ") + HelpOf(*verb)};
  }
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) {
    return WrongValue(*verb, error);
  }
  return {error.what(), kWhere, HelpOf(*verb)};
}

}  // namespace unfurl::cli
