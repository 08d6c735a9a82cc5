#include "house.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <map>
#include <set>

namespace unfurl::structure {
namespace {

constexpr int kReportedLines = 400;
constexpr int kMostLines = 500;
constexpr int kDocumentCharacters = 120;

const std::map<std::string, std::set<std::string>, std::less<>>& Below() {
  static const std::map<std::string, std::set<std::string>, std::less<>> kBelow = {
      {"base", {}},
      {"data", {"base"}},
      {"sim", {"base", "data"}},
      {"measure", {"base", "data"}},
      {"correlate", {"base", "data"}},
      {"report", {"base", "data"}},
      {"calib", {"base", "data", "measure"}},
      {"study", {"base", "data", "sim", "correlate"}},
      {"campaign", {"base", "data", "sim", "measure", "correlate", "calib", "study"}},
      {"unfurl", {"base", "data", "sim", "measure", "correlate", "calib", "study", "campaign"}},
      {"python",
       {"base", "data", "sim", "measure", "correlate", "calib", "study", "campaign", "unfurl"}},
      {"cli",
       {"base", "data", "sim", "measure", "correlate", "report", "calib", "study", "campaign"}},
  };
  return kBelow;
}

bool IsSource(const std::string& path) { return path.ends_with(".cc"); }

bool IsDocument(const std::string& path) { return path.ends_with(".md"); }

struct Wrapped {
  std::string header;  // how the name in <...> begins
  std::function<bool(const std::string& room, const std::string& path)> allowed;
  std::string where;
};

const std::vector<Wrapped>& WrappedHeaders() {
  const auto rooms = [](std::set<std::string> names) {
    return [names = std::move(names)](const std::string& room, const std::string&) {
      return names.contains(room);
    };
  };
  const auto in_file = [](const std::string& prefix) {
    return
        [prefix](const std::string&, const std::string& path) { return path.starts_with(prefix); };
  };
  const auto ceres = [](const std::string& room, const std::string& path) {
    return (room == "calib" || room == "correlate") && IsSource(path);
  };
  const auto boost_math = [](const std::string&, const std::string& path) {
    return path == "base/statistics.cc" || path == "base/probability.cc";
  };
  const auto in_file_of_boost = [=](const std::string& room, const std::string& path) {
    return boost_math(room, path) || path == "campaign/statistics/sobol_sequence.cc";
  };
  static const std::vector<Wrapped> kWrapped = {
      {"toml++/", in_file("data/toml_"), "data/toml_*"},
      {"toml.hpp", in_file("data/toml_"), "data/toml_*"},
      {"hdf5", in_file("data/h5"), "data/h5*"},
      {"H5", in_file("data/h5"), "data/h5*"},
      {"fftw3", rooms({"correlate"}), "correlate/"},
      {"ceres/", ceres, "the .cc files of calib/ and correlate/"},
      {"CLI/", rooms({"cli"}), "cli/"},
      {"pybind11/", rooms({"python"}), "python/"},
      {"Python.h", rooms({"python"}), "python/"},
      {"opencv2/", rooms({"measure", "cli"}), "measure/ and cli/"},
      {"boost/random/", in_file("campaign/statistics/sobol_sequence.cc"),
       "campaign/statistics/sobol_sequence.cc"},
      {"boost/math/", boost_math, "base/statistics.cc and base/probability.cc"},
      {"boost/", in_file_of_boost, "files that wrap a library of Boost"},
      {"png.h", in_file("measure/png.cc"), "measure/png.cc"},
      {"glog/", in_file("base/log_silence.cc"), "base/log_silence.cc"},
      {"nettle/", in_file("data/provenance.cc"), "data/provenance.cc"},
      {"libdeflate.h", in_file("data/h5_packed.cc"), "data/h5_packed.cc"},
      {"gtest/", rooms({}), "tests/"},
      {"gmock/", rooms({}), "tests/"},
  };
  return kWrapped;
}

void ForEachLine(std::string_view text, const std::function<void(int, std::string_view)>& visit) {
  int number = 1;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    visit(number++, text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
  }
}

// What an #include line names, and whether in quotes; empty when it is none.
struct Include {
  std::string name;
  bool quoted = false;
};

Include ParseInclude(std::string_view line) {
  const auto skip_blanks = [&line] {
    while (!line.empty() && (line.front() == ' ' || line.front() == '\t')) line.remove_prefix(1);
  };
  skip_blanks();
  if (!line.starts_with('#')) return {};
  line.remove_prefix(1);
  skip_blanks();
  if (!line.starts_with("include")) return {};
  line.remove_prefix(std::string_view("include").size());
  skip_blanks();
  if (line.empty() || (line.front() != '"' && line.front() != '<')) return {};
  const bool quoted = line.front() == '"';
  const std::size_t end = line.find(quoted ? '"' : '>', 1);
  if (end == std::string_view::npos) return {};
  return {std::string(line.substr(1, end - 1)), quoted};
}

bool IsWordCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.' || c == '-' ||
         c == '/' || c == '$' || c == '{' || c == '}';
}

// The words of a CMakeLists.txt outside comments.
std::vector<std::string> CMakeWords(std::string_view text) {
  std::vector<std::string> words;
  ForEachLine(text, [&](int, std::string_view line) {
    line = line.substr(0, line.find('#'));
    std::string word;
    for (std::size_t i = 0; i <= line.size(); ++i) {
      if (i < line.size() && (IsWordCharacter(line[i]) || line[i] == ':')) {
        word += line[i];
      } else if (!word.empty()) {
        words.push_back(word);
        word.clear();
      }
    }
  });
  return words;
}

// A declaration's text with `//` comments taken out, from its first line to the semicolon.
struct Declaration {
  std::string code;
  bool has_comment = false;

