// Loading, overrides, and the walk from table to table.
#include "data/toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <sstream>

#include "base/signals.h"
#include "data/atomic_file.h"
#include "data/toml_include.h"
#include "data/toml_node.h"
#include "data/toml_override.h"

namespace unfurl::data {

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
  return LoadToml(path, overrides, nullptr);
}

TomlTable LoadToml(const std::string& path, const std::vector<std::string>& overrides,
                   TextFiles* files) {
  TomlTable table = ParseToml(files != nullptr ? files->Read(path) : ReadTextFile(path), path);
  TomlTable::Node& root = *table.node_;
  TomlTable::Node::Document& document = *root.document;
  const auto override_with = [&](const std::string& assignment) {
    std::string dotted;
    const toml::node* node = ApplyOverride(*root.table, assignment, &dotted);
    if (node != nullptr) document.overridden[node] = dotted;
  };
  if (root.table->empty() && overrides.empty()) {
    throw Error("is empty", path, "fill it, or begin with one that `unfurl new` makes");
  }
  // An include from the command line must be known before the rest can be applied.
  const auto is_include = [](const std::string& assignment) {
    return Trim(assignment.substr(0, assignment.find('='))) == kIncludeKey;
  };
  for (const std::string& assignment : overrides) {
    if (is_include(assignment)) override_with(assignment);
  }
  if (root.Get(kIncludeKey) != nullptr) {
    MergeIncludes(root.table, path, &document.files, &document.order, files);
  }
  for (const std::string& assignment : overrides) {
    if (!is_include(assignment)) override_with(assignment);
  }
  return table;
}

const std::string& TextFiles::Read(const std::string& path) {
  const auto known = texts_.find(path);
  if (known != texts_.end()) return known->second;
  return texts_.emplace(path, ReadTextFile(path)).first->second;
}

TomlDocument::TomlDocument(const std::string& path, const std::vector<std::string>& overrides,
                           TextFiles* files)
    : table_(std::make_shared<TomlTable>(LoadToml(path, overrides, files))) {
  // Copies lose where their nodes stand, and with it the order of the named tables: noted here.
  TomlTable::Node& root = *table_->node_;
  for (const auto& [group, node] : *root.table) {
    if (!node.is_table()) continue;
    int rank = 0;
    for (const std::string& name : root.NamesInOrder(group.str(), *node.as_table())) {
      root.document->order[fmt::format("{}.{}", group.str(), name)] = rank++;
    }
  }
}

const TomlTable& TomlDocument::table() const { return *table_; }

TomlTable TomlDocument::With(const std::vector<Value>& values) const {
  const TomlTable::Node& from = *table_->node_;
  auto node = std::make_shared<TomlTable::Node>();
  node->owner = std::make_shared<toml::table>(*from.table);
  node->document = std::make_shared<TomlTable::Node::Document>();
  node->document->files = from.document->files;
  node->document->order = from.document->order;
  node->table = node->owner.get();
  node->file = from.file;
  for (const Value& value : values) {
    node->document->overridden[SetNumber(*node->table, value)] = value.key;
  }
  // As in the original, which has been read already.
  if (node->table->get(kIncludeKey) != nullptr) node->Get(kIncludeKey);
  return TomlTable(std::move(node));
}

std::string TomlTable::Where(std::string_view key) const { return node_->WhereOf(key); }
const std::string& TomlTable::path() const { return node_->path; }

void TomlTable::Fail(std::string_view key, const std::string& what,
                     const std::string& remedy) const {
  throw Error(what, Where(key), remedy);
}

void TomlTable::FailMissing(std::string_view key) const { node_->FailMissing(key); }

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
  const bool bad = name.empty() || name == "." ||
                   name.find_first_of("/\n\t") != std::string::npos || Printable(name) != name;
  if (!bad) return;
  group.Fail(name,
             name.empty() ? "a name of no letters" : "a name with a slash or a control character",
             "use letters, digits, blanks, - and _");
}

}  // namespace

std::vector<std::string> TomlTable::Node::NamesInOrder(std::string_view group,
                                                       const toml::table& named) const {
  struct Place {
    int rank;
    unsigned line, column;
    auto operator<=>(const Place&) const = default;
  };
  constexpr unsigned kLast = std::numeric_limits<unsigned>::max();  // from --set
  std::vector<std::pair<Place, std::string>> order;
  for (const auto& [name, value] : named) {
    const auto begin = value.source().begin;
    const auto known = document->order.find(fmt::format("{}.{}", group, name.str()));
    Place place{0, begin.line > 0 ? begin.line : kLast, begin.column};
    if (known != document->order.end())
      place = {known->second, 0, 0};
    else if (begin.line == 0)
      place.rank = std::numeric_limits<int>::max();
    order.emplace_back(place, std::string(name.str()));
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> names;
  names.reserve(order.size());
  for (auto& [place, name] : order) names.push_back(std::move(name));
  return names;
}

std::vector<std::pair<std::string, TomlTable>> TomlTable::NamedTables(std::string_view key) const {
  std::vector<std::pair<std::string, TomlTable>> named;
  const std::optional<TomlTable> group = TableOrNone(key);
  if (!group) return named;
  for (std::string& name : node_->NamesInOrder(key, *group->node_->table)) {
    RefuseName(*group, name);
    TomlTable table = group->Table(name);
    named.emplace_back(std::move(name), std::move(table));
  }
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
  if (node == nullptr) FailMissing(key);
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
