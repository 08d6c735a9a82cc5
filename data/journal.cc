#include "data/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "base/error.h"
#include "data/atomic_file.h"

namespace unfurl::data {

namespace {

constexpr char kMagic[] = "unfurl journal 1\n";
constexpr std::uint64_t kJournalLongest = std::uint64_t{1} << 32;  // of one record; beyond: torn

struct JournalHead {
  std::uint64_t length = 0;
  std::uint64_t checksum = 0;
};

// Reads until `size` bytes are there, since read() may return fewer; false at the end of the file.
bool ReadAt(int file, std::uint64_t offset, char* out, std::size_t count) {
  while (count > 0) {
    const ssize_t got = pread(file, out, count, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    out += got;
    offset += static_cast<std::uint64_t>(got);
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

void WriteAt(int file, const std::string& path, std::uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t put = pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) ThrowWriteError(path, errno);
    offset += static_cast<std::uint64_t>(put);
    bytes.remove_prefix(static_cast<std::size_t>(put));
  }
}

std::string HeaderOf(const std::string& identity) {
  const std::uint64_t check = Checksum(identity);
  return fmt::format("{}{:016x} {}\n", kMagic, check, identity.size()) + identity;
}

}  // namespace

std::uint64_t Checksum(std::string_view bytes, std::uint64_t seed) {
  std::uint64_t hash = seed;
  for (const char c : bytes) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 1099511628211ull;
  }
  return hash;
}

Journal::Journal(const std::string& result, const std::string& identity, bool resume)
    : path_(result + ".partial") {
  const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
  std::error_code ignored;
  if (!folder.empty() && !std::filesystem::is_directory(folder, ignored)) {
    throw Error(fmt::format("no such folder: {}", folder.string()), result,
                "make it, or name another output with -o");
  }
  file_ = open(path_.c_str(), O_CREAT | O_RDWR | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (file_ < 0) ThrowWriteError(path_, errno);
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  if (fcntl(file_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
    close(file_);
    throw Error("another program is writing it", path_,
                "wait until it has ended, or name another output with -o");
  }
  try {
    Scan(identity, resume);
  } catch (...) {
    close(file_);
    throw;
  }
}

void Journal::Scan(const std::string& identity, bool resume) {
  const std::string header = HeaderOf(identity);
  struct stat info = {};
  fstat(file_, &info);
  const auto size = static_cast<std::uint64_t>(info.st_size);
  std::string there(std::min<std::uint64_t>(size, header.size()), '\0');
  const bool read = ReadAt(file_, 0, there.data(), there.size());
  const std::size_t magic = sizeof kMagic - 1;
  const bool ours = read && there.size() >= magic && there.compare(0, magic, kMagic) == 0;
  const bool same = ours && there == header;
  // A header that is cut short belongs to a program killed as it began.
  const bool begun = size > header.size();
  if (resume && begun && !same) {
    throw Error(ours ? "these evaluations belong to another study, trial, setting or program"
                     : "is not a journal of a fit",
                path_, "resume with the same inputs, or start anew without --resume");
  }
  // Hours of work are not thrown away because an option was forgotten.
  if (!resume && begun && ours) SetAside();
  end_ = header.size();
  if (resume && same) {
    FindRecords(size);
    return;
  }
  if (ftruncate(file_, 0) != 0) ThrowWriteError(path_, errno);
  WriteAt(file_, path_, 0, header);
}

void Journal::SetAside() {
  const std::string aside = path_ + "~", beside = path_ + ".new";
  unlink(beside.c_str());  // of a program that was killed at this very step
  const int fresh = open(beside.c_str(), O_CREAT | O_EXCL | O_NOFOLLOW | O_RDWR | O_CLOEXEC, 0644);
  if (fresh < 0) ThrowWriteError(path_, errno);
  std::rename(path_.c_str(), aside.c_str());
  std::rename(beside.c_str(), path_.c_str());
  close(file_);
  file_ = fresh;
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  fcntl(file_, F_OFD_SETLK, &whole);
}

// The records behind the header, up to the first that is torn; what follows is cut off.
void Journal::FindRecords(std::uint64_t size) {
  std::string payload;
  for (JournalHead head; ReadAt(file_, end_, reinterpret_cast<char*>(&head), sizeof head);) {
    if (head.length > kJournalLongest || end_ + sizeof head + head.length > size) break;
    payload.resize(head.length);
    if (!ReadAt(file_, end_ + sizeof head, payload.data(), payload.size())) break;
    if (Checksum(payload) != head.checksum) break;
    places_.push_back({end_ + sizeof head, head.length});
    end_ += sizeof head + head.length;
  }
  found_ = places_.size();
  if (ftruncate(file_, static_cast<off_t>(end_)) != 0) ThrowWriteError(path_, errno);
}

Journal::~Journal() {
  if (!removed_ && places_.empty()) unlink(path_.c_str());
  if (file_ >= 0) close(file_);
}

std::size_t Journal::size() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return places_.size();
}

std::string Journal::Read(std::size_t index) const {
  Place place;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    place = places_.at(index);
  }
  std::string bytes(place.length, '\0');
  if (!ReadAt(file_, place.offset, bytes.data(), bytes.size())) {
    throw Error("cannot read back what was written", path_, "check the disk", ErrorKind::kMachine);
  }
  return bytes;
}

std::size_t Journal::Append(std::string_view bytes) {
  const JournalHead head{bytes.size(), Checksum(bytes)};
  std::string record(reinterpret_cast<const char*>(&head), sizeof head);
  record += bytes;
  const std::lock_guard<std::mutex> lock(mutex_);
  WriteAt(file_, path_, end_, record);
  places_.push_back({end_ + sizeof head, bytes.size()});
  end_ += record.size();
  return places_.size() - 1;
}

void Journal::Remove() {
  unlink(path_.c_str());
  removed_ = true;
}

}  // namespace unfurl::data
