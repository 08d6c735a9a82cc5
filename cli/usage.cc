#include "cli/usage.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cctype>
#include <cstdio>
#include <map>
#include <numbers>
#include <regex>

#include "base/text.h"

namespace unfurl::cli {

namespace {

constexpr char kWhere[] = "command line";

Error UnknownVerb(const std::vector<Verb>& verbs, const std::string& name) {
  std::vector<std::string> known;
  if (name != "help") known.emplace_back("help");
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

// The long option that was most likely meant, as it is typed; its dashes make no likeness.
std::string NearestOption(const CLI::App& app, const std::string& unknown) {
  if (!unknown.starts_with("--")) return {};  // a letter is like any other
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  }
  const std::string nearest = NearestName(unknown.substr(2), names);
  return nearest.empty() ? nearest : "--" + nearest;
}

// The first option that the verb does not have; empty: it has all. Such an option leaves its value
// for the next positional argument, and what CLI11 then says is about that.
std::string UnknownOption(const Verb& verb, int argc, char** argv) {
  for (int i = 2; i < argc; ++i) {
    std::string name = argv[i];
    name = name.substr(0, name.find('='));
    if (name == "--") break;
    const bool letter = name.size() == 2 && name[0] == '-' && std::isalpha(name[1]) != 0;
    const bool option = letter || name.starts_with("--");
    if (option && verb.app->get_option_no_throw(name) == nullptr) return name;
  }
  return {};
}

// "How many modes" after a semicolon: "how many modes"; "HDF5 .." stays.
std::string Continued(std::string text) {
  const bool word = text.size() > 1 && ((text[1] >= 'a' && text[1] <= 'z') || text[1] == ' ');
  if (word && text[0] >= 'A' && text[0] <= 'Z') {
    text[0] = static_cast<char>(text[0] - 'A' + 'a');
  }
  return text;
}

// Of units that people write behind numbers, what one is in the unit that options take.
double ScaleOf(const std::string& unit) {
  static const std::map<std::string, double> kScales = {
      {"km", 1e3},
      {"cm", 1e-2},
      {"mm", 1e-3},
      {"um", 1e-6},
      {"nm", 1e-9},
      {"min", 60.0},
      {"h", 3600.0},
      {"ms", 1e-3},
      {"us", 1e-6},
      {"ns", 1e-9},
      {"kHz", 1e3},
      {"MHz", 1e6},
      {"mrad", 1e-3},
      {"urad", 1e-6},
      {"deg", std::numbers::pi / 180.0},
      {"arcsec", std::numbers::pi / 648000.0},
      {"%", 1e-2},
      {"ppm", 1e-6},
  };
  const auto at = kScales.find(unit);
  return at == kScales.end() ? 1.0 : at->second;
}

// "5s", "500ms", "4-8": a number with something behind it.
std::string RemedyFor(const std::string& value, const CLI::Option& option) {
  const std::size_t digits = value.find_first_not_of("+-.0123456789eE");
  if (digits != std::string::npos && digits > 0) {
    const std::string unit(Trim(value.substr(digits)));
    const double scale = ScaleOf(unit);
    double number = 0.0;
    // Without its unit 500ms would be 500 s.
    if (scale != 1.0 && ParseDouble(value.substr(0, digits), &number)) {
      return fmt::format("write {:.9g}: {}", scale * number, Continued(option.get_description()));
    }
    return fmt::format("leave '{}' out: {}", unit, Continued(option.get_description()));
  }
  const std::size_t dash = value.find('-', 1);
  if (dash != std::string::npos && option.get_expected_max() > 1) {
    return fmt::format("write each, with commas: {},{}", value.substr(0, dash),
                       value.substr(dash + 1));
  }
  return "it is: " + Continued(option.get_description());
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

// A value outside of an option's range. CLI11 says "NAME: Value VALUE not in range LOW to HIGH",
// with 309 digits where there is no bound, and the same of a value that is no number.
Error OutOfRange(const Verb& verb, const CLI::Error& error) {
  const std::string text = error.what();
  const std::string value_mark = ": Value ", range_mark = " not in range ";
  const std::size_t at = text.find(value_mark), range = text.find(range_mark);
  if (at == std::string::npos || range == std::string::npos) return {text, kWhere, HelpOf(verb)};
  const std::string name = text.substr(0, at);
  const std::string value = text.substr(at + value_mark.size(), range - at - value_mark.size());
  const CLI::Option* option = verb.app->get_option_no_throw(name);
  if (option == nullptr) return {text, kWhere, HelpOf(verb)};
  double number = 0.0;
  if (!ParseDouble(value, &number)) {
    return {fmt::format("{} takes a number, not '{}'", name, value), kWhere,
            RemedyFor(value, *option)};
  }
  const std::string type = option->get_type_name();
  const std::string bounds = text.substr(range + range_mark.size());
  const char* wanted = type.find("POSITIVE") != std::string::npos      ? "a number above 0"
                       : type.find("NONNEGATIVE") != std::string::npos ? "0 or more"
                                                                       : nullptr;
  return {fmt::format("{} cannot be {}", name, value), kWhere,
          fmt::format("give {}: {}", wanted != nullptr ? wanted : bounds,
                      Continued(option->get_description()))};
}

// More words than the verb takes. CLI11 says them backwards.
Error TooMany(const Verb& verb, const std::string& action) {
  std::vector<std::string> words;
  for (const std::string& word : verb.app->remaining()) words.push_back("'" + word + "'");
  return {fmt::format("{} {} not expected", JoinWords(words), words.size() == 1 ? "is" : "are"),
          kWhere,
          (action.empty()
               ? ""
               : fmt::format("did you mean `unfurl {} {}`? ", verb.app->get_name(), action)) +
              HelpOf(verb)};
}

// What is missing, with what it is. CLI11 says "NAME is required", and "NAME: 1 required TYPE
// missing" of an option without its value.
Error Missing(const Verb& verb, const CLI::Error& error) {
  const std::string text = error.what();
  const bool value = dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr;
  const std::string name = text.substr(0, text.find(value ? ":" : " "));
  const CLI::Option* option = verb.app->get_option_no_throw(name);
  if (option == nullptr) return {text, kWhere, HelpOf(verb)};
  return {fmt::format("{} {}: {}", name, value ? "needs a value" : "is required",
                      Continued(option->get_description())),
          kWhere, HelpOf(verb)};
}

// Of words that are expected before a file, as in `campaign rum plan.toml`: the one that was likely
// meant.
std::string NearestAction(const Verb& verb, int argc, char** argv) {
  for (const CLI::Option* option : verb.app->get_options()) {
    const std::string type = option->get_type_name();
    if (!option->get_positional() || type.find('|') == std::string::npos) continue;
    const std::vector<std::string> known = Split(type, '|');
    for (int i = 2; i < argc; ++i) {
      std::string nearest = NearestName(argv[i], known);
      if (!nearest.empty() && nearest != argv[i]) return nearest;
    }
  }
  return {};
}

// "-duration": an option of one dash, which CLI11 takes for letters of options.
std::string OneDash(const Verb& verb, int argc, char** argv) {
  for (int i = 2; i < argc; ++i) {
    std::string name = std::string(argv[i]).substr(0, std::string(argv[i]).find('='));
    if (name == "--") break;
    if (name.size() > 2 && name[0] == '-' && name[1] != '-' &&
        verb.app->get_option_no_throw("-" + name) != nullptr) {
      return name;
    }
  }
  return {};
}

}  // namespace

void RefuseNegative(const Verb& verb) {
  for (const CLI::Option* option : verb.app->get_options()) {
    if (option->get_type_name().find("UINT") == std::string::npos) continue;
    for (const std::string& value : option->results()) {
      if (!value.starts_with('-')) continue;
      throw Error(
          fmt::format("{} takes a whole number from 0, not '{}'", option->get_name(), value),
          kWhere, HelpOf(verb));
    }
  }
}

std::string ReadableType(std::string type) {
  static const std::regex kRange(":(INT|UINT|FLOAT) in \\[(\\S+) - (\\S+)\\]");
  static const std::regex kAbove(":POSITIVE"), kFrom(":NONNEGATIVE"), kOneOf(":\\{([^}]*)\\}");
  type = std::regex_replace(type, kRange, " from $2 to $3");
  type = std::regex_replace(type, kAbove, " above 0");
  type = std::regex_replace(type, kFrom, " from 0");
  type = std::regex_replace(type, kOneOf, " of $1");
  static const std::regex kWhole("\\bU?INT\\b"), kNumber("\\bFLOAT\\b");
  type = std::regex_replace(type, kWhole, "INTEGER");
  return std::regex_replace(type, kNumber, "NUMBER");
}

std::string ReadableFormatter::make_option_opts(const CLI::Option* option) const {
  return ReadableType(CLI::Formatter::make_option_opts(option));
}

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
    const std::string nearest = NearestOption(*verb->app, unknown);
    return {fmt::format("`unfurl {}` has no option {}", first, unknown), kWhere,
            (nearest.empty() ? "" : "did you mean " + nearest + "? ") + HelpOf(*verb)};
  }
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) {
    return WrongValue(*verb, error);
  }
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) {
    return OutOfRange(*verb, error);
  }
  const std::string one_dash = OneDash(*verb, argc, argv);
  if (!one_dash.empty()) {
    return {fmt::format("`unfurl {}` has no option {}", first, one_dash), kWhere,
            "did you mean -" + one_dash + "? " + HelpOf(*verb)};
  }
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    return TooMany(*verb, NearestAction(*verb, argc, argv));
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr ||
      dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    return Missing(*verb, error);
  }
  return {error.what(), kWhere, HelpOf(*verb)};
}

}  // namespace unfurl::cli
