#include "data/toml_override.h"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/toml_include.h"
#include "data/toml_writer.h"

namespace unfurl::data {

namespace {

constexpr std::size_t kTomlOverrideMostParts = 64;  // of a dotted key: deeper than any file of ours

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

// "value[2][0]" is the key "value" and the indices 2, 0.
struct KeyPart {
  std::string key;
  std::vector<std::size_t> index;
};

KeyPart PartOf(const std::string& text, const std::string& dotted) {
  KeyPart part;
  const std::size_t open = text.find('[');
  part.key = text.substr(0, open);
  for (std::size_t at = open; at < text.size();) {
    const std::size_t close = text.find(']', at);
    const std::string digits =
        close == std::string::npos ? std::string() : text.substr(at + 1, close - at - 1);
    constexpr std::size_t kMostDigits = 9;  // of an index; fits an int
    if (text[at] != '[' || digits.empty() || digits.size() > kMostDigits ||
        digits.find_first_not_of("0123456789") != std::string::npos) {
      throw Error(fmt::format("'{}' is not a key", text), "--set " + dotted,
                  "name an item of an array as key[0]");
    }
    part.index.push_back(std::stoul(digits));
    at = close + 1;
  }
  return part;
}

// The item of the array `node` that the indices from `depth` on lead to.
toml::node* ItemOf(toml::node* node, const KeyPart& part, std::size_t depth,
                   const std::string& dotted) {
  for (std::size_t d = depth; d < part.index.size(); ++d) {
    toml::array* array = node != nullptr ? node->as_array() : nullptr;
    if (array == nullptr) {
      throw Error(fmt::format("'{}' is not an array", part.key), "--set " + dotted,
                  "leave the [index] out, or name a key that holds an array");
    }
    if (part.index[d] >= array->size()) {
      throw Error(fmt::format("'{}' has no item {}", part.key, part.index[d]), "--set " + dotted,
                  fmt::format("it has {}, counted from 0", array->size()));
    }
    node = array->get(part.index[d]);
  }
  return node;
}

// Sets what `dotted` names to a copy of `value`, and gives the node whose readers are to name the
// override: that of the value, or that of the whole array that it is an item of. Tables that are
// not there are made; items of arrays are not.
const toml::node* SetNode(toml::table& root, const std::string& dotted, const toml::node& value) {
  const std::vector<std::string> keys = Split(dotted, '.');
  if (keys.size() > kTomlOverrideMostParts) {
    throw Error(fmt::format("a key of {} parts", keys.size()), "--set", "name tables less deep");
  }
  toml::table* table = &root;
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    const KeyPart part = PartOf(keys[i], dotted);
    toml::node* next = table->get(part.key);
    if (next == nullptr && part.index.empty()) {
      table->insert(part.key, toml::table{});
      next = table->get(part.key);
    }
    next = ItemOf(next, part, 0, dotted);
    table = next->as_table();
    if (table == nullptr) {
      throw Error(fmt::format("'{}' is not a table", keys[i]), "--set " + dotted,
                  "name a key of the file, table by table, with dots");
    }
  }
  const KeyPart last = PartOf(keys.back(), dotted);
  if (last.index.empty()) {
    value.visit([&](const auto& node) { table->insert_or_assign(last.key, node); });
    return table->get(last.key);
  }
  ItemOf(table->get(last.key), last, 0, dotted);  // it is there
  KeyPart parent = last;
  parent.index.pop_back();
  toml::array* array = ItemOf(table->get(last.key), parent, 0, dotted)->as_array();
  const auto at = array->cbegin() + static_cast<std::ptrdiff_t>(last.index.back());
  value.visit([&](const auto& node) { array->replace(at, node); });
  return table->get(last.key);
}

// Takes a key away, with all that is below it.
void RemoveNode(toml::table& root, const std::string& dotted) {
  toml::table* table = &root;
  const std::vector<std::string> keys = Split(dotted, '.');
  for (std::size_t i = 0; i < keys.size() && table != nullptr; ++i) {
    std::vector<std::string> known;
    for (const auto& [key, node] : *table) known.emplace_back(key.str());
    toml::node* next = table->get(keys[i]);
    if (next == nullptr) {
      const std::string nearest = NearestName(keys[i], known);
      throw Error(
          fmt::format("there is no '{}' to be taken away", dotted), "--set " + dotted + "=",
          nearest.empty() ? "it has " + JoinWords(known) : "did you mean '" + nearest + "'?");
    }
    if (i + 1 == keys.size()) {
      table->erase(keys[i]);
      return;
    }
    table = next->as_table();
  }
  throw Error(fmt::format("'{}' is no table", dotted), "--set " + dotted + "=",
              "name a key of the file, table by table, with dots");
}

}  // namespace

const toml::node* ApplyOverride(toml::table& root, const std::string& assignment,
                                std::string* dotted) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw Error("has no '='", "--set " + assignment, "write --set key=value");
  }
  *dotted = std::string(Trim(assignment.substr(0, equals)));
  if (Trim(assignment.substr(equals + 1)).empty()) {
    RemoveNode(root, *dotted);
    return nullptr;
  }
  const toml::table parsed = ParseOverride(assignment.substr(equals + 1), *dotted);
  return SetNode(root, *dotted, *parsed.get("v"));
}

const toml::node* SetNumber(toml::table& root, const TomlDocument::Value& value) {
  constexpr double kExact = 9007199254740992.0;  // 2^53
  if (std::trunc(value.number) == value.number && std::abs(value.number) < kExact) {
    return SetNode(root, value.key, toml::value(static_cast<std::int64_t>(value.number)));
  }
  return SetNode(root, value.key, toml::value(value.number));
}

std::string TextWithOverrides(const std::string& path, const std::vector<std::string>& overrides) {
  toml::table root = ParseTomlDocument(ReadTextFile(path), path);
  std::string dotted;
  std::map<std::string, int> order;
  if (root.get(kIncludeKey) != nullptr) {
    std::vector<std::string> files;
    MergeIncludes(&root, path, &files, &order, nullptr);
    root.erase(kIncludeKey);
  }
  for (const std::string& assignment : overrides) ApplyOverride(root, assignment, &dotted);
  return TomlText(root, order);
}

}  // namespace unfurl::data
