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
#include <utility>

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

AtomicFile::AtomicFile(std::string path, Temporary kind) : path_(std::move(path)) {
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
  const bool partial = kind == Temporary::kPartial;
  temporary_ = partial ? path_ + ".partial" : fmt::format("{}/.{}.{}.tmp", folder, name, getpid());
  const int fd = open(temporary_.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0644);
  if (fd < 0) ThrowWriteError(path_, errno);
  if (partial) {
    lock_ = fd;
    // A lock of the open file, not of the process; HDF5's own (flock) is another kind.
    struct flock whole = {};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    if (fcntl(fd, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
      close(fd);
      throw Error("another program is writing it", temporary_,
                  "wait until it has ended, or name another output with -o");
    }
  }
  if (ftruncate(fd, 0) != 0) ThrowWriteError(path_, errno);
  if (!partial) close(fd);
}

AtomicFile::~AtomicFile() {
  if (!settled_) std::remove(temporary_.c_str());
  if (lock_ >= 0) close(lock_);
}

void AtomicFile::Commit() {
  if (!SyncPath(temporary_, O_RDONLY)) ThrowWriteError(path_, errno);
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) ThrowWriteError(path_, errno);
  settled_ = true;
  SyncPath(Folder(path_), O_RDONLY | O_DIRECTORY);  // best effort: the content is safe already
}

TextFileWriter::TextFileWriter(const std::string& path) : file_(path) {
  stream_ = std::fopen(file_.temporary().c_str(), "wb");
  if (stream_ == nullptr) ThrowWriteError(path, errno);
}

TextFileWriter::~TextFileWriter() {
  if (stream_ != nullptr) std::fclose(stream_);
}

void TextFileWriter::Append(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stream_) != text.size()) {
    ThrowWriteError(file_.path(), errno);
  }
}

void TextFileWriter::Commit() {
  std::FILE* stream = std::exchange(stream_, nullptr);
  const bool flushed = std::fflush(stream) == 0;
  const int error = errno;
  if (std::fclose(stream) != 0 || !flushed) ThrowWriteError(file_.path(), flushed ? errno : error);
  file_.Commit();
}

void WriteTextFile(const std::string& path, const std::string& text) {
  TextFileWriter file(path);
  file.Append(text);
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