  void Add(std::string_view line) {
    const std::size_t comment = line.find("//");
    has_comment |= comment != std::string_view::npos;
    code += line.substr(0, comment);
    code += ' ';
  }
  bool Ends() const { return code.find(';') != std::string::npos; }
  // Whether it gives a name a number: "double kA = 0.5", "int kB = -2 * kC, kD = kE".
  bool IsNumber() const {
    const std::size_t first = code.find('=');
    if (code.find('(') < first) return false;  // a function
    for (std::size_t at = first; at != std::string::npos; at = code.find('=', at + 1)) {
      const std::size_t value = code.find_first_not_of(" -.", at + 1);
      if (value != std::string::npos && std::isdigit(static_cast<unsigned char>(code[value])) != 0)
        return true;
    }
    return false;
  }
  bool IsVersion() const { return code.find("Version =") != std::string::npos; }
};

void CheckArrow(const std::string& room, const std::string& target, const std::string& where,
                Findings* findings) {
  if (!Below().contains(target) || target == room || Below().at(room).contains(target)) return;
  findings->push_back(fmt::format("{}: {} must not know {}", where, room, target));
}

}  // namespace

std::string RoomOf(const std::string& path) {
  const std::size_t slash = path.find('/');
  if (slash == std::string::npos) return {};
  const std::string room = path.substr(0, slash);
  return Below().contains(room) ? room : std::string();
}

