#pragma once

#include <cstdio>
#include <string>

namespace unfurl::data {

// A result is one file, written beside its name and renamed when whole: a killed program leaves the
// old file or none, never half of one. The destructor removes what was not committed or kept.
class AtomicFile {
 public:
  enum class Temporary {
    kHidden,   // a new name beside it; those that killed programs left behind are removed
    kPartial,  // NAME.partial, for long work whose results so far are worth keeping; locked
  };
  // Throws Error when the folder does not exist or cannot be written to, or when another program is
  // writing the same NAME.partial.
  explicit AtomicFile(std::string path, Temporary kind = Temporary::kHidden);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::string& path() const { return path_; }
  const std::string& temporary() const { return temporary_; }

  // Syncs the temporary file to disk and gives it its name; throws Error(kMachine) on failure.
  void Commit();
  // The temporary file is to stay under its own name, whatever comes.
  void Keep() { settled_ = true; }

 private:
  std::string path_;
  std::string temporary_;
  void OpenPartial();
  void OpenHidden(const std::string& folder);

  int lock_ = -1;   // descriptor that holds the temporary's lock
  int noted_ = -1;  // place in base/signals.h's list
  bool settled_ = false;
};

// A text file that grows piece by piece and appears whole.
class TextFileWriter {
 public:
  explicit TextFileWriter(const std::string& path);
  ~TextFileWriter();
  void Append(const std::string& text);
  void Commit();

 private:
  AtomicFile file_;
  std::FILE* stream_ = nullptr;
};

// The whole of `text` as the file `path`, by way of AtomicFile.
void WriteTextFile(const std::string& path, const std::string& text);
// The whole file; throws Error when it cannot be read.
std::string ReadTextFile(const std::string& path);

// Error(kMachine) for a failed write to `path`, in the words of errno.
[[noreturn]] void ThrowWriteError(const std::string& path, int error_number);

}  // namespace unfurl::data
