#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "data/trial.h"
#include "data/trial_readings.h"

namespace unfurl::data {

/// What a stream of lines or readings says before the first of them (docs/live.md).
struct LiveHeader {
  bool readings = false;    ///< readings follow, else lines
  TrialHeader trial;        ///< of readings: only cameras and slots
  std::vector<int> pixels;  ///< of readings, of each camera's row; empty: not stated
};

/// Takes a stream apart as its bytes come, in whatever pieces. What it holds is bounded by one
/// piece and one line. Throws Error that names the stream and the line for all that is no stream of
/// ours.
class LiveStreamReader {
 public:
  explicit LiveStreamReader(std::string where) : where_(std::move(where)) {}

  /// The next bytes; what was whole before should have been taken.
  void Feed(std::string_view bytes);
  /// Null until it is whole.
  const LiveHeader* header() const { return header_ ? &*header_ : nullptr; }
  /// The lines that are whole, at most `most`; how many. Of a stream of lines.
  std::size_t Take(std::size_t most, TrialBlock* block);
  /// The same of a stream of readings; `path` is the stream.
  std::size_t Take(std::size_t most, TrialReadings* block);
  bool ended() const { return ended_; }          ///< the record that says so has come
  std::size_t taken() const { return number_; }  ///< lines, or flashes
  /// No more bytes will come: throws Error unless the stream has said that it ends.
  void Close() const;
  const std::string& where() const { return where_; }  ///< as it was given

 private:
  std::string_view Rest() const { return std::string_view(buffer_).substr(at_); }
  void ReadHeader(std::string_view text);
  // True where a whole line of a stream of lines is there; false too where it was the end.
  bool NextLine(std::size_t counts);
  // The next line of text without its end; none where it is not whole.
  std::optional<std::string_view> NextText(std::size_t most);
  bool ReadFlash(std::string_view text, TrialReadings* block);
  void CheckTime(double t);
  void CheckNumber(std::uint64_t number) const;
  void CheckEnd(std::uint64_t lines);
  [[noreturn]] void Fail(const std::string& problem, const std::string& remedy) const;

  std::string where_, buffer_;
  std::size_t at_ = 0;        // of the first byte that was not taken
  std::size_t searched_ = 0;  // bytes behind it that hold no end of a line
  std::optional<LiveHeader> header_;
  std::size_t number_ = 0;
  double last_t_ = -1e300;  // [s]; below any
  bool ended_ = false;
};

/// The stream's bytes, for whoever writes one; appended to `out`.
void AppendLiveHeader(const LiveHeader& header, std::string* out);
/// Line i of a block at time `t` [s], the `number`-th of the stream from 0.
void AppendLiveLine(const TrialHeader& header, const TrialBlock& block, std::size_t i, double t,
                    std::uint64_t number, std::string* out);
/// Flash i of readings, likewise.
void AppendLiveFlash(const TrialReadings& readings, std::size_t i, double t, std::uint64_t number,
                     std::string* out);
/// The end of a stream of so many lines or flashes.
void AppendLiveEnd(bool readings, std::uint64_t lines, std::string* out);

}  // namespace unfurl::data
