#include <algorithm>
#include <cmath>
#include <utility>

#include "measure/health.h"

namespace unfurl::measure {

namespace {

// Lines that are kept of a record at most: 60 s of a usual one, at 90 bytes a line of four cameras.
constexpr std::size_t kMostLines = 1U << 16;
constexpr std::size_t kStretch = 256;  // lines that are kept or left out together

}  // namespace

HealthEvidence::HealthEvidence(std::size_t cameras, std::size_t lines)
    : cameras_(cameras), every_((lines + kMostLines - 1) / kMostLines) {
  every_ = std::max<std::size_t>(1, every_);
}

HealthEvidence HealthEvidence::OfLast(std::size_t cameras, std::size_t lines) {
  HealthEvidence out(cameras, 0);
  out.last_ = lines;
  return out;
}

void HealthEvidence::Add(double t, int mark, std::span<const Reading> readings) {
  if (last_ > 0 && size() == 2 * last_) {  // seldom, so that a line costs the same
    const auto old = static_cast<std::ptrdiff_t>(last_);
    t_.erase(t_.begin(), t_.begin() + old);
    mark_.erase(mark_.begin(), mark_.begin() + old);
    line_.erase(line_.begin(), line_.begin() + old);
    readings_.erase(readings_.begin(),
                    readings_.begin() + old * static_cast<std::ptrdiff_t>(cameras_));
  }
  const std::size_t line = next_++;
  if (line / kStretch % every_ != 0) return;
  t_.push_back(t);
  mark_.push_back(mark);
  line_.push_back(line);
  readings_.insert(readings_.end(), readings.begin(), readings.end());
}

void HealthEvidence::Took(double t, std::span<const double> u_px) {
  const auto at = std::lower_bound(t_.begin(), t_.end(), t);
  if (at == t_.end() || *at != t) return;  // not kept
  const auto i = static_cast<std::size_t>(at - t_.begin());
  if (mark_[i] < 0) return;  // several marks' readings
  for (std::size_t c = 0; c < cameras_; ++c) {
    if (!std::isnan(u_px[c])) readings_[i * cameras_ + c].u_px = u_px[c];
  }
}

std::ptrdiff_t HealthEvidence::After(std::size_t i, int lag) const {
  const auto at = static_cast<std::ptrdiff_t>(i) + lag;
  if (at < 0 || at >= static_cast<std::ptrdiff_t>(size())) return -1;
  const auto line = static_cast<std::ptrdiff_t>(line_[static_cast<std::size_t>(at)]);
  return line == static_cast<std::ptrdiff_t>(line_[i]) + lag ? at : -1;
}

void HealthEvidence::Widen(std::span<const double> factors) {
  for (std::size_t k = 0; k < readings_.size(); ++k) {
    const int mark = mark_[k / cameras_];
    if (mark < 0) continue;
    const std::size_t cell = static_cast<std::size_t>(mark) * cameras_ + k % cameras_;
    readings_[k].s_px *= static_cast<float>(factors[cell]);
  }
}

std::size_t HealthEvidence::Marks() const {
  const auto last = std::max_element(mark_.begin(), mark_.end());
  return last == mark_.end() ? 0 : static_cast<std::size_t>(*last + 1);
}

void HealthEvidence::Exchange(std::size_t a, std::size_t b) {
  for (std::size_t i = 0; i < size(); ++i) {
    std::swap(readings_[i * cameras_ + a], readings_[i * cameras_ + b]);
  }
}

void HealthEvidence::Correct(const Correction& correction) {
  if (correction.camera < 0) return;
  const auto c = static_cast<std::size_t>(correction.camera);
  if (correction.lag != 0) {
    std::vector<Reading> taken(size());
    for (std::size_t i = 0; i < size(); ++i) {
      const std::ptrdiff_t from =
          correction.Holds(t_[i]) ? After(i, correction.lag) : static_cast<std::ptrdiff_t>(i);
      if (from >= 0) taken[i] = At(static_cast<std::size_t>(from), c);
    }
    for (std::size_t i = 0; i < size(); ++i) readings_[i * cameras_ + c] = taken[i];
  }
  for (std::size_t i = 0; i < size(); ++i) {
    if (correction.Holds(t_[i])) readings_[i * cameras_ + c].u_px -= correction.Offset(t_[i]);
  }
}

void HealthEvidence::LeaveOut(const Correction& correction) {
  const bool doubtful = correction.camera < 0;
  if (!doubtful && !correction.leave_out) return;
  for (std::size_t i = 0; i < size(); ++i) {
    if (!correction.Holds(t_[i])) continue;
    if (doubtful) {
      mark_[i] = -1;
    } else {
      readings_[i * cameras_ + static_cast<std::size_t>(correction.camera)] = {};
    }
  }
}

}  // namespace unfurl::measure
