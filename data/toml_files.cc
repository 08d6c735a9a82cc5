#include "data/toml_files.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string_view>

#include "base/error.h"
#include "base/folder.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/toml_include.h"

namespace unfurl::data {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kTomlFilesMostFiles = 100000;  // named in all; patterns are expanded
constexpr std::size_t kLongestName = 4096;           // bytes, as PATH_MAX: longer text is no path

// By the name; or, whatever the name, as text of a size that people write. A pipe can be read once
// only, and that is its reader's.
bool MayBeToml(const std::string& path) {
  constexpr std::uintmax_t kLargest = 4 << 20;  // bytes
  std::error_code failed;
  if (!fs::is_regular_file(path, failed)) return false;
  if (fs::path(path).extension() == ".toml") return true;
  if (fs::file_size(path, failed) > kLargest || failed) return false;
  std::array<char, 4096> start{};
  std::ifstream stream(path, std::ios::binary);
  stream.read(start.data(), start.size());
  const std::string_view text(start.data(), static_cast<std::size_t>(stream.gcount()));
  return text.find('\0') == std::string_view::npos && text.find('=') != std::string_view::npos;
}

class Finder {
 public:
  std::vector<NamedFile> found;

  void Read(const std::string& path) {
    std::error_code failed;
    if (!MayBeToml(path)) return;
    if (!read_.insert(fs::weakly_canonical(path, failed).string()).second) return;
    try {
      const toml::table document = ParseTomlDocument(ReadTextFile(path), path);
      Walk(document, path);
    } catch (const Error&) {
      return;
    }
  }

  void Name(const std::string& name, const fs::path& folder, const std::string& where) {
    if (name.empty() || name.size() > kLongestName || found.size() >= kTomlFilesMostFiles ||
        name.find('\0') != std::string::npos) {
      return;
    }
    const fs::path path = folder / name;
    const std::string last = path.filename().string();
    std::error_code failed;
    if (last.find('*') != std::string::npos) {
      for (const std::string& file : FilesLike(path.string())) Add(file, where);
    } else if (fs::is_regular_file(path, failed)) {
      Add(path.string(), where);
    }
  }

  // Calls `use` for every string in a document.
  static void Strings(const toml::node& node, const std::function<void(const std::string&)>& use) {
    if (const toml::table* table = node.as_table()) {
      for (const auto& [key, value] : *table) Strings(value, use);
    } else if (const toml::array* array = node.as_array()) {
      for (const auto& value : *array) Strings(value, use);
    } else if (const toml::value<std::string>* text = node.as_string()) {
      use(text->get());
    }
  }

 private:
  void Add(const std::string& path, const std::string& where) {
    found.push_back({path, where});
    Read(path);
  }

  void Walk(const toml::node& node, const std::string& path) {
    Strings(node, [&](const std::string& text) {
      const fs::path folder = fs::path(path).parent_path();
      Name(text, folder, path);
      NameInCommand(text, folder, path);
    });
  }

  // A word of a study's command: "{study}/model.py", "--scene={study}/scene.toml".
  void NameInCommand(const std::string& word, const fs::path& folder, const std::string& where) {
    constexpr std::string_view kStudy = "{study}";
    const std::size_t study = word.find(kStudy);
    if (study != std::string::npos) {
      const std::string rest = word.substr(study + kStudy.size());
      Name(rest.substr(std::min(rest.find_first_not_of('/'), rest.size())), folder, where);
    } else if (const std::size_t at = word.find('='); at != std::string::npos) {
      Name(word.substr(at + 1), folder, where);
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
  const std::string value =
      assignment.substr(std::min(assignment.find('='), assignment.size() - 1) + 1);
  const auto name = [&](const std::string& word) {
    for (const std::string& folder : folders) finder.Name(word, folder, "--set");
  };
  name(std::string(Trim(value)));  // a bare word
  try {
    finder.Strings(ParseTomlDocument("v = " + value, "--set"), name);
  } catch (const Error&) {  // which its reader will say
  }
  return std::move(finder.found);
}

}  // namespace unfurl::data
