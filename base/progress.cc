#include "base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
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
  std::fputs(("\r\033[K" + ProgressLine(label_, fraction, elapsed, note)).c_str(), stderr);
  std::fflush(stderr);
}

std::string ProgressLine(const std::string& label, double fraction, double elapsed,
                         const std::string& note) {
  constexpr double kMost = 0.99;  // all of it is when it ends
  std::string left;
  if (fraction > 1.0) {
    left = ", longer than expected";
  } else if (fraction > 0.0) {
    left = fmt::format(", {:.0f} s left", elapsed * (1.0 - fraction) / fraction);
  }
  return fmt::format("{} {:3.0f} %  {:.0f} s{}  {}", label,
                     100.0 * std::clamp(fraction, 0.0, kMost), elapsed, left, note);
}

}  // namespace unfurl