Findings CheckIncludes(const std::string& path, std::string_view text) {
  Findings findings;
  const std::string room = RoomOf(path);
  if (room.empty()) return findings;
  ForEachLine(text, [&](int number, std::string_view line) {
    const Include include = ParseInclude(line);
    if (include.name.empty()) return;
    const std::string where = fmt::format("{}:{}", path, number);
    const std::string target = RoomOf(include.name);
    // Mathematics that knows no record: a room inside a room.
    const std::string inner = "campaign/statistics/";
    if (path.starts_with(inner) && !target.empty() && target != "base" &&
        !include.name.starts_with(inner)) {
      findings.push_back(fmt::format("{}: {} must not know {}", where, inner, include.name));
      return;
    }
    if (!target.empty()) {
      CheckArrow(room, target, where, &findings);
      return;
    }
    if (include.quoted) {
      findings.push_back(
          fmt::format("{}: \"{}\" is not named from the root of the tree", where, include.name));
      return;
    }
    for (const Wrapped& wrapped : WrappedHeaders()) {
      if (!include.name.starts_with(wrapped.header)) continue;
      if (!wrapped.allowed(room, path)) {
        findings.push_back(
            fmt::format("{}: <{}> belongs in {} only", where, include.name, wrapped.where));
      }
      break;  // the first that matches is the most special
    }
  });
  return findings;
}

Findings CheckLinks(const std::string& path, std::string_view text) {
  Findings findings;
  const std::string room = RoomOf(path);
  if (room.empty()) return findings;
  for (const std::string& word : CMakeWords(text)) {
    const std::string_view prefix = "unfurl::";
    if (word.starts_with(prefix)) {
      CheckArrow(room, word.substr(prefix.size()), path, &findings);
    }
  }
  return findings;
}

Findings CheckSources(const std::string& path, std::string_view text,
                      const std::vector<std::string>& present) {
  Findings findings;
  std::set<std::string> listed;
  for (const std::string& word : CMakeWords(text)) {
    if (IsSource(word) && word.find('$') == std::string::npos) listed.insert(word);
  }
  const std::set<std::string> there(present.begin(), present.end());
  for (const std::string& file : listed) {
    // A path out of this folder is another folder's matter.
    if (!file.starts_with("../") && !file.starts_with('/') && !there.contains(file)) {
      findings.push_back(fmt::format("{}: lists {}, which does not exist", path, file));
    }
  }
  for (const std::string& file : there) {
    if (IsSource(file) && !listed.contains(file)) {
      findings.push_back(fmt::format("{}: does not list {}, so it is never built", path, file));
    }
  }
  return findings;
}

Findings CheckMachinePaths(const std::string& path, std::string_view text) {
  Findings findings;
  // Split, so that this file does not name them.
  std::vector<std::string> forbidden = {std::string("/wo") + "rk/", std::string("/ro") + "ot/"};
  if (IsDocument(path)) forbidden.push_back(std::string("/t") + "mp/");
  ForEachLine(text, [&](int number, std::string_view line) {
    for (const std::string& name : forbidden) {
      for (std::size_t at = line.find(name); at != std::string_view::npos;
           at = line.find(name, at + 1)) {
        if (at > 0 && IsWordCharacter(line[at - 1])) continue;  // "some/work/" is relative
        findings.push_back(
            fmt::format("{}:{}: names {}, a folder of one machine", path, number, name));
      }
    }
  });
  return findings;
}

Findings CheckSharedFolders(const std::string& path, std::string_view text) {
  Findings findings;
  if (!path.starts_with("tests/") || path.starts_with("tests/structure/")) return findings;
  constexpr std::string_view kName = "temp_directory_path";
  for (std::size_t at = text.find(kName); at != std::string_view::npos;
       at = text.find(kName, at + 1)) {
    const std::string_view statement = text.substr(at, text.find(';', at) - at);
    if (statement.find("getpid") != std::string_view::npos ||
        statement.find("Name()") != std::string_view::npos)
      continue;
    findings.push_back(path + ": a folder that two tests could share; take OwnFolder");
  }
  return findings;
}

Findings CheckOwnNamespace(const std::string& path, std::string_view text) {
  const std::string name = std::filesystem::path(path).stem().string();
  if (!path.starts_with("tests/") || !path.ends_with("_test.cc") ||
      text.find("::" + name + " {\n") != std::string_view::npos) {
    return {};
  }
  return {path + ": put its tests into a namespace that ends in ::" + name};
}

