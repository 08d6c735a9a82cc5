#include "data/toml.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"

namespace unfurl::data {

// One table of the document, shared by all TomlTable that look at it: so keys read through any of
// them are remembered in one place. Nodes keep the whole document alive.
struct TomlTable::Node {
  std::shared_ptr<toml::table> document;
  toml::table* table = nullptr;
  std::string file;
  std::string path;
  int line = 0;
  std::set<std::string> asked;                                           // keys a reader knows
  std::map<std::string, std::shared_ptr<Node>> tables;                   // by key, or "key[i]"
  std::shared_ptr<std::map<const toml::node*, std::string>> overridden;  // node -> dotted key

  std::string Dotted(std::string_view key) const {
    if (key.empty()) return path;
    return path.empty() ? std::string(key) : path + "." + std::string(key);
  }

  const toml::node* Get(std::string_view key) {
    asked.insert(std::string(key));
    return table->get(key);
  }

  std::string WhereOf(std::string_view key) const {
    const toml::node* node = key.empty() ? nullptr : table->get(key);
    if (node != nullptr) {
      const auto set = overridden->find(node);
      if (set != overridden->end()) return "--set " + set->second;
    }
    const int at = node != nullptr && node->source().begin.line > 0
                       ? static_cast<int>(node->source().begin.line)
                       : line;
    const std::string dotted = Dotted(key);
    std::string where = file;
    if (at > 0) where += fmt::format(":{}", at);
    if (!dotted.empty()) where += ":" + dotted;
    return where;
  }

  std::shared_ptr<Node> Child(const std::string& slot, const std::string& child_path,
                              toml::table* child) {
    auto& node = tables[slot];
    if (!node) {
      node = std::make_shared<Node>();
      node->document = document;
      node->table = child;
      node->file = file;
      node->path = child_path;
      node->line = static_cast<int>(child->source().begin.line);
      node->overridden = overridden;
    }
    return node;
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

namespace {

const char* TypeName(const toml::node& node) {
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

std::string RangeWords(TomlRange range) {
  const bool low = std::isfinite(range.low), high = std::isfinite(range.high);
  const std::string from = fmt::format("{} {}", range.open_low ? "above" : "at least", range.low);
  const std::string to = fmt::format("{} {}", range.open_high ? "below" : "at most", range.high);
  if (low && high) return from + " and " + to;
  return low ? from : to;
}

bool InRange(double v, TomlRange r) {
  return (r.open_low ? v > r.low : v >= r.low) && (r.open_high ? v < r.high : v <= r.high);
}

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

bool TomlTable::Has(std::string_view key) const { return node_->Get(key) != nullptr; }

bool TomlTable::IsNumber(std::string_view key) const {
  const toml::node* n = node_->Get(key);
  return n != nullptr && n->is_number();
}
bool TomlTable::IsString(std::string_view key) const {
  const toml::node* n = node_->Get(key);
  return n != nullptr && n->is_string();
}
bool TomlTable::IsArray(std::string_view key) const {
  const toml::node* n = node_->Get(key);
  return n != nullptr && n->is_array();
}
bool TomlTable::IsTable(std::string_view key) const {
  const toml::node* n = node_->Get(key);
  return n != nullptr && n->is_table();
}

namespace {

// `Fail` of the owner, bound to the key: what each typed reader needs.
struct Reader {
  const TomlTable& owner;
  std::string key;
  const toml::node* node;

  const toml::node& Require() const {
    if (node == nullptr) {
      throw Error(fmt::format("'{}' is missing", key), owner.Where(), "add the key");
    }
    return *node;
  }
  [[noreturn]] void Wrong(const toml::node& n, const std::string& wanted) const {
    owner.Fail(key, fmt::format("holds {}, not {}", TypeName(n), wanted), "correct the value");
  }
  double Number(const toml::node& n, TomlRange range) const {
    const std::optional<double> value = n.is_number() ? n.value<double>() : std::nullopt;
    if (!value) Wrong(n, "a number");
    if (!std::isfinite(*value)) owner.Fail(key, "is not a finite number", "give a finite number");
    if (!InRange(*value, range)) {
      owner.Fail(key, fmt::format("{} is out of range", *value), "it must be " + RangeWords(range));
    }
    return *value;
  }
  const toml::array& Array(const toml::node& n, int size) const {
    const toml::array* array = n.as_array();
    if (array == nullptr) Wrong(n, "an array");
    if (size >= 0 && array->size() != static_cast<std::size_t>(size)) {
      owner.Fail(key, fmt::format("holds {} values", array->size()), fmt::format("give {}", size));
    }
    return *array;
  }
};

}  // namespace

double TomlTable::Number(std::string_view key, TomlRange range) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  return reader.Number(reader.Require(), range);
}

int TomlTable::Integer(std::string_view key, int low, int high) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  const toml::node& node = reader.Require();
  if (!node.is_integer()) reader.Wrong(node, "a whole number");
  const std::int64_t value = *node.value<std::int64_t>();
  if (value < low || value > high) {
    Fail(key, fmt::format("{} is out of range", value),
         fmt::format("it must be from {} to {}", low, high));
  }
  return static_cast<int>(value);
}

bool TomlTable::Bool(std::string_view key) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  const toml::node& node = reader.Require();
  if (!node.is_boolean()) reader.Wrong(node, "true or false");
  return *node.value<bool>();
}

std::string TomlTable::String(std::string_view key) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  const toml::node& node = reader.Require();
  if (!node.is_string()) reader.Wrong(node, "a string");
  return *node.value<std::string>();
}

std::string TomlTable::Choice(std::string_view key, const std::vector<std::string>& allowed) const {
  const std::string value = String(key);
  for (const std::string& name : allowed) {
    if (name == value) return value;
  }
  const std::string nearest = NearestName(value, allowed);
  Fail(key, fmt::format("'{}' is not known", value),
       (nearest.empty() ? "" : "did you mean '" + nearest + "'? ") + "choose among " +
           JoinWords(allowed));
}

std::vector<double> TomlTable::Numbers(std::string_view key, int size, TomlRange range) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  std::vector<double> values;
  for (const toml::node& item : reader.Array(reader.Require(), size)) {
    values.push_back(reader.Number(item, range));
  }
  return values;
}

