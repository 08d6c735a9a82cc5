#pragma once

namespace unfurl {

/// While it lives, a crash on this thread is put down to damage of the file that a library of
/// others is reading here: the program ends with one line that names it, and exit code 2. A crash
/// anywhere else is an internal error, and says so. For programs that called
/// InstallInterruptHandler.
class ReadsForeign {
 public:
  /// `path` must outlive it.
  explicit ReadsForeign(const char* path);
  ~ReadsForeign();
  ReadsForeign(const ReadsForeign&) = delete;
  ReadsForeign& operator=(const ReadsForeign&) = delete;

 private:
  const char* before_;
};

}  // namespace unfurl
