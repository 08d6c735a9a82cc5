#include "data/toml_files.h"

#include <toml++/toml.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/toml_include.h"

namespace unfurl::data {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 100000;
constexpr std::size_t kLongestName = 4096;

class Finder {
 public:
  std::vector<NamedFile> found;

  void Read(const std::string& path) {
    std::error_code failed;
    // A pipe can be read once only, and that is its reader's.
    if (fs::path(path).extension() != ".toml" || !fs::is_regular_file(path, failed)) return;
    if (!read_.insert(fs::weakly_canonical(path, failed).string()).second) return;
    try {
      const toml::table document = ParseTomlDocument(ReadTextFile(path), path);
      Walk(document, path);
    } catch (const Error&) {
      return;
    }
  }

  void Name(const std::string& name, const fs::path& folder, const std::string& where) {
    if (name.empty() || name.size() > kLongestName || found.size() >= kMostFiles ||
        name.find('\0') != std::string::npos) {
      return;
    }
    const fs::path path = folder / name;
    const std::string last = path.filename().string();
    const std::size_t star = last.find('*');
    std::error_code failed;
    if (star == std::string::npos) {
      if (fs::is_regular_file(path, failed)) Add(path.string(), where);
      return;
    }
    const std::string before = last.substr(0, star), after = last.substr(star + 1);
    for (const auto& entry : fs::directory_iterator(
             path.has_parent_path() ? path.parent_path() : fs::path("."), failed)) {
      const std::string here = entry.path().filename().string();
      if (here.size() >= before.size() + after.size() && here.starts_with(before) &&
          here.ends_with(after) && entry.is_regular_file(failed)) {
        Add(entry.path().string(), where);
      }
    }
  }

 private:
  void Add(const std::string& path, const std::string& where) {
    found.push_back({path, where});
    Read(path);
  }

  void Walk(const toml::node& node, const std::string& path) {
    if (const toml::table* table = node.as_table()) {
      for (const auto& [key, value] : *table) Walk(value, path);
    } else if (const toml::array* array = node.as_array()) {
      for (const auto& value : *array) Walk(value, path);
    } else if (const toml::value<std::string>* text = node.as_string()) {
      Name(text->get(), fs::path(path).parent_path(), path);
    }
  }

  std::set<std::string> read_;
};

}  // namespace

std::vector<NamedFile> FilesNamedIn(const std::string& path) {
  Finder finder;
  finder.Read(path);
  return std::move(finder.found);
}

std::vector<NamedFile> FilesNamedBy(const std::string& assignment,
                                    const std::vector<std::string>& folders) {
  Finder finder;
  std::string value = assignment.substr(std::min(assignment.find('='), assignment.size()));
  // The words of a TOML value: a name with one of these letters in it is not found.
  for (char& c : value) {
    if (std::string("=[]{}\"',").find(c) != std::string::npos) c = '\n';
  }
  for (const std::string_view word : Split(value, '\n')) {
    for (const std::string& folder : folders) {
      finder.Name(std::string(Trim(word)), folder, "--set");
    }
  }
  return std::move(finder.found);
}

}  // namespace unfurl::data
