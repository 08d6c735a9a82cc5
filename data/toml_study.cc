#include "data/toml_study.h"

#include <toml++/toml.h>

#include "base/error.h"
#include "data/toml_override.h"
#include "data/toml_writer.h"

namespace unfurl::data {

namespace {

// Of a trial: what belongs to its own record.
constexpr const char* kOfOneRecord[] = {"channel", "event", "window", "offset", "drift"};

}  // namespace

std::string StudyWithTrial(const std::string& path, const std::vector<std::string>& overrides,
                           std::size_t like, const std::string& name, const std::string& tracks,
                           const std::vector<std::string>& set) {
  toml::table root = toml::parse(TextWithOverrides(path, overrides), path);
  toml::array trials;
  if (const toml::array* several = root["trial"].as_array()) {
    trials = *several;
  } else if (const toml::table* one = root["trial"].as_table()) {
    trials.push_back(*one);
  }
  if (like >= trials.size() || !trials[like].is_table()) {
    throw Error("there is no such trial", path + ":trial", "number the study's trials from 0");
  }
  toml::table next = *trials[like].as_table();
  for (const char* key : kOfOneRecord) next.erase(key);
  next.insert_or_assign("name", name);
  next.insert_or_assign("tracks", tracks);
  toml::array all;
  if (const toml::array* own = next["set"].as_array()) all = *own;
  for (const std::string& one : set) all.push_back(one);
  if (!all.empty()) next.insert_or_assign("set", all);
  trials.push_back(next);
  root.insert_or_assign("trial", trials);
  return TomlText(root);
}

}  // namespace unfurl::data
