#pragma once

#include <array>
#include <chrono>
#include <deque>
#include <future>
#include <string>
#include <vector>

#include "cli/live_output.h"
#include "data/provenance.h"
#include "data/rig.h"
#include "measure/live.h"

namespace unfurl::cli {

struct LiveSettings;

// What a page shows of a live reconstruction at one moment.
struct LivePageState {
  std::string source;  // where lines come from
  std::vector<std::string> cameras, marks;
  std::vector<int> pixels;                // by camera
  struct Way {                            // of a mark, of late
    std::deque<double> t;                 // [s]
    std::array<std::deque<double>, 3> p;  // NaN where unsolvable [m]
  };
  std::vector<Way> ways;
  std::vector<measure::LiveView> views;  // of the last whole report, camera x mark
  std::vector<measure::LiveNotice> standing, log;
  std::string health_unknown;
  std::vector<measure::HealthSlice> health;  // by camera: the last slice
  double t = 0.0;                            // [s]
  std::size_t lines = 0, samples = 0, usable = 0;
  double latency_p99 = 0.0, waited_p99 = 0.0;  // [s]
  bool begun = false, ended = false;
  std::string why;  // it ended before its end
};

// The page as a file that is replaced every second, beside the work: composing it takes
// longer than a line may wait.
class LivePage : public measure::LiveListener {
 public:
  LivePage(const LiveSettings& s, data::Provenance provenance);
  ~LivePage() override;
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  void Follow(const measure::Live* live, const Durations* latency, const Durations* waited);
  void Begun(const measure::Reconstructor& pass) override;
  void Samples(const data::Tracks& tracks) override;
  void Notice(const measure::LiveNotice& notice) override;
  void Looked(double t, const measure::HealthReport& report) override;
  void Views(double t, std::span<const measure::LiveView> views) override;
  // Between lines: hands the state over when a second has passed.
  void Update();
  // The last state, which stays; `why` as LiveJson::End.
  void Close(const std::string& why);

 private:
  void Refresh();
  void Write(const LivePageState& state) const;

  std::string path_;
  data::Provenance provenance_;
  LivePageState state_;
  const measure::Live* live_ = nullptr;
  const Durations *latency_ = nullptr, *waited_ = nullptr;
  std::chrono::steady_clock::time_point last_{};
  std::vector<double> next_dot_;  // by mark [s]
  std::future<void> writing_;
};

}  // namespace unfurl::cli
