#pragma once

#include <filesystem>
#include <string>

namespace unfurl::data {

/// A file that a document names: relative to the document's own folder, unless it is absolute.
inline std::string Beside(const std::string& document, const std::string& file) {
  const std::filesystem::path path(file);
  if (path.is_absolute()) return file;
  return (std::filesystem::path(document).parent_path() / path).lexically_normal().string();
}

}  // namespace unfurl::data
