#include "base/signals.h"

#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>

#include "base/conclusion.h"
#include "base/crash.h"
#include "base/error.h"
#include "base/progress.h"

#if defined(__has_feature)
#define UNFURL_CLANG_SANITIZES (__has_feature(address_sanitizer) || __has_feature(thread_sanitizer))
#else
#define UNFURL_CLANG_SANITIZES 0
#endif

namespace unfurl {

namespace {

constexpr int kGrace = 700000;  // [us] for work to stop by itself
// Unfinished files that the handler can remove: one for each file that the process writes at a
// time. Those beyond stay behind when a signal ends it.
constexpr std::size_t kPlaces = 64;

volatile sig_atomic_t g_signal = 0;
std::atomic<int> g_conclusions = 0;
// Read by the handler. A path is never freed: the handler may be reading it.
std::array<std::atomic<const char*>, kPlaces> g_temporaries{};

void RemoveTemporaries() {
  for (const auto& place : g_temporaries) {
    if (const char* path = place.load()) unlink(path);
  }
}

// Only what may be called from a handler.
[[noreturn]] void EndNow() {
  RemoveTemporaries();
  constexpr char kWords[] = "unfurl: interrupted; nothing was written\n";
  if (write(STDERR_FILENO, kWords, sizeof kWords - 1) < 0) _exit(InterruptExitCode());
  _exit(InterruptExitCode());
}

void OnSignal(int number) {
  if (g_signal != 0) EndNow();
  g_signal = number;
  const itimerval grace = {{0, 0}, {0, kGrace}};
  setitimer(ITIMER_REAL, &grace, nullptr);
}

void OnAlarm(int) {
  if (g_signal != 0) EndNow();
}

// Memory may run out where nothing can be thrown: in a destructor of a library (that of a JSON
// value allocates), or in a thread of one; and a library may be left with half a value, which its
// destructor breaks on. That is the machine's refusal, too.
std::atomic<bool> g_memory_refused{false};

void OnMemoryRefused() {
  g_memory_refused = true;
  throw std::bad_alloc();
}

// Only what may be called from a handler.
[[noreturn]] void EndWithoutMemory() {
  RemoveTemporaries();
  constexpr char kWords[] = "unfurl: the machine has not enough memory for this\n";
  if (write(STDERR_FILENO, kWords, sizeof kWords - 1) < 0) _exit(kExitMachine);
  _exit(kExitMachine);
}

[[noreturn]] void OnTerminate() {
  if (g_memory_refused) EndWithoutMemory();
  std::abort();
}

thread_local const char* t_reading = nullptr;

// Only what may be called from a handler. Controls in a name are shown as '?'.
void WriteWords(const char* words, bool of_a_file = false) {
  constexpr std::size_t kLongest = 4096;  // bytes of a line, as PATH_MAX: the rest is cut off
  char line[kLongest];
  std::size_t n = 0;
  for (; words[n] != '\0' && n < kLongest; ++n) {
    const auto byte = static_cast<unsigned char>(words[n]);
    line[n] = of_a_file && (byte < 0x20 || byte >= 0x7f) ? '?' : words[n];
  }
  if (write(STDERR_FILENO, line, n) < 0) return;
}

[[maybe_unused]] void OnCrash(int) {
  if (g_memory_refused) EndWithoutMemory();
  RemoveTemporaries();
  WriteWords("unfurl: ");
  if (const char* path = t_reading) {
    WriteWords(path, true);
    WriteWords(
        ": is damaged: the library that reads it broke off; copy it again, or make it again\n");
    _exit(kExitBadInput);
  }
  WriteWords(
      "internal error: the program crashed; please report it with the command that you typed\n");
  _exit(kExitFault);
}

// On a stack of its own, for the one that has run out.
void InstallCrashHandler() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !UNFURL_CLANG_SANITIZES
  static char stack[1 << 16];
  stack_t own = {};
  own.ss_sp = stack;
  own.ss_size = sizeof stack;
  sigaltstack(&own, nullptr);
  struct sigaction action = {};
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_ONSTACK | SA_RESETHAND);
  action.sa_handler = OnCrash;
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) {
    sigaction(number, &action, nullptr);
  }
#endif
}

