// Loading, overrides, and the walk from table to table.
#include "data/toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <sstream>

#include "data/atomic_file.h"
#include "data/toml_include.h"
#include "data/toml_node.h"

namespace unfurl::data {

namespace {

constexpr std::size_t kMostParts = 64;  // of a dotted key

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
  if (keys.size() > kMostParts) {
    throw Error(fmt::format("a key of {} parts", keys.size()), "--set", "name tables less deep");
  }
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
  node->owner = std::make_shared<toml::table>(ParseTomlDocument(text, name));
  node->document = std::make_shared<TomlTable::Node::Document>();
  node->document->files.push_back(name);
  node->table = node->owner.get();
  node->file = name;
  return TomlTable(std::move(node));
}

TomlTable LoadToml(const std::string& path, const std::vector<std::string>& overrides) {
  TomlTable table = ParseToml(ReadTextFile(path), path);
  TomlTable::Node& root = *table.node_;
  TomlTable::Node::Document& document = *root.document;
  const auto override_with = [&](const std::string& assignment) {
    std::string dotted;
    const toml::node* node = ApplyOverride(*root.table, assignment, &dotted);
    document.overridden[node] = dotted;
  };
  // An include from the command line must be known before the rest can be applied.
  const auto is_include = [](const std::string& assignment) {
    return Trim(assignment.substr(0, assignment.find('='))) == kIncludeKey;
  };
  for (const std::string& assignment : overrides) {
    if (is_include(assignment)) override_with(assignment);
  }
  if (root.Get(kIncludeKey) != nullptr) {
    MergeIncludes(root.table, path, &document.files, &document.order);
  }
  for (const std::string& assignment : overrides) {
    if (!is_include(assignment)) override_with(assignment);
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

namespace {

// Names become names of datasets, columns and files, and are shown on terminals.
void RefuseName(const TomlTable& group, const std::string& name) {
  const bool bad = name.empty() || name == "." || name.find('/') != std::string::npos ||
                   std::any_of(name.begin(), name.end(), [](char c) {
                     const auto byte = static_cast<unsigned char>(c);
                     return byte < 0x20 || byte == 0x7f;
                   });
  if (!bad) return;
  group.Fail(name,
             name.empty() ? "a name of no letters" : "a name with a slash or a control character",
             "use letters, digits, blanks, - and _");
}

}  // namespace

std::vector<std::pair<std::string, TomlTable>> TomlTable::NamedTables(std::string_view key) const {
  std::vector<std::pair<std::string, TomlTable>> named;
  const std::optional<TomlTable> group = TableOrNone(key);
  if (!group) return named;
  // toml++ sorts keys; restore the file's order, or that of first mention in merged files.
  struct Place {
    int rank;
    unsigned line, column;
    auto operator<=>(const Place&) const = default;
  };
  constexpr unsigned kLast = std::numeric_limits<unsigned>::max();  // from --set
  std::vector<std::pair<Place, std::string>> order;
  for (const auto& [name, value] : *group->node_->table) {
    RefuseName(*group, std::string(name.str()));
    const auto begin = value.source().begin;
    const auto known = node_->document->order.find(fmt::format("{}.{}", key, name.str()));
    Place place{0, begin.line > 0 ? begin.line : kLast, begin.column};
    if (known != node_->document->order.end())
      place = {known->second, 0, 0};
    else if (begin.line == 0)
      place.rank = std::numeric_limits<int>::max();
    order.emplace_back(place, std::string(name.str()));
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [place, name] : order) named.emplace_back(name, group->Table(name));
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

TomlTable TomlTable::Items(std::string_view key, int size) const {
  const toml::node* node = node_->Get(key);
  if (node == nullptr) throw Error(fmt::format("'{}' is missing", key), Where(), "add the key");
  const toml::array* array = node->as_array();
  if (array == nullptr || array->size() != static_cast<std::size_t>(size)) {
    Fail(key,
         array == nullptr ? fmt::format("holds {}, not an array", TypeName(*node))
                          : fmt::format("holds {} values", array->size()),
         fmt::format("give [{} values]", size));
  }
  auto& child = node_->tables[std::string(key) + "[]"];
  if (!child) {
    child = std::make_shared<Node>();
    child->owner = std::make_shared<toml::table>();
    child->document = node_->document;
    child->table = child->owner.get();
    child->file = Node::FileOf(*node, node_->file);
    child->path = node_->Dotted(key);
    child->line = static_cast<int>(node->source().begin.line);
    const auto set = node_->document->overridden.find(node);
    for (std::size_t i = 0; i < array->size(); ++i) {
      const std::string slot = fmt::format("{}", i);
      array->get(i)->visit([&](const auto& item) { child->table->insert(slot, item); });
      if (set != node_->document->overridden.end()) {
        const std::string dotted = set->second;
        node_->document->overridden[child->table->get(slot)] = dotted;
      }
    }
  }
  return TomlTable(child);
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

std::vector<std::string> TomlTable::Asked() const {
  std::vector<std::string> keys;
  node_->ListAsked(&keys);
  return keys;
}

std::vector<std::string> TomlTable::Files() const { return node_->document->files; }

void TomlTable::RefuseUnknownKeys() const { node_->Refuse(); }

}  // namespace unfurl::data
