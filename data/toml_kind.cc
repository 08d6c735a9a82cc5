#include "data/toml_kind.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <vector>

#include "base/text.h"

namespace unfurl::data {

namespace {

std::string FirstOf(const std::string& dotted) {
  return dotted.substr(0, dotted.find_first_of(".["));
}

}  // namespace

std::string KindOfDocument(const TomlTable& root) {
  if (root.Has("joint") || root.Has("beam") || root.Has("body")) return "scene";
  if (root.Has("parameter")) return "study";
  if (root.Has("variable") && root.Has("job")) return "campaign";
  if (root.Has("recording")) return "raw lines";
  if (root.Has("camera")) return "lab";
  return "TOML";
}

std::string KindWords(const std::string& kind) {
  if (kind == "campaign") return "a campaign's plan";
  if (kind == "raw lines") return "a description of raw lines";
  if (kind == "lab") return "a laboratory";
  return "a " + kind;
}

void RequireKind(const TomlTable& root, const std::string& wanted) {
  const std::string kind = KindOfDocument(root);
  if (kind == wanted || kind == "TOML") return;
  throw Error(fmt::format("is {}, where {} is needed", KindWords(kind), KindWords(wanted)),
              root.Where(), "give the other file (`unfurl info` shows what a file is)");
}

Error WithMisspeltTable(const Error& error, const TomlTable& root) {
  if (error.problem() == "unknown key") return error;  // says itself what was likely meant
  std::set<std::string> asked;
  for (const std::string& key : root.Asked()) asked.insert(FirstOf(key));
  const std::vector<std::string> known(asked.begin(), asked.end());
  for (const auto& [key, value] : root.Outline()) {
    const std::string table = FirstOf(key);
    if (asked.contains(table)) continue;
    const std::string nearest = NearestName(table, known);
    if (nearest.empty()) continue;
    return {error.problem(), error.where(),
            fmt::format("did you mean [{}] by [{}]?", nearest, table), error.kind()};
  }
  return error;
}

}  // namespace unfurl::data