Findings CheckLength(const std::string& path, std::string_view text, bool* is_long) {
  int lines = 0;
  ForEachLine(text, [&](int number, std::string_view) { lines = number; });
  *is_long = lines > kReportedLines;
  if (lines <= kMostLines) return {};
  return {fmt::format("{}: {} lines; split it by concept (at most {})", path, lines, kMostLines)};
}

Findings CheckLineLengths(const std::string& path, std::string_view text) {
  Findings findings;
  if (!IsDocument(path)) return findings;
  ForEachLine(text, [&](int number, std::string_view line) {
    const std::size_t first = line.find_first_not_of(' ');
    if (first == std::string_view::npos || line[first] == '|') return;
    const auto characters = std::ranges::count_if(line, [](char c) {
      return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u;  // not a continuation byte of UTF-8
    });
    if (characters <= kDocumentCharacters || line.find(' ', first) == std::string_view::npos)
      return;
    findings.push_back(fmt::format("{}:{}: {} characters (at most {})", path, number, characters,
                                   kDocumentCharacters));
  });
  return findings;
}

Findings CheckRoots(const std::string& path, std::string_view text) {
  Findings findings;
  ForEachLine(text, [&](int number, std::string_view line) {
    if (line.find("sqrt(std::max(0.0,") == std::string_view::npos) return;
    findings.push_back(fmt::format("{}:{}: std::max(0.0, x) of no number is 0", path, number));
  });
  return findings;
}

Findings CheckConstants(const std::string& path, std::string_view text) {
  Findings findings;
  if (RoomOf(path).empty()) return findings;
  bool shared = false;  // a comment stands above this run of constants
  int first = 0;        // line of the declaration that is being read; 0: none
  Declaration declaration;
  ForEachLine(text, [&](int number, std::string_view line) {
    if (first == 0) {
      const std::size_t begin = line.find_first_not_of(' ');
      const bool is_comment = begin != std::string_view::npos && line.substr(begin, 2) == "//";
      if (is_comment || line.find("constexpr ") == std::string_view::npos) {
        shared = is_comment;
        return;
      }
      first = number;
      declaration = {};
    }
    declaration.Add(line);
    if (!declaration.Ends() && declaration.code.find('{') == std::string::npos) return;
    if (declaration.IsNumber() && !declaration.IsVersion() && !declaration.has_comment && !shared) {
      findings.push_back(
          fmt::format("{}:{}: a number without its reason: say beside it, or above, "
                      "why it is this one, and its unit",
                      path, first));
    }
    shared &= !declaration.has_comment;
    first = 0;
  });
  return findings;
}

Findings CheckHeader(const std::string& path, std::string_view text) {
  if (!path.ends_with(".h") || text.find("#pragma once") != std::string_view::npos) return {};
  return {path + ": a header without #pragma once"};
}

std::vector<std::string> LinksOf(std::string_view text) {
  std::vector<std::string> links;
  for (std::size_t at = text.find("]("); at != std::string_view::npos;
       at = text.find("](", at + 1)) {
    const std::size_t begin = at + 2;
    const std::size_t end = text.find_first_of(") \n", begin);
    if (end == std::string_view::npos || text[end] != ')') continue;
    std::string target(text.substr(begin, end - begin));
    target = target.substr(0, target.find('#'));
    if (!target.empty() && target.find(':') == std::string::npos) links.push_back(target);
  }
  return links;
}

Findings CheckPackages(const std::string& list, std::string_view packages,
                       std::string_view document) {
  Findings findings;
  ForEachLine(packages, [&](int number, std::string_view line) {
    const std::string name(line.substr(0, line.find_first_of("# \t")));
    if (!name.empty() && document.find("`" + name + "`") == std::string_view::npos) {
      findings.push_back(
          fmt::format("{}:{}: {} has no row in docs/dependencies.md", list, number, name));
    }
  });
  return findings;
}

}  // namespace unfurl::structure
