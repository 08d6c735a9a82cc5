#include "helpers.h"

#include <fmt/format.h>

#include <algorithm>
#include <regex>
#include <string_view>
#include <utility>
#include <vector>

namespace unfurl::structure {
namespace {

struct Helper {
  std::string path, name;
  std::vector<std::string> parameters;
};

// Apart at commas that are in no bracket.
std::vector<std::string> ParametersOf(const std::string& text) {
  std::vector<std::string> out;
  std::string one;
  int depth = 0;
  const auto end = [&] {
    const std::size_t from = one.find_first_not_of(" \n");
    if (from != std::string::npos) out.push_back(one.substr(from));
    one.clear();
  };
  for (const char c : text) {
    depth += (c == '<' || c == '(') - (c == '>' || c == ')');
    if (c == ',' && depth == 0) {
      end();
    } else {
      one += c;
    }
  }
  end();
  return out;
}

bool IsStandard(const std::string& parameter) {
  static const std::regex kStandard(
      R"((const )?(std::|fs::|double|int|bool|float|char|long|unsigned)[^A-Z]*)");
  return std::regex_match(parameter, kStandard);
}

// A function begins at the margin, in an unnamed namespace that does, too.
std::vector<Helper> HelpersOf(const std::string& path, const std::string& text) {
  static const std::regex kFunction(
      R"(\n[A-Za-z_][\w:<>&*, ]*[ &*](\w+)\(([^;{}]*)\)( const)? \{)");
  constexpr std::string_view kBegin = "\nnamespace {\n", kEnd = "\n}  // namespace\n";
  std::vector<Helper> out;
  for (std::size_t at = text.find(kBegin); at != std::string::npos;
       at = text.find(kBegin, at + 1)) {
    const std::string body = text.substr(at, text.find(kEnd, at) - at);
    for (std::sregex_iterator i(body.begin(), body.end(), kFunction), none; i != none; ++i) {
      out.push_back({path, (*i)[1], ParametersOf((*i)[2])});
    }
  }
  return out;
}

}  // namespace

Findings CheckHelpers(const std::map<std::string, std::string>& files) {
  std::map<std::pair<std::string, std::size_t>, std::string> first;  // path by name and parameters
  Findings findings;
  for (const auto& [path, text] : files) {
    for (const Helper& helper : HelpersOf(path, text)) {
      if (!std::all_of(helper.parameters.begin(), helper.parameters.end(), IsStandard)) continue;
      const auto [it, is_new] = first.insert({{helper.name, helper.parameters.size()}, path});
      if (is_new || it->second == path) continue;
      findings.push_back(
          fmt::format("{}: {} has as many parameters as that of {}; give it a name of "
                      "its own",
                      path, helper.name, it->second));
    }
  }
  return findings;
}

}  // namespace unfurl::structure
