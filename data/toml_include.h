#pragma once

#include <toml++/toml.h>

#include <map>
#include <string>
#include <vector>

namespace unfurl::data {

class TextFiles;

inline constexpr char kIncludeKey[] = "include";

// Throws Error at line and column.
toml::table ParseTomlDocument(const std::string& text, const std::string& name);

// Merges the files that `document`, read from `path`, names under its key `include` below it, and
// so on from file to file. Adds their names to `files`, and to `order` where each named table
// ("body.hub") is first mentioned, as if the text of the included files stood at the top.
// `texts` null: from disk.
void MergeIncludes(toml::table* document, const std::string& path, std::vector<std::string>* files,
                   std::map<std::string, int>* order, TextFiles* texts);

}  // namespace unfurl::data