// The length of the UTF-8 sequence that begins `bytes`, or 0 where there is none.
std::size_t SequenceAt(const std::string& bytes, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return i < bytes.size() ? static_cast<unsigned char>(bytes[i]) : 0U;
  };
  const unsigned first = byte(at);
  const std::size_t length = first < 0x80                    ? 1
                             : first >= 0xc2 && first < 0xe0 ? 2
                             : first >= 0xe0 && first < 0xf0 ? 3
                             : first >= 0xf0 && first < 0xf5 ? 4
                                                             : 0;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(at + k) & 0xc0U) != 0x80U) return 0;
  }
  return length;
}

// Controls of ASCII and of Latin 1, and those that turn the direction of text.
bool IsControl(const std::string& bytes, std::size_t at, std::size_t length) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(bytes[at + k]); };
  if (length == 1) return byte(0) < 0x20 || byte(0) == 0x7f;
  if (length == 2) return byte(0) == 0xc2 && byte(1) < 0xa0;
  if (length != 3 || byte(0) != 0xe2) return false;
  return (byte(1) == 0x80 && byte(2) >= 0xa8 && byte(2) <= 0xae) ||
         (byte(1) == 0x81 && byte(2) >= 0xa6 && byte(2) <= 0xa9);
}

void AppendEscaped(unsigned char byte, std::string* out) {
  char text[5];
  std::snprintf(text, sizeof text, "\\x%02x", byte);
  *out += text;
}

}  // namespace

ReadsForeign::ReadsForeign(const char* path) : before_(t_reading) { t_reading = path; }

ReadsForeign::~ReadsForeign() { t_reading = before_; }

void InstallInterruptHandler() {
  std::set_new_handler(OnMemoryRefused);
  std::set_terminate(OnTerminate);
  InstallCrashHandler();
  struct sigaction action = {};
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;  // a read that was broken off would look like the end of a file
  action.sa_handler = OnSignal;
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before = {};
    sigaction(number, nullptr, &before);
    const bool asked_to_stay = number == SIGHUP && before.sa_handler == SIG_IGN;  // nohup
    if (!asked_to_stay) sigaction(number, &action, nullptr);
  }
  action.sa_handler = OnAlarm;
  sigaction(SIGALRM, &action, nullptr);
  struct sigaction plain = {};
  sigemptyset(&plain.sa_mask);
  plain.sa_handler = SIG_IGN;
  sigaction(SIGXFSZ, &plain, nullptr);  // a file-size limit is then an ordinary write error
  plain.sa_handler = SIG_DFL;
  sigaction(SIGPIPE, &plain, nullptr);  // the reader of a pipe has left: end, and say nothing
}

void RequestInterrupt() { g_signal = SIGINT; }

void ClearInterrupt() { g_signal = 0; }

bool InterruptRequested() { return g_signal != 0 && g_conclusions == 0; }

Conclusion::Conclusion() { ++g_conclusions; }
Conclusion::~Conclusion() { --g_conclusions; }

void ThrowIfInterrupted() {
  if (InterruptRequested()) throw Interrupted();
}

int InterruptExitCode() {
  return g_signal == SIGTERM || g_signal == SIGHUP ? 128 + SIGTERM : 128 + SIGINT;
}

int NoteTemporary(const std::string& path) {
  char* copy = strdup(path.c_str());
  if (copy == nullptr) return -1;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const char* none = nullptr;
    if (g_temporaries[i].compare_exchange_strong(none, copy)) return static_cast<int>(i);
  }
  return -1;
}

void ForgetTemporary(int place) {
  if (place >= 0) g_temporaries[static_cast<std::size_t>(place)].store(nullptr);
}

std::string Printable(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = SequenceAt(text, at);
    const bool shown = text[at] == '\n' || text[at] == '\t';
    if (length > 0 && (shown || !IsControl(text, at, length))) {
      out.append(text, at, length);
      at += length;
      continue;
    }
    for (const std::size_t end = at + std::max<std::size_t>(length, 1); at < end; ++at) {
      AppendEscaped(static_cast<unsigned char>(text[at]), &out);
    }
  }
  return out;
}

void Complain(const std::string& text) {
  std::string line;
  for (const char c : Printable(text)) line += c == '\n' ? "\\n" : std::string(1, c);
  std::fprintf(stderr, "unfurl: %s\n", line.c_str());
}

}  // namespace unfurl
