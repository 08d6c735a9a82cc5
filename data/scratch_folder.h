#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace unfurl::data {

/// A folder among the machine's temporary files, gone with all in it when its user is done. What
/// killed programs left behind there is removed by the next one of the same head.
class ScratchFolder {
 public:
  /// `head` such as "unfurl-evaluation-": the folder's name but for six letters. Throws
  /// Error(kMachine) where it cannot be made.
  explicit ScratchFolder(const std::string& head);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  /// Path of a file in it.
  std::string File(const std::string& name) const { return (path_ / name).string(); }
  /// Its own path.
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
  int lock_ = -1;  // descriptor
};

/// A file that need not outlive the program: as it comes, not synced. Throws Error(kMachine).
void WritePlain(const std::string& path, const std::string& text);

/// The last line of a text file that is not blank, cut to 200 characters; empty: there is none.
std::string LastLineOf(const std::string& path);

/// Each `from` in the text, from left to right.
void ReplaceAll(std::string* text, const std::string& from, const std::string& to);

}  // namespace unfurl::data
