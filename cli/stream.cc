// `unfurl stream`: a recorded trial as a recorder would send it.
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/count.h"
#include "base/error.h"
#include "base/progress.h"
#include "cli/live_source.h"
#include "cli/verb.h"
#include "data/live_stream.h"
#include "measure/trial_record.h"

namespace unfurl::cli {

namespace {

struct StreamSettings {
  std::string trial, to;
  double pace = 0.0;     // [-] of real time; 0: as fast as it is taken
  double seconds = 0.0;  // [s] of lines; 0: the record's
};

// Where the bytes go.
class Sink {
 public:
  explicit Sink(const std::string& to) : where_(to.empty() ? "standard output" : to) {
    if (to.empty() && isatty(STDOUT_FILENO) != 0) {
      throw Error("is a terminal, and a stream is not for reading", where_,
                  "pipe it into unfurl reconstruct --live, or give --to HOST:PORT");
    }
    socket_ = to.empty() ? -1 : ConnectTo(to);
  }
  ~Sink() {
    if (socket_ >= 0) close(socket_);
  }
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;

  void Write(const std::string& bytes) const {
    for (std::size_t at = 0; at < bytes.size();) {
      const char* from = &bytes[at];
      const std::size_t n = bytes.size() - at;
      // Without the signal that ends a program whose reader left: that is an error here.
      const ssize_t done =
          socket_ >= 0 ? send(socket_, from, n, MSG_NOSIGNAL) : write(STDOUT_FILENO, from, n);
      ThrowIfInterrupted();
      if (done < 0 && errno == EINTR) continue;
      if (done < 0) {
        throw Error(fmt::format("takes no more: {}", std::strerror(errno)), where_,
                    "see what the receiver says");
      }
      at += static_cast<std::size_t>(done);
    }
  }

 private:
  std::string where_;
  int socket_ = -1;
};

// A record's lines in an endless row: forwards, then from its end backwards, so that no mark jumps.
class Lines {
 public:
  explicit Lines(const std::string& path) : record_(path) {
    if (record_.size() == 0) throw Error("holds no line", path, "record some");
    if (record_.readings() != nullptr) {
      times_ = record_.readings()->t;
      return;
    }
    for (std::size_t i = 0; i < record_.size(); i += block_.size()) {
      Load(i);
      times_.insert(times_.end(), block_.t.begin(), block_.t.end());
    }
  }

  data::LiveHeader Header() const { return record_.Header(); }
  std::size_t size() const { return times_.size(); }

  // Of the i-th line of the row [s].
  double Time(std::size_t i) const {
    const std::size_t n = size(), turn = i / n;
    const double first = times_.front(), last = times_.back();
    // A turn takes as long as a usual line.
    const double step = n > 1 ? (last - first) / static_cast<double>(n - 1) : 1.0;
    const double begin = static_cast<double>(turn) * (last - first + step);
    return turn % 2 == 0 ? begin + times_[i % n] : begin + first + (last - times_[n - 1 - i % n]);
  }
  // Its bytes.
  void Append(std::size_t i, std::string* out) {
    const std::size_t at = i / size() % 2 == 0 ? i % size() : size() - 1 - i % size();
    if (record_.readings() != nullptr) {
      data::AppendLiveFlash(*record_.readings(), at, Time(i), i, out);
      return;
    }
    if (at < from_ || at >= from_ + block_.size()) Load(at / kHeld * kHeld);
    data::AppendLiveLine(record_.lines()->header(), block_, at - from_, Time(i), i, out);
  }

 private:
  static constexpr std::size_t kHeld = 512;  // lines
  void Load(std::size_t first) {
    from_ = first;
    record_.lines()->Read(first, std::min(kHeld, record_.size() - first), &block_);
  }

  measure::TrialRecord record_;
  std::vector<double> times_;  // of all lines [s]
  data::TrialBlock block_;     // from line `from_` on
  std::size_t from_ = 0;
};

int StreamVerb(const Common& common, const StreamSettings& s) {
  using Clock = std::chrono::steady_clock;
  if (!std::isfinite(s.pace) || s.pace < 0.0) {
    throw Error("is no pace", "--pace", "give 1 for real time, 2 for twice as fast, 0 for at once");
  }
  if (!std::isfinite(s.seconds) || s.seconds < 0.0) {
    throw Error("is no duration", "--seconds", "give seconds, or 0 for the record's own");
  }
  if (common.json && s.to.empty()) {
    throw Error("would stand within the stream", "--json", "give --to HOST:PORT, or leave it out");
  }
  Lines lines(s.trial);
  const Sink sink(s.to);
  const bool readings = lines.Header().readings;
  constexpr std::size_t kTogether = std::size_t{1} << 18U;  // bytes that are sent at once
  std::string bytes;
  data::AppendLiveHeader(lines.Header(), &bytes);
  const Clock::time_point start = Clock::now();
  const double first = lines.Time(0);
  std::size_t n = 0;
  for (;; ++n) {
    const double t = lines.Time(n) - first;
    if (s.seconds > 0.0 ? t >= s.seconds : n >= lines.size()) break;
    ThrowIfInterrupted();
    if (s.pace > 0.0) {
      const auto due = start + std::chrono::duration_cast<Clock::duration>(
                                   std::chrono::duration<double>(t / s.pace));
      if (due > Clock::now()) {
        sink.Write(bytes);
        bytes.clear();
        std::this_thread::sleep_until(due);
      }
    }
    lines.Append(n, &bytes);
    if (bytes.size() < kTogether) continue;
    sink.Write(bytes);
    bytes.clear();
  }
  data::AppendLiveEnd(readings, n, &bytes);
  sink.Write(bytes);
  if (s.to.empty()) return kExitGood;
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  const nlohmann::ordered_json summary = {{"lines", n}, {"to", s.to}, {"seconds", seconds}};
  Finish(common, summary,
         fmt::format("{} to {} in {:.1f} s", Counted(static_cast<std::size_t>(n), "line"), s.to,
                     seconds));
  return kExitGood;
}

}  // namespace

Verb AddStream(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "stream",
                          "A recorded trial, line by line, as a recorder sends it",
                          "unfurl stream trial.h5 --pace 1 | unfurl reconstruct --live --rig "
                          "rig.h5 --report live.html");
  CLI::App* app = verb.app;
  auto s = std::make_shared<StreamSettings>();
  verb.files->Read("TRIAL", &s->trial, "The recorded lines [HDF5], or readings of them [CSV, HDF5]")
      ->required();
  app->add_option("--to", s->to, "Send it there, by TCP; default: standard output")
      ->type_name("HOST:PORT");
  app->add_option(
         "--pace", s->pace,
         "Lines at so many times the pace of their recording; 0: as fast as they are taken")
      ->capture_default_str();
  app->add_option("--seconds", s->seconds,
                  "Go on for so long [s] of the record's time, forwards and backwards in turn; 0: "
                  "the record, once")
      ->capture_default_str();
  verb.run = [s, &common] { return StreamVerb(common, *s); };
  return verb;
}

}  // namespace unfurl::cli
