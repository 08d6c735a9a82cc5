#include "data/beside.h"

#include <fmt/format.h>

#include <filesystem>

#include "base/error.h"

namespace unfurl::data {

namespace fs = std::filesystem;

std::string Beside(const std::string& document, const std::string& file) {
  const fs::path path(file);
  if (path.is_absolute()) return file;
  return (fs::path(document).parent_path() / path).lexically_normal().string();
}

std::string FileBeside(const TomlTable& table, std::string_view key, const std::string& document) {
  std::string path = Beside(document, table.String(key));
  RequireFile(path, table.Where(key));
  return path;
}

void RequireFile(const std::string& path, const std::string& where) {
  std::error_code failed;
  if (fs::exists(path, failed) && !fs::is_directory(path, failed)) return;
  throw Error(fmt::format("there is no file '{}'", path), where,
              "check the name; it starts at the folder of the document that names it");
}

}  // namespace unfurl::data