std::vector<std::string> TomlTable::Strings(std::string_view key) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  std::vector<std::string> values;
  for (const toml::node& item : reader.Array(reader.Require(), -1)) {
    if (!item.is_string()) reader.Wrong(item, "a string");
    values.push_back(*item.value<std::string>());
  }
  return values;
}

std::vector<std::vector<double>> TomlTable::Rows(std::string_view key, int columns) const {
  const Reader reader{*this, std::string(key), node_->Get(key)};
  std::vector<std::vector<double>> rows;
  for (const toml::node& row : reader.Array(reader.Require(), -1)) {
    std::vector<double> values;
    for (const toml::node& item : reader.Array(row, columns)) {
      values.push_back(reader.Number(item, kAny));
    }
    rows.push_back(std::move(values));
  }
  return rows;
}

double TomlTable::NumberOr(std::string_view key, double fallback, TomlRange range) const {
  return Has(key) ? Number(key, range) : fallback;
}
int TomlTable::IntegerOr(std::string_view key, int fallback, int low, int high) const {
  return Has(key) ? Integer(key, low, high) : fallback;
}
bool TomlTable::BoolOr(std::string_view key, bool fallback) const {
  return Has(key) ? Bool(key) : fallback;
}
std::string TomlTable::StringOr(std::string_view key, const std::string& fallback) const {
  return Has(key) ? String(key) : fallback;
}
std::string TomlTable::ChoiceOr(std::string_view key, const std::string& fallback,
                                const std::vector<std::string>& allowed) const {
  return Has(key) ? Choice(key, allowed) : fallback;
}
std::vector<double> TomlTable::NumbersOr(std::string_view key, std::vector<double> fallback,
                                         int size, TomlRange range) const {
  return Has(key) ? Numbers(key, size, range) : fallback;
}
std::vector<std::string> TomlTable::StringsOr(std::string_view key,
                                              std::vector<std::string> fallback) const {
  return Has(key) ? Strings(key) : fallback;
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
