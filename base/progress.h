#pragma once

#include <atomic>
#include <chrono>
#include <string>

namespace unfurl {

// Ctrl-C and SIGTERM set a flag that long work polls; the work then stops cleanly by throwing
// Interrupted, and its destructors remove what is half written.
void InstallInterruptHandler();
bool InterruptRequested();
/// The same flag, for a program that handles signals itself, such as an interpreter: sets it (also
/// from a signal handler), and takes it back when the work has stopped.
void RequestInterrupt();
void ClearInterrupt();
void ThrowIfInterrupted();

// A line on the terminal with what is done and an estimate of what is left. Silent in a pipe and
// where `enabled` is false. Safe to call from several threads.
class Progress {
 public:
  // `label` stands at the start of the line.
  Progress(std::string label, bool enabled);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `fraction` of what is expected, more than 1 where it takes longer; `note` such as "best so far
  // 1.03". Throws Interrupted after Ctrl-C.
  void Update(double fraction, const std::string& note = {});

 private:
  std::string label_;
  bool on_terminal_;
  std::chrono::steady_clock::time_point start_;
  std::atomic<std::int64_t> last_ms_{-1000};
  std::atomic<bool> drawn_{false};
};

// "fit  40 %  12 s, 18 s left  best so far 1.03"; before anything is done, and where it takes
// longer than expected, nobody knows what is left. `elapsed`: [s].
std::string ProgressLine(const std::string& label, double fraction, double elapsed,
                         const std::string& note);

}  // namespace unfurl
