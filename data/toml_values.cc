// Typed values out of a table, each with its range.
#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "base/signals.h"
#include "data/toml_node.h"

namespace unfurl::data {

namespace {

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

}  // namespace

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
    if (node == nullptr) owner.FailMissing(key);
    return *node;
  }
  [[noreturn]] void Wrong(const toml::node& n, const std::string& wanted) const {
    owner.Fail(key, fmt::format("holds {}, not {}", TypeName(n), wanted), "correct the value");
  }
  // "5deg" where a number is wanted: most likely it was written with a unit.
  void WrongUnit(const std::string& text) const {
    const std::size_t end = text.find_first_not_of("+-.0123456789eE");
    double number = 0.0;
    if (end == 0 || end == std::string::npos || !ParseDouble(text.substr(0, end), &number)) return;
    owner.Fail(key, fmt::format("holds '{}', not a number", text),
               "write it without a unit, in m, kg, s, N and rad");
  }
  double Number(const toml::node& n, TomlRange range) const {
    const std::optional<double> value = n.is_number() ? n.value<double>() : std::nullopt;
    if (!value) {
      if (n.is_string()) WrongUnit(*n.value<std::string>());
      Wrong(n, "a number");
    }
    if (!std::isfinite(*value)) owner.Fail(key, "is not a finite number", "give a finite number");
    if (!InRange(*value, range)) {
      owner.Fail(key, fmt::format("{} is out of range", *value), "it must be " + RangeWords(range));
    }
    return *value;
  }
  // Shown on terminals and kept in files: no control characters but the ends of lines and tabs that
  // scripts and long expressions have, and not those in a name.
  std::string Text(const toml::node& n) const {
    if (!n.is_string()) Wrong(n, "a string");
    std::string value = *n.value<std::string>();
    if (Printable(value) != value ||
        (key == "name" && value.find_first_of("\n\t") != std::string::npos)) {
      owner.Fail(key, "holds a control character", "write it with letters");
    }
    return value;
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
  return reader.Text(node);
}

std::string TomlTable::Choice(std::string_view key, const std::vector<std::string>& allowed) const {
  std::string value = String(key);
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
    values.push_back(reader.Text(item));
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
  return Has(key) ? Numbers(key, size, range) : std::move(fallback);
}
std::vector<std::string> TomlTable::StringsOr(std::string_view key,
                                              std::vector<std::string> fallback) const {
  return Has(key) ? Strings(key) : std::move(fallback);
}

}  // namespace unfurl::data
