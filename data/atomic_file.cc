#include "data/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <memory>
#include <random>
#include <utility>

#include "base/error.h"
#include "base/folder.h"
#include "base/progress.h"
#include "base/signals.h"
#include "data/inputs.h"

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
    remedy = "name a place you may write to";
  }
  throw Error(fmt::format("cannot write: {}", std::strerror(error_number)), path, remedy,
              ErrorKind::kMachine);
}

namespace {

constexpr std::size_t kHiddenLetters = 6;  // chosen at random: 36^6 names for one folder

// Locks the open file, not the process; HDF5's own lock (flock) is of another kind. False when
// another program holds it; a file system without locks counts as locked.
bool Lock(int fd) {
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  return fcntl(fd, F_OFD_SETLK, &whole) == 0 || (errno != EAGAIN && errno != EACCES);
}

// Whether `name` is a hidden temporary of `result`: ".result.a1b2c3.tmp".
bool IsTemporaryOf(const std::string& name, const std::string& result) {
  const std::string head = "." + result + ".", tail = ".tmp";
  return name.size() == head.size() + kHiddenLetters + tail.size() && name.starts_with(head) &&
         name.ends_with(tail);
}

// Where the program's own open files, and devices, have their names.
bool IsDeviceFolder(const std::string& folder) {
  std::error_code failed;
  const std::string whole = std::filesystem::canonical(folder, failed).string();
  return whole == "/dev" || whole == "/proc" || whole.starts_with("/proc/");
}

void RefuseInput(const std::string& path) {
  if (!IsInput(path)) return;
  throw Error("is an input, and would be replaced by the result", path, "name another output");
}

// Programs that were killed leave their temporaries behind: unlocked, and not just made.
void RemoveStale(const std::string& folder, const std::string& result) {
  constexpr std::time_t kYoung = 10;  // [s], between making and locking
  for (const std::string& name : NamesIn(folder)) {
    const std::string path = (std::filesystem::path(folder) / name).string();
    if (!IsTemporaryOf(name, result) || IsInput(path)) continue;
    const int fd = open(path.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC);
    if (fd < 0) continue;
    struct stat info = {};
    if (fstat(fd, &info) == 0 && S_ISREG(info.st_mode) &&
        std::time(nullptr) - info.st_mtime > kYoung && Lock(fd)) {
      unlink(path.c_str());
    }
    close(fd);
  }
}

// A name of its own beside the result.
std::string HiddenName(const std::string& folder, const std::string& name) {
  static constexpr char kLetters[] = "abcdefghijklmnopqrstuvwxyz0123456789";
  std::random_device source;
  std::string letters(kHiddenLetters, '\0');
  for (char& c : letters) c = kLetters[source() % (sizeof kLetters - 1)];
  return fmt::format("{}/.{}.{}.tmp", folder, name, letters);
}

}  // namespace

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
  if (IsDeviceFolder(folder)) {  // /dev/stdout may lead to a file
    throw Error("is a device or pipe, not a file", path_, "name a file with -o");
  }
  RefuseInput(path_);
  if (kind == Temporary::kPartial) {
    OpenPartial();
  } else {
    OpenHidden(folder);
  }
}

// The earlier partial of the same name is begun anew; no link is followed.
void AtomicFile::OpenPartial() {
  temporary_ = path_ + ".partial";
  lock_ = open(temporary_.c_str(), O_CREAT | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (lock_ < 0 && errno == ELOOP) {
    throw Error("is a link, which is not followed", temporary_, "remove it");
  }
  if (lock_ < 0) ThrowWriteError(path_, errno);
  if (!Lock(lock_)) {
    close(std::exchange(lock_, -1));
    throw Error("another program is writing it", temporary_,
                "wait until it has ended, or name another output with -o");
  }
  if (ftruncate(lock_, 0) != 0) {
    const int error = errno;
    close(std::exchange(lock_, -1));
    ThrowWriteError(path_, error);
  }
}

void AtomicFile::OpenHidden(const std::string& folder) {
  const std::string name = std::filesystem::path(path_).filename().string();
  RemoveStale(folder, name);
  do {
    temporary_ = HiddenName(folder, name);
    lock_ = open(temporary_.c_str(), O_CREAT | O_EXCL | O_NOFOLLOW | O_WRONLY | O_CLOEXEC, 0644);
  } while (lock_ < 0 && errno == EEXIST);
  if (lock_ < 0) ThrowWriteError(path_, errno);
  noted_ = NoteTemporary(temporary_);
  Lock(lock_);
}

AtomicFile::~AtomicFile() {
  if (!settled_) std::remove(temporary_.c_str());
  ForgetTemporary(noted_);
  if (lock_ >= 0) close(lock_);
}

void AtomicFile::Commit() {
  ThrowIfInterrupted();
  RefuseInput(path_);
  if (!SyncPath(temporary_, O_RDONLY)) ThrowWriteError(path_, errno);
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) ThrowWriteError(path_, errno);
  settled_ = true;
  ForgetInput(path_);
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
  constexpr std::size_t kMostText = std::size_t{1} << 32;
  std::string text;
  if (RecallPipe(path, &text)) return text;  // a pipe gives what it holds once
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
  char buffer[1 << 16];
  std::size_t got;
  while ((got = std::fread(buffer, 1, sizeof buffer, stream.get())) > 0) {
    // A device without an end would take all memory, and a system that lends more than it has then
    // kills programs.
    if (text.size() + got > kMostText) {
      throw Error("more than 4 GB of text", path, "name a file of text, or cut it into several");
    }
    text.append(buffer, got);
  }
  if (std::ferror(stream.get()) != 0) {
    throw Error(fmt::format("cannot read: {}", std::strerror(errno)), path,
                "check the disk, and copy the file again", ErrorKind::kMachine);
  }
  NoteText(path, text, std::filesystem::is_regular_file(path, ignored));
  return text;
}

}  // namespace unfurl::data
