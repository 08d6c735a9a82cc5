#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "measure/live.h"

namespace unfurl::cli {

// Lines for a pipe, whole whatever happens: each write is of whole lines, and small enough that a
// pipe takes all of it or nothing (POSIX: PIPE_BUF).
class WholeLines {
 public:
  // Nothing is written where not `enabled`.
  explicit WholeLines(bool enabled) : enabled_(enabled) {}
  std::string& text() { return text_; }  // append lines here
  // Throws Error where the machine refuses.
  void Flush();

 private:
  bool enabled_;
  std::string text_;
};

// How often which durations occurred, in constant memory; to 2%.
class Durations {
 public:
  void Add(double seconds, std::size_t times = 1);
  double Quantile(double share) const;   // [s]; 0 where there are none
  double most() const { return most_; }  // [s]
  std::size_t count() const { return count_; }

 private:
  static constexpr int kPerDecade = 115;  // steps of 2%
  static constexpr int kDecades = 10;     // from 1e-7 s on
  std::array<std::size_t, kPerDecade * kDecades> counts_{};
  std::size_t count_ = 0;
  double most_ = 0.0;  // [s]
};

// What comes of a live reconstruction, as JSON objects, one a line (docs/live.md).
class LiveJson : public measure::LiveListener {
 public:
  LiveJson(WholeLines* out, const measure::Live** live) : out_(out), live_(live) {}

  void Listening(const std::string& address);
  void Begun(const measure::Reconstructor& pass) override;
  void Samples(const data::Tracks& tracks) override;
  void Notice(const measure::LiveNotice& notice) override;
  void Looked(double t, const measure::HealthReport& report) override;
  void Views(double t, std::span<const measure::LiveView> views) override;
  // `why` empty: the stream said that it ended.
  void End(const measure::Live& live, const Durations& latency, const std::string& why);

  const Durations& window() const { return window_; }  // of record time that samples waited

 private:
  void Names(std::uint32_t cameras);
  void Line(const nlohmann::ordered_json& object);

  WholeLines* out_;
  const measure::Live** live_;
  std::vector<std::string> cameras_, marks_;  // in JSON, with quotes
  Durations window_;
};

// "recalibrate", "uncover it": what is to be done about it.
std::string RemedyOf(const measure::LiveNotice& notice);

}  // namespace unfurl::cli
