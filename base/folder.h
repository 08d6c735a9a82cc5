#pragma once

#include <string>
#include <vector>

namespace unfurl {

// Names of all that lies in a folder, hidden ones included, in no order; none where it cannot be
// read. The standard library's iterator ends the program when memory runs out in it.
std::vector<std::string> NamesIn(const std::string& folder);

// Paths of the files that are named like `path`, whose last part holds one '*' for any letters;
// sorted.
std::vector<std::string> FilesLike(const std::string& path);

}  // namespace unfurl
