#pragma once

#include <string>

namespace unfurl::data {

// A result is one file, written beside its name and renamed when whole: a killed program leaves the
// old file or none, never half of one. The destructor removes what was not committed.
class AtomicFile {
 public:
  // Throws Error when the folder does not exist or cannot be written to.
  explicit AtomicFile(std::string path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::string& path() const { return path_; }
  const std::string& temporary() const { return temporary_; }

  // Syncs the temporary file to disk and gives it its name; throws Error(kMachine) on failure.
  void Commit();

 private:
  std::string path_;
  std::string temporary_;
  bool committed_ = false;
};

// The whole of `text` as the file `path`, by way of AtomicFile.
void WriteTextFile(const std::string& path, const std::string& text);
// The whole file; throws Error when it cannot be read.
std::string ReadTextFile(const std::string& path);

// Error(kMachine) for a failed write to `path`, in the words of errno.
[[noreturn]] void ThrowWriteError(const std::string& path, int error_number);

}  // namespace unfurl::data
