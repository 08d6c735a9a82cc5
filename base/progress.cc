#include "base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace unfurl {

Progress::Progress(std::string label, bool enabled)
    : label_(std::move(label)),
      on_terminal_(enabled && isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (drawn_) std::fputs("\r\033[K", stderr);
}

void Progress::Update(double fraction, const std::string& note) {
  ThrowIfInterrupted();
  if (!on_terminal_) return;
  const double elapsed =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const auto now_ms = static_cast<std::int64_t>(1e3 * elapsed);
  std::int64_t last = last_ms_.load();
  if (now_ms - last < 200 || !last_ms_.compare_exchange_strong(last, now_ms)) return;
  drawn_ = true;
  const double left = fraction > 0.0 ? elapsed * (1.0 - fraction) / fraction : 0.0;
  const std::string line = fmt::format("\r\033[K{} {:3.0f} %  {:.0f} s, {:.0f} s left  {}", label_,
                                       100.0 * fraction, elapsed, left, note);
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace unfurl
