#pragma once

#include <toml++/toml.h>

#include <map>
#include <string>

namespace unfurl::data {

// A document as TOML, without its comments, its keys and tables in the order in which they stand
// in their files: a reader may go by it (cameras of a laboratory). `order`: of "group.NAME" where
// several files were merged; what stands nowhere comes last.
std::string TomlText(const toml::table& root, const std::map<std::string, int>& order = {});

}  // namespace unfurl::data
