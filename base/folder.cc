#include "base/folder.h"

#include <dirent.h>

#include <algorithm>
#include <filesystem>
#include <memory>

namespace unfurl {

std::vector<std::string> NamesIn(const std::string& folder) {
  std::vector<std::string> names;
  const std::unique_ptr<DIR, int (*)(DIR*)> stream(
      opendir(folder.c_str()), [](DIR* d) { return d != nullptr ? closedir(d) : 0; });
  if (!stream) return names;
  while (const dirent* entry = readdir(stream.get())) {
    const std::string name = entry->d_name;
    if (name != "." && name != "..") names.push_back(name);
  }
  return names;
}

std::vector<std::string> FilesLike(const std::string& path) {
  const std::filesystem::path whole(path);
  const std::filesystem::path folder = whole.has_parent_path() ? whole.parent_path() : ".";
  const std::string last = whole.filename().string();
  const std::size_t star = last.find('*');
  const std::string before = last.substr(0, star);
  const std::string after = star == std::string::npos ? "" : last.substr(star + 1);
  std::vector<std::string> files;
  for (const std::string& name : NamesIn(folder.string())) {
    std::error_code failed;
    if (name.size() >= before.size() + after.size() && name.starts_with(before) &&
        name.ends_with(after) && std::filesystem::is_regular_file(folder / name, failed)) {
      files.push_back((folder / name).string());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace unfurl
