#pragma once

#include <string>
#include <string_view>

#include "data/toml.h"

namespace unfurl::data {

/// A file that a document names: relative to the document's own folder, unless it is absolute.
std::string Beside(const std::string& document, const std::string& file);

/// The file that `key` of a document's table names, as Beside has it. Throws Error at the key where
/// nothing of this name is there.
std::string FileBeside(const TomlTable& table, std::string_view key, const std::string& document);
/// Throws Error at `where` (file:line:key) where nothing of this name is there: for documents that
/// are read before it is known whether the file is wanted.
void RequireFile(const std::string& path, const std::string& where);

}  // namespace unfurl::data
