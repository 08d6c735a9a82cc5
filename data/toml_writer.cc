#include "data/toml_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <sstream>
#include <tuple>
#include <vector>

namespace unfurl::data {

namespace {

class Writer {
 public:
  explicit Writer(const std::map<std::string, int>& order) : order_(order) {}

  void Write(const toml::table& table, const std::string& path) {
    const std::vector<Entry> entries = Sorted(table, path);
    for (const Entry& e : entries) {
      if (IsLeaf(*e.node)) out_ << e.key << " = " << Value(*e.node) << "\n";
    }
    for (const Entry& e : entries) {
      if (IsLeaf(*e.node)) continue;
      const std::string dotted = path.empty() ? e.key : path + "." + e.key;
      if (const toml::array* list = e.node->as_array()) {
        for (const toml::node& item : *list) {
          out_ << "\n[[" << dotted << "]]\n";
          Write(*item.as_table(), dotted);
        }
      } else {
        const toml::table& inner = *e.node->as_table();
        const bool leaves = std::any_of(inner.begin(), inner.end(),
                                        [](const auto& entry) { return IsLeaf(entry.second); });
        if (leaves || inner.empty()) out_ << "\n[" << dotted << "]\n";
        Write(inner, dotted);
      }
    }
  }

  std::string Text() const { return out_.str(); }

 private:
  struct Entry {
    // Rank among merged files, else line and column where it stands; without a place: last.
    std::tuple<int, std::uint32_t, std::uint32_t> place;
    std::string key;
    const toml::node* node = nullptr;
  };

  // What stands behind "key =": all but tables and lists of them.
  static bool IsLeaf(const toml::node& node) {
    if (const toml::table* table = node.as_table()) return table->is_inline();
    const toml::array* list = node.as_array();
    return list == nullptr || list->empty() || !list->is_homogeneous(toml::node_type::table) ||
           list->get(0)->as_table()->is_inline();
  }

  static std::string Value(const toml::node& node) {
    if (const toml::value<double>* number = node.as_floating_point()) {
      const std::string text =
          fmt::format("{}", number->get());  // the shortest that reads the same
      return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
    }
    if (const toml::array* list = node.as_array()) {
      std::string text = "[";
      for (const toml::node& item : *list) {
        if (text.size() > 1) text += ", ";
        text += Value(item);
      }
      return text + "]";
    }
    std::ostringstream out;
    out << toml::toml_formatter(
        node, toml::toml_formatter::default_flags & ~toml::format_flags::indentation);
    return out.str();
  }

  // A bare key as it is, any other as a quoted one.
  static std::string KeyText(const std::string& key) {
    constexpr const char* kBare =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
    if (!key.empty() && key.find_first_not_of(kBare) == std::string::npos) return key;
    return Value(toml::value<std::string>(key));
  }

  std::vector<Entry> Sorted(const toml::table& table, const std::string& path) const {
    std::vector<Entry> out;
    for (const auto& [key, node] : table) {
      constexpr auto kLast = std::numeric_limits<std::uint32_t>::max();
      const std::string name(key.str());
      const auto merged = order_.find(path.empty() ? name : fmt::format("{}.{}", path, name));
      const auto begin = node.source().begin;
      Entry e;
      e.place = {merged != order_.end() ? merged->second : std::numeric_limits<int>::max(),
                 begin.line > 0 ? begin.line : kLast, begin.column};
      e.key = KeyText(name);
      e.node = &node;
      out.push_back(std::move(e));
    }
    std::stable_sort(out.begin(), out.end(),
                     [](const Entry& a, const Entry& b) { return a.place < b.place; });
    return out;
  }

  const std::map<std::string, int>& order_;
  std::ostringstream out_;
};

}  // namespace

std::string TomlText(const toml::table& root, const std::map<std::string, int>& order) {
  Writer writer(order);
  writer.Write(root, {});
  return writer.Text();
}

}  // namespace unfurl::data
