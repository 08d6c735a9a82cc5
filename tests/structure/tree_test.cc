// The rules of the house, held against the tree as it is.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "complexity.h"
#include "helpers.h"
#include "house.h"
#include "tests/source_dir.h"

namespace unfurl::structure::tree_test {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kLargestText = 2u << 20;  // larger files are data

std::string Read(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

bool Skip(const fs::path& folder) {
  const std::string name = folder.filename().string();
  return name == "build" || name == "demo" || (name.starts_with('.') && name != ".ci");
}

// Every text file of the tree, by its path from the root. What a build or a demo leaves is not of
// the tree.
const std::map<std::string, std::string>& Tree() {
  static const std::map<std::string, std::string> kTree = [] {
    std::map<std::string, std::string> files;
    const fs::path root = UNFURL_SOURCE_DIR;
    for (auto it = fs::recursive_directory_iterator(root); it != fs::end(it); ++it) {
      if (it->is_directory()) {
        if (Skip(it->path())) it.disable_recursion_pending();
        continue;
      }
      if (it->path().filename() == ".git") continue;  // of a linked work tree
      if (!it->is_regular_file() || it->file_size() > kLargestText) continue;
      std::string text = Read(it->path());
      if (text.find('\0') != std::string::npos) continue;
      files.emplace(it->path().lexically_relative(root).generic_string(), std::move(text));
    }
    return files;
  }();
  return kTree;
}

bool IsCode(const std::string& path) {
  return std::ranges::any_of(std::vector<std::string>{".h", ".cc", ".js", ".css"},
                             [&](const std::string& end) { return path.ends_with(end); });
}

void Expect(const Findings& findings) {
  for (const std::string& finding : findings) ADD_FAILURE() << finding;
}

TEST(Tree, IsThere) {
  EXPECT_GT(Tree().size(), 50u);
  for (const char* path : {"CMakeLists.txt", "README.md", "packages.txt", "base/error.h",
                           "data/h5.h", "report/page.cc", "tests/structure/house.cc"}) {
    EXPECT_TRUE(Tree().contains(path)) << path;
  }
}

TEST(Tree, IncludesFollowTheHouse) {
  for (const auto& [path, text] : Tree()) {
    if (IsCode(path)) Expect(CheckIncludes(path, text));
  }
}

TEST(Tree, LinksFollowTheHouse) {
  for (const auto& [path, text] : Tree()) {
    if (path.ends_with("/CMakeLists.txt")) Expect(CheckLinks(path, text));
  }
}

TEST(Tree, EverySourceIsListedAndExists) {
  // A file belongs to the nearest folder at or above its own that has a CMakeLists.txt.
  std::map<std::string, std::vector<std::string>> by_folder;
  for (const auto& [path, text] : Tree()) {
    const fs::path file(path);
    fs::path folder = file.parent_path();
    while (folder.has_relative_path() &&
           !Tree().contains((folder / "CMakeLists.txt").generic_string())) {
      folder = folder.parent_path();
    }
    if (folder.empty()) folder = file.parent_path();
    by_folder[folder.generic_string()].push_back(file.lexically_relative(folder).generic_string());
  }
  for (const auto& [folder, files] : by_folder) {
    const std::string lists = (folder.empty() ? "" : folder + "/") + "CMakeLists.txt";
    if (Tree().contains(lists)) {
      Expect(CheckSources(lists, Tree().at(lists), files));
      continue;
    }
    for (const std::string& file : files) {
      EXPECT_FALSE(file.ends_with(".cc"))
          << folder << "/" << file << ": no CMakeLists.txt beside it";
    }
  }
}

TEST(Tree, NamesNoMachine) {
  for (const auto& [path, text] : Tree()) Expect(CheckMachinePaths(path, text));
}

TEST(Tree, TestsHaveFoldersOfTheirOwn) {
  for (const auto& [path, text] : Tree()) Expect(CheckSharedFolders(path, text));
}

TEST(Tree, TestsHaveNamespacesOfTheirOwn) {
  for (const auto& [path, text] : Tree()) Expect(CheckOwnNamespace(path, text));
}

TEST(Tree, FilesAreShort) {
  for (const auto& [path, text] : Tree()) {
    if (!IsCode(path)) continue;
    bool is_long = false;
    Expect(CheckLength(path, text, &is_long));
    if (is_long) std::printf("note: %s has more than 400 lines\n", path.c_str());
  }
}

TEST(Tree, DocumentsAreNarrow) {
  for (const auto& [path, text] : Tree()) Expect(CheckLineLengths(path, text));
}

// At most one function in a hundred is over kComplex; none is over kTooComplex.
TEST(Tree, FunctionsAreSimple) {
  constexpr int kComplex = 15, kTooComplex = 25;
  std::vector<std::pair<FunctionComplexity, std::string>> complex;
  std::size_t functions = 0;
  for (const auto& [path, text] : Tree()) {
    if (RoomOf(path).empty() || !IsCode(path)) continue;
    for (const FunctionComplexity& function : ComplexityOf(text)) {
      ++functions;
      if (function.complexity > kComplex) complex.emplace_back(function, path);
    }
  }
  std::ranges::sort(complex, std::greater(), [](const auto& f) { return f.first.complexity; });
  for (const auto& [f, path] : complex) {
    std::printf("note: %s:%d: %s has complexity %d\n", path.c_str(), f.line, f.name.c_str(),
                f.complexity);
    EXPECT_LE(f.complexity, kTooComplex) << path << ":" << f.line << ": " << f.name;
  }
  std::printf("note: %zu of %zu functions are over %d\n", complex.size(), functions, kComplex);
  EXPECT_LE(100 * complex.size(), functions) << "the largest are listed above";
  EXPECT_GT(functions, 1000u);
}

TEST(Tree, HelpersAreNotConfused) {
  std::map<std::string, std::map<std::string, std::string>> rooms;
  for (const auto& [path, text] : Tree()) {
    if (path.ends_with(".cc") && !RoomOf(path).empty()) rooms[RoomOf(path)][path] = text;
  }
  EXPECT_GT(rooms.size(), 5U);
  for (const auto& [room, files] : rooms) Expect(CheckHelpers(files));
}

TEST(Tree, NumbersHaveReasons) {
  for (const auto& [path, text] : Tree()) {
    if (path.ends_with(".h") || path.ends_with(".cc")) Expect(CheckConstants(path, text));
  }
}

TEST(Tree, RootsKeepWhatIsNoNumber) {
  for (const auto& [path, text] : Tree()) {
    if (IsCode(path) && !RoomOf(path).empty()) Expect(CheckRoots(path, text));
  }
}

TEST(Tree, HeadersAreGuarded) {
  for (const auto& [path, text] : Tree()) Expect(CheckHeader(path, text));
}

TEST(Tree, LinksLeadSomewhere) {
  for (const auto& [path, text] : Tree()) {
    if (!path.ends_with(".md")) continue;
    const fs::path folder = (fs::path(UNFURL_SOURCE_DIR) / path).parent_path();
    for (const std::string& link : LinksOf(text)) {
      EXPECT_TRUE(fs::exists(folder / link)) << path << " links to " << link;
    }
  }
}

// docs/README.md is the index: every document and decision is in it.
TEST(Tree, DocumentsAreIndexed) {
  const std::vector<std::string> links = LinksOf(Tree().at("docs/README.md"));
  for (const auto& [path, text] : Tree()) {
    if (!path.starts_with("docs/") || !path.ends_with(".md") || path == "docs/README.md") continue;
    if (path.starts_with("docs/reference/") && path != "docs/reference/README.md") continue;
    EXPECT_NE(std::ranges::find(links, path.substr(5)), links.end())
        << path << " has no line in docs/README.md";
  }
}

TEST(Tree, EveryPackageIsJustified) {
  ASSERT_TRUE(Tree().contains("docs/dependencies.md"));
  for (const char* list : {"packages.txt", "packages-test.txt", "packages-slow.txt"}) {
    ASSERT_TRUE(Tree().contains(list));
    Expect(CheckPackages(list, Tree().at(list), Tree().at("docs/dependencies.md")));
  }
}

}  // namespace
}  // namespace unfurl::structure::tree_test
