#pragma once

#include <string>
#include <vector>

namespace unfurl::data {

// A file that a TOML document depends on.
struct NamedFile {
  std::string path;   // as it can be opened
  std::string where;  // the document that names it
};

// Every regular file that any string in the TOML document `path` names, relative to the document's
// folder or absolute, a '*' in the last part standing for anything; and so on in each TOML document
// among them. Whatever kind of document it is: so no reader's keys need to be known here. Too many
// rather than too few: a string may name a file by chance. Empty where `path` is no regular file
// ending in .toml or cannot be parsed; its reader will say so.
std::vector<NamedFile> FilesNamedIn(const std::string& path);

// The files that the words of "key=value" name, relative to any of `folders`, and those that they
// name in turn.
std::vector<NamedFile> FilesNamedBy(const std::string& assignment,
                                    const std::vector<std::string>& folders);

}  // namespace unfurl::data
