#include "data/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "base/error.h"

namespace unfurl::data {

namespace {

std::string Folder(const std::string& path) {
  const std::string parent = std::filesystem::path(path).parent_path().string();
  return parent.empty() ? "." : parent;
}

bool SyncPath(const std::string& path, int flags) {
  const int fd = open(path.c_str(), flags);
  if (fd < 0) return false;
  const bool good = fsync(fd) == 0 || errno == EINVAL;  // not every file system can
  close(fd);
  return good;
}

}  // namespace

void ThrowWriteError(const std::string& path, int error_number) {
  std::string remedy = "check the folder and try again";
  if (error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG) {
    remedy = "free some space, or name another place with -o";
  } else if (error_number == EACCES || error_number == EPERM || error_number == EROFS) {
    remedy = "name a place you may write to with -o";
  }
  throw Error(fmt::format("cannot write: {}", std::strerror(error_number)), path, remedy,
              ErrorKind::kMachine);
}

AtomicFile::AtomicFile(std::string path) : path_(std::move(path)) {
  const std::string folder = Folder(path_);
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) {
    throw Error(fmt::format("no such folder: {}", folder), path_,
                "make it, or name another output with -o");
  }
  if (std::filesystem::is_directory(path_, ignored)) {
    throw Error("is a folder, not a file", path_, "name a file with -o");
  }
  if (std::filesystem::exists(path_, ignored) &&
      !std::filesystem::is_regular_file(path_, ignored)) {
    // A rename would replace the device or pipe by a file.
    throw Error("is a device or pipe, not a file", path_, "name a file with -o");
  }
  const std::string name = std::filesystem::path(path_).filename().string();
  temporary_ = fmt::format("{}/.{}.{}.tmp", folder, name, getpid());
  const int fd = open(temporary_.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0644);
  if (fd < 0) ThrowWriteError(path_, errno);
  close(fd);
}

AtomicFile::~AtomicFile() {
  if (!committed_) std::remove(temporary_.c_str());
}

void AtomicFile::Commit() {
  if (!SyncPath(temporary_, O_RDONLY)) ThrowWriteError(path_, errno);
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) ThrowWriteError(path_, errno);
  committed_ = true;
  SyncPath(Folder(path_), O_RDONLY | O_DIRECTORY);  // best effort: the content is safe already
}

void WriteTextFile(const std::string& path, const std::string& text) {
  AtomicFile file(path);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(
      std::fopen(file.temporary().c_str(), "wb"),
      [](std::FILE* f) { return f ? std::fclose(f) : 0; });
  if (!stream) ThrowWriteError(path, errno);
  if (std::fwrite(text.data(), 1, text.size(), stream.get()) != text.size() ||
      std::fflush(stream.get()) != 0) {
    ThrowWriteError(path, errno);
  }
  file.Commit();
}

std::string ReadTextFile(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw Error("is a folder, not a file", path, "name a file");
  }
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(
      std::fopen(path.c_str(), "rb"), [](std::FILE* f) { return f ? std::fclose(f) : 0; });
  if (!stream) {
    const bool refused = errno == EACCES;
    throw Error(fmt::format("cannot read: {}", std::strerror(errno)), path,
                refused ? "ask for permission to read it" : "check the name",
                refused ? ErrorKind::kMachine : ErrorKind::kBadInput);
  }
  std::string text;
  char buffer[1 << 16];
  std::size_t got;
  while ((got = std::fread(buffer, 1, sizeof buffer, stream.get())) > 0) text.append(buffer, got);
  return text;
}

}  // namespace unfurl::data
