#pragma once

#include <fmt/format.h>
#include <toml++/toml.h>

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "data/toml.h"

namespace unfurl::data {

// One table of the document, shared by all TomlTable that look at it: so keys read through any of
// them are remembered in one place. Nodes keep the whole document alive.
struct TomlTable::Node {
  // What all tables of a document share.
  struct Document {
    std::vector<std::string> files;
    std::map<std::string, int> order;                     // of "body.hub" where files were merged
    std::map<const toml::node*, std::string> overridden;  // node -> dotted key
  };
  std::shared_ptr<toml::table> owner;  // keeps `table` alive
  std::shared_ptr<Document> document;
  toml::table* table = nullptr;
  std::string file;
  std::string path;
  int line = 0;
  std::set<std::string> asked;                          // keys a reader knows
  std::map<std::string, std::shared_ptr<Node>> tables;  // by key, or "key[i]"

  // toml++ sorts keys: the names of a group's tables in the file's order, or that of first mention
  // in merged files; those that overrides made come last.
  std::vector<std::string> NamesInOrder(std::string_view group, const toml::table& named) const;

  std::string Dotted(std::string_view key) const {
    if (key.empty()) return path;
    return path.empty() ? std::string(key) : path + "." + std::string(key);
  }

  const toml::node* Get(std::string_view key) {
    asked.insert(std::string(key));
    return table->get(key);
  }

  // Merged documents hold nodes of several files.
  static std::string FileOf(const toml::node& node, const std::string& fallback) {
    const auto& path = node.source().path;
    return path && !path->empty() ? *path : fallback;
  }

  std::string WhereOf(std::string_view key) const {
    const toml::node* node = key.empty() ? nullptr : table->get(key);
    if (node != nullptr) {
      const auto set = document->overridden.find(node);
      if (set != document->overridden.end()) return "--set " + set->second;
    }
    const int at = node != nullptr && node->source().begin.line > 0
                       ? static_cast<int>(node->source().begin.line)
                       : line;
    const std::string dotted = Dotted(key);
    std::string where = node != nullptr ? FileOf(*node, file) : file;
    if (at > 0) where += fmt::format(":{}", at);
    if (!dotted.empty()) where += ":" + dotted;
    return where;
  }

  std::shared_ptr<Node> Child(const std::string& slot, const std::string& child_path,
                              toml::table* child) {
    auto& node = tables[slot];
    if (!node) {
      node = std::make_shared<Node>();
      node->owner = owner;
      node->document = document;
      node->table = child;
      node->file = FileOf(*child, file);
      node->path = child_path;
      node->line = static_cast<int>(child->source().begin.line);
    }
    return node;
  }

  // Throws Error: a reader wants a key that is not there.
  [[noreturn]] void FailMissing(std::string_view key) const {
    // A table without a place in a file was made by --set: most likely its name is misspelt.
    const std::size_t dot = path.rfind('.');
    if (line == 0 && dot != std::string::npos) {
      const std::string group = path.substr(0, dot), name = path.substr(dot + 1);
      const toml::node_view<toml::node> others = owner->at_path(group);
      std::vector<std::string> written;
      if (const toml::table* named = others.as_table()) {
        for (const auto& [other, node] : *named) {
          if (node.source().begin.line > 0) written.emplace_back(other.str());
        }
      }
      const std::string nearest = NearestName(name, written);
      if (!written.empty()) {
        std::string assigned = path;
        for (const auto& [node, dotted] : document->overridden) {
          if (dotted.starts_with(path + ".")) assigned = dotted;
        }
        throw Error(
            fmt::format("the file has no '{}', and '{}' is missing for a new one", name, key),
            "--set " + assigned,
            nearest.empty() ? fmt::format("{} has {}", group, JoinWords(written))
                            : "did you mean '" + group + "." + nearest + "'?");
      }
    }
    throw Error(fmt::format("'{}' is missing", key), WhereOf({}), "add the key");
  }

  void ListAsked(std::vector<std::string>* keys) const {
    for (const std::string& key : asked) keys->push_back(Dotted(key));
    for (const auto& [slot, child] : tables) child->ListAsked(keys);
  }

  void Refuse() const {
    for (const auto& [key, value] : *table) {
      const std::string name(key.str());
      if (!asked.contains(name)) {
        const std::vector<std::string> known(asked.begin(), asked.end());
        const std::string nearest = NearestName(name, known);
        throw Error("unknown key", WhereOf(name),
                    !nearest.empty() ? "did you mean '" + nearest + "'?"
                    : known.empty()  ? "remove it"
                                     : "remove it; known here: " + JoinWords(known));
      }
    }
    for (const auto& [slot, child] : tables) child->Refuse();
  }
};

inline const char* TypeName(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "true or false";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::table:
      return "a table";
    default:
      return "a date or time";
  }
}

}  // namespace unfurl::data
