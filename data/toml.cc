// Loading, overrides, and the walk from table to table.
#include "data/toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <sstream>

#include "data/atomic_file.h"
#include "data/toml_node.h"

namespace unfurl::data {

namespace {

toml::table ParseDocument(const std::string& text, const std::string& name) {
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    throw Error(
        fmt::format("not valid TOML: {}", error.description()),
        fmt::format("{}:{}:{}", name, error.source().begin.line, error.source().begin.column),
        "correct the line");
  }
}

// The right-hand side of --set as a TOML value; a bare word is taken as a string.
toml::table ParseOverride(const std::string& value, const std::string& dotted) {
  for (const std::string& text : {"v = " + value, "v = \"" + value + "\""}) {
    try {
      return toml::parse(text);
    } catch (const toml::parse_error&) {
    }
  }
  throw Error(fmt::format("'{}' is not a value", value), "--set " + dotted,
              "give a number, true, false, a word or an [array]");
}

const toml::node* ApplyOverride(toml::table& root, const std::string& assignment,
                                std::string* dotted) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw Error("has no '='", "--set " + assignment, "write --set key=value");
  }
  *dotted = std::string(Trim(assignment.substr(0, equals)));
  const std::vector<std::string> keys = Split(*dotted, '.');
  toml::table* table = &root;
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    toml::node* next = table->get(keys[i]);
    if (next == nullptr) {
      table->insert(keys[i], toml::table{});
      next = table->get(keys[i]);
    }
    table = next->as_table();
    if (table == nullptr) {
      throw Error(fmt::format("'{}' is not a table", keys[i]), "--set " + *dotted,
                  "name a key of the file, table by table, with dots");
    }
  }
  toml::table parsed = ParseOverride(assignment.substr(equals + 1), *dotted);
  parsed.get("v")->visit([&](const auto& node) { table->insert_or_assign(keys.back(), node); });
  return table->get(keys.back());
}

}  // namespace

TomlTable ParseToml(const std::string& text, const std::string& name) {
  auto node = std::make_shared<TomlTable::Node>();
  node->document = std::make_shared<toml::table>(ParseDocument(text, name));
  node->table = node->document.get();
  node->file = name;
  node->overridden = std::make_shared<std::map<const toml::node*, std::string>>();
  return TomlTable(std::move(node));
}

TomlTable LoadToml(const std::string& path, const std::vector<std::string>& overrides) {
  TomlTable table = ParseToml(ReadTextFile(path), path);
  for (const std::string& assignment : overrides) {
    std::string dotted;
    const toml::node* node = ApplyOverride(*table.node_->table, assignment, &dotted);
    (*table.node_->overridden)[node] = dotted;
  }
  return table;
}

std::string TomlTable::Where(std::string_view key) const { return node_->WhereOf(key); }
const std::string& TomlTable::path() const { return node_->path; }

void TomlTable::Fail(std::string_view key, const std::string& what,
                     const std::string& remedy) const {
  throw Error(what, Where(key), remedy);
}

std::optional<TomlTable> TomlTable::TableOrNone(std::string_view key) const {
  const toml::node* node = node_->Get(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_table()) {
    Fail(key, fmt::format("holds {}, not a table", TypeName(*node)),
         fmt::format("write it as [{}]", node_->Dotted(key)));
  }
  return TomlTable(node_->Child(std::string(key), node_->Dotted(key),
                                const_cast<toml::table*>(node->as_table())));
}

TomlTable TomlTable::Table(std::string_view key) const {
  std::optional<TomlTable> table = TableOrNone(key);
  if (!table) throw Error(fmt::format("[{}] is missing", node_->Dotted(key)), Where(), "add it");
  return *table;
}

std::vector<std::pair<std::string, TomlTable>> TomlTable::NamedTables(std::string_view key) const {
  std::vector<std::pair<std::string, TomlTable>> named;
  const std::optional<TomlTable> group = TableOrNone(key);
  if (!group) return named;
  std::vector<std::pair<std::size_t, std::string>> order;  // toml++ sorts keys; restore the file's
  for (const auto& [name, value] : *group->node_->table) {
    const auto begin = value.source().begin;
    const std::size_t line = begin.line > 0 ? begin.line : std::numeric_limits<unsigned>::max();
    order.emplace_back(line, std::string(name.str()));
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [line, name] : order) named.emplace_back(name, group->Table(name));
  return named;
}

std::vector<TomlTable> TomlTable::TableArray(std::string_view key) const {
  std::vector<TomlTable> tables;
  const toml::node* node = node_->Get(key);
  if (node == nullptr) return tables;
  const toml::array* array = node->as_array();
  if (array == nullptr || (!array->empty() && !array->is_homogeneous(toml::node_type::table))) {
    Fail(key, fmt::format("holds {}, not a list of tables", TypeName(*node)),
         fmt::format("write each as [[{}]]", node_->Dotted(key)));
  }
  for (std::size_t i = 0; i < array->size(); ++i) {
    const std::string slot = fmt::format("{}[{}]", key, i);
    tables.push_back(TomlTable(node_->Child(slot, node_->Dotted(slot),
                                            const_cast<toml::table*>(array->get(i)->as_table()))));
  }
  return tables;
}

namespace {

void ListKeys(const toml::table& table, const std::string& prefix,
              std::vector<std::pair<std::string, std::string>>* out) {
  for (const auto& [key, node] : table) {
    const std::string dotted = prefix + std::string(key.str());
    if (const toml::table* child = node.as_table()) {
      ListKeys(*child, dotted + ".", out);
      continue;
    }
    std::ostringstream text;
    node.visit([&](const auto& value) { text << value; });
    out->emplace_back(dotted, text.str());
  }
}

}  // namespace

std::vector<std::pair<std::string, std::string>> TomlTable::Outline() const {
  std::vector<std::pair<std::string, std::string>> keys;
  ListKeys(*node_->table, node_->path.empty() ? "" : node_->path + ".", &keys);
  return keys;
}

void TomlTable::RefuseUnknownKeys() const { node_->Refuse(); }

}  // namespace unfurl::data
