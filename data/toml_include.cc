#include "data/toml_include.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/h5.h"
#include "data/h5_checks.h"
#include "data/toml.h"

namespace unfurl::data {
namespace {

constexpr std::size_t kTomlIncludeMostFiles =
    1000;                                  // included by one; stops those that double at each level
constexpr int kTomlIncludeMostParts = 64;  // of a dotted key

// The place after the string that begins at `at`.
std::size_t AfterString(const std::string& text, std::size_t at) {
  const char quote = text[at];
  const std::string three(3, quote);
  const bool lines = text.compare(at, 3, three) == 0;
  for (std::size_t i = at + (lines ? 3 : 1); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (lines ? text.compare(i, 3, three) == 0 : text[i] == quote || text[i] == '\n') {
      return i + (lines ? 3 : 1);
    }
  }
  return text.size();
}

// Each part of a dotted key becomes a table within a table, and the parser and the tables go down
// them by recursion: a key of thousands of parts would end the stack.
void RefuseLongKeys(const std::string& text, const std::string& name) {
  int parts = 1, line = 1;
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '"' || c == '\'') {
      const std::size_t after = AfterString(text, at);
      line += static_cast<int>(std::count(text.begin() + static_cast<std::ptrdiff_t>(at),
                                          text.begin() + static_cast<std::ptrdiff_t>(after), '\n'));
      at = after;
      continue;
    }
    if (c == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (c == '.' && ++parts > kTomlIncludeMostParts) {
      throw Error(fmt::format("a key of more than {} parts", kTomlIncludeMostParts),
                  fmt::format("{}:{}", name, line), "name tables less deep");
    }
    if (c == '\n') ++line;
    if (std::string_view("=,[]{}\n").find(c) != std::string_view::npos) parts = 1;
    ++at;
  }
}

// A pipe has no canonical name; its own will do.
std::filesystem::path Canonical(const std::filesystem::path& path) {
  std::error_code failed;
  const std::filesystem::path canonical = std::filesystem::weakly_canonical(path, failed);
  return failed ? path : canonical;
}

class Merger {
 public:
  Merger(std::vector<std::string>* files, std::map<std::string, int>* order, TextFiles* texts)
      : files_(files), order_(order), texts_(texts) {}

  void Merge(toml::table* document, const std::string& path) {
    chain_.push_back(Canonical(path));
    std::vector<toml::table> below;
    if (const toml::node* list = document->get(kIncludeKey)) {
      for (const std::string& name : Names(*list, path)) below.push_back(Load(name, *list, path));
    }
    NoteOrder(*document);
    for (auto base = below.rbegin(); base != below.rend(); ++base) MergeUnder(document, &*base);
    chain_.pop_back();
  }

 private:
  static std::string Where(const toml::node& list, const std::string& path) {
    const auto line = list.source().begin.line;  // none: from the command line
    return line > 0 ? fmt::format("{}:{}:{}", path, line, kIncludeKey) : "--set include";
  }

  static std::vector<std::string> Names(const toml::node& list, const std::string& path) {
    std::vector<std::string> names;
    const toml::array* array = list.as_array();
    bool good = array != nullptr;
    for (std::size_t k = 0; good && k < array->size(); ++k) {
      good = array->get(k)->is_string();
      if (good) names.push_back(*array->get(k)->value<std::string>());
    }
    if (!good) {
      throw Error("is not a list of file names", Where(list, path),
                  "write include = [\"common.toml\"]");
    }
    return names;
  }

  toml::table Load(const std::string& name, const toml::node& list, const std::string& from) {
    std::error_code ignored;
    const std::filesystem::path file = std::filesystem::path(from).parent_path() / name;
    const auto canonical = Canonical(file);
    const auto above = std::find(chain_.begin(), chain_.end(), canonical);
    if (above != chain_.end()) {
      std::string round;
      for (auto link = above; link != chain_.end(); ++link)
        round += link->filename().string() + " > ";
      throw Error(fmt::format("the files include each other in a circle: {}{}", round,
                              canonical.filename().string()),
                  Where(list, from), "remove one of the includes");
    }
    if (!std::filesystem::is_regular_file(file, ignored)) {
      throw Error(fmt::format("there is no file \"{}\" to include", file.string()),
                  Where(list, from), "names are relative to the file that includes");
    }
    if (files_->size() >= kTomlIncludeMostFiles) {
      throw Error(fmt::format("more than {} files are included", kTomlIncludeMostFiles),
                  Where(list, from), "include each file once");
    }
    files_->push_back(file.string());
    toml::table document = ParseTomlDocument(
        texts_ != nullptr ? texts_->Read(file.string()) : ReadTextFile(file.string()),
        file.string());
    Merge(&document, file.string());
    document.erase(kIncludeKey);
    return document;
  }

  void NoteOrder(const toml::table& document) {
    struct Place {
      unsigned line, column;
      std::string name;
      auto operator<=>(const Place&) const = default;
    };
    std::vector<Place> places;
    for (const auto& [group, node] : document) {
      const toml::table* tables = node.as_table();
      if (tables == nullptr) continue;
      for (const auto& [name, value] : *tables) {
        const auto begin = value.source().begin;
        places.push_back({begin.line, begin.column, fmt::format("{}.{}", group.str(), name.str())});
      }
    }
    std::sort(places.begin(), places.end());
    for (Place& p : places)
      order_->try_emplace(std::move(p.name), static_cast<int>(order_->size()));
  }

  // Nodes move, since copies lose where they stand.
  static void MergeUnder(toml::table* top, toml::table* base) {
    for (auto&& [key, node] : *base) {
      toml::node* own = top->get(key.str());
      if (own == nullptr) {
        const toml::key& name = key;
        node.visit([&](auto& value) { top->insert(name, std::move(value)); });
      } else if (own->is_table() && node.is_table()) {
        MergeUnder(own->as_table(), node.as_table());
      }
    }
  }

  std::vector<std::string>* files_;
  std::map<std::string, int>* order_;
  TextFiles* texts_;
  std::vector<std::filesystem::path> chain_;  // from the first file to the one being merged
};

}  // namespace

namespace {

// Pictures, HDF5, archives: what the parser would say of their first byte helps nobody.
void RefuseBinary(const std::string& text, const std::string& name) {
  if (text.find('\0') == std::string::npos) return;
  if (!text.starts_with("\x89HDF")) {
    throw Error("is a binary file, where TOML is read", name, "give a text file");
  }
  std::string what = "an HDF5 file";
  try {
    what = H5SchemaWords(H5Reader::SchemaOf(name));
  } catch (const Error&) {  // of somebody else, or no file but a text
  }
  throw Error("is " + what + ", where TOML is read", name, "`unfurl info` says what it holds");
}

}  // namespace

toml::table ParseTomlDocument(const std::string& text, const std::string& name) {
  RefuseBinary(text, name);
  RefuseLongKeys(text, name);
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    throw Error(
        fmt::format("not valid TOML: {}", error.description()),
        fmt::format("{}:{}:{}", name, error.source().begin.line, error.source().begin.column),
        "correct the line");
  }
}

void MergeIncludes(toml::table* document, const std::string& path, std::vector<std::string>* files,
                   std::map<std::string, int>* order, TextFiles* texts) {
  Merger(files, order, texts).Merge(document, path);
}

}  // namespace unfurl::data
