#include "data/scratch_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <mutex>
#include <set>

#include "base/folder.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/inputs.h"

namespace unfurl::data {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLetters = 6;          // that mkdtemp() chooses
constexpr char kOurs[] = ".made-by-unfurl";  // lies in each, so that no folder of others is removed

// Holds a folder as long as it is open, and the program lives.
int LockFolder(const fs::path& path) {
  const int folder = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (folder >= 0 && flock(folder, LOCK_EX | LOCK_NB) != 0) {
    close(folder);
    return -1;
  }
  return folder;
}

// Programs that were killed leave their folders behind: our own, unlocked, and not just made.
void RemoveStaleFolders(const fs::path& where, const std::string& head) {
  constexpr std::time_t kYoung = 10;  // [s], between making and locking
  std::error_code failed;
  for (const std::string& name : NamesIn(where.string())) {
    if (!name.starts_with(head) || name.size() != head.size() + kLetters) continue;
    const fs::path scratch = where / name;
    const int folder = LockFolder(scratch);
    if (folder < 0) continue;
    struct stat info = {};
    const bool ours = fs::exists(scratch / kOurs, failed) || fs::is_empty(scratch, failed);
    if (ours && fstat(folder, &info) == 0 && info.st_uid == geteuid() &&
        std::time(nullptr) - info.st_mtime > kYoung) {
      fs::remove_all(scratch, failed);
    }
    close(folder);
  }
}

// Once for each head.
void CleanOnce(const fs::path& where, const std::string& head) {
  static std::mutex mutex;
  static std::set<std::string> done;
  const std::lock_guard<std::mutex> lock(mutex);
  if (done.insert(head).second) RemoveStaleFolders(where, head);
}

// What was read here goes, and its inode may be the next one of a result, which is no input. A link
// to a file of the user's stays one.
void ForgetFilesIn(const fs::path& folder) {
  std::error_code failed, unknown;
  const fs::recursive_directory_iterator end;
  for (fs::recursive_directory_iterator at(folder, failed); !failed && at != end;
       at.increment(failed)) {
    const bool own = fs::is_regular_file(at->symlink_status(unknown)) &&
                     fs::hard_link_count(at->path(), unknown) == 1;
    if (own) ForgetInput(at->path().string());
  }
}

}  // namespace

ScratchFolder::ScratchFolder(const std::string& head) {
  const fs::path where = fs::temp_directory_path();
  CleanOnce(where, head);
  std::string name = (where / head).string() + std::string(kLetters, 'X');
  if (mkdtemp(name.data()) == nullptr) ThrowWriteError(name, errno);
  path_ = name;
  lock_ = LockFolder(path_);
  WritePlain(File(kOurs), "");
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  ForgetFilesIn(path_);
  fs::remove_all(path_, ignored);
  if (lock_ >= 0) close(lock_);
}

void WritePlain(const std::string& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) ThrowWriteError(path, errno);
}

std::string LastLineOf(const std::string& path) {
  std::ifstream stream(path);
  std::string line, last;
  while (std::getline(stream, line)) {
    if (!Trim(line).empty()) last = std::string(Trim(line));
  }
  constexpr std::size_t kLongest = 200;  // characters: a message stays a line or two
  return last.substr(0, kLongest);
}

void ReplaceAll(std::string* text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text->find(from, at)) != std::string::npos; at += to.size()) {
    text->replace(at, from.size(), to);
  }
}

}  // namespace unfurl::data
