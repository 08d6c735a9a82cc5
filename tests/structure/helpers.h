#pragma once

#include <map>
#include <string>

#include "house.h"

namespace unfurl::structure {

// Functions of unnamed namespaces in two files of a room that have one name and as many parameters,
// all of them the language's or the standard library's: compiled together, a call may take the
// other file's by a conversion, in silence. `files` are a room's sources, text by path.
Findings CheckHelpers(const std::map<std::string, std::string>& files);

}  // namespace unfurl::structure
