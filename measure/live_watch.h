#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "data/tracks.h"
#include "measure/health.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

/// What an operator is told while there is time to mend it.
enum class NoticeKind : std::uint8_t {
  kNoLight,     // no camera sees any mark
  kLed,         // no camera sees a mark
  kCamera,      // a camera sees no mark, others do
  kBlocked,     // a camera does not see a mark that is in its field
  kAim,         // a mark is at the end of a camera's row, or beyond it
  kLeftOut,     // a camera's readings contradict the others'
  kNoPosition,  // a mark is seen and has no position
  kMoved,       // a camera moved, drifts or is late, by Diagnose
  kScatter,     // readings scatter more than stated, likewise
};
const char* Name(NoticeKind kind);  ///< one word

/// Something that is wrong from now on, or no longer.
struct LiveNotice {
  NoticeKind kind = NoticeKind::kNoLight;
  bool begins = true;  ///< else it is mended
  int camera = -1;     ///< -1: of none
  int mark = -1;       ///< -1: of none
  double t = 0.0;      ///< of the line that showed it [s]
  double since = 0.0;  ///< when it began [s]
  std::string words;   ///< with names and sizes, no remedy
};

/// One camera's view of one mark since the last report.
struct LiveView {
  std::size_t lit = 0, seen = 0;  ///< flashes of the mark, and those that the camera saw
  double u_px = 0.0;              ///< the last reading [px]; NaN: none yet
  double width_px = 0.0;          ///< of its spot [px]; 0: not measured
  double flux = 0.0;              ///< of its spot [count]; 0: not measured
};

/// When the operator is told.
struct WatchOptions {
  /// How long something must last [s]: nobody acts faster, and what passes by is no fault.
  double patience = 0.5;
  /// Chance of a wrong notice in an hour, if flashes were missed independently [-].
  double false_alarm = 1e-3;
  /// Chance that a camera misses a flash by itself, as AssociateOptions::miss [-].
  double miss = 0.02;
  /// Throws Error that names a value which makes no sense.
  void Check() const;
};

/// Looks at every line as it comes: which camera sees which mark, and where in its row.
class LiveWatch {
 public:
  LiveWatch(const Triangulator& triangulator, std::vector<std::string> marks, double line_rate,
            const WatchOptions& options);

  /// A line that lit `marks`, with the first reading of each camera; notices are appended.
  void Line(double t, std::span<const int> marks, std::span<const HealthEvidence::Reading> readings,
            std::vector<LiveNotice>* notices);
  /// Samples as they are decided.
  void Samples(const data::Tracks& tracks);
  /// By camera, then mark; begins a new report.
  std::vector<LiveView> TakeViews();
  /// What is wrong now.
  std::vector<LiveNotice> Standing() const;
  /// Flashes in a row that must show something before it is told.
  int enough() const { return enough_; }

 private:
  // Something that is so, or not, flash after flash.
  struct Run {
    bool now = false, told = false;
    int count = 0;
    double since = 0.0;  // [s]
  };
  struct Key {
    NoticeKind kind;
    int camera, mark;
    auto operator<=>(const Key&) const = default;
  };
  void Follow(double t, bool now, double wait, Run* run) const;
  std::size_t At(std::size_t camera, std::size_t mark) const {
    return camera * marks_.size() + mark;
  }
  std::map<Key, LiveNotice> Judge(double t) const;
  std::vector<double> DarkSince(double t) const;
  void JudgeView(double t, std::size_t camera, std::size_t mark,
                 std::map<Key, LiveNotice>* found) const;
  void JudgeLeftOut(double t, std::size_t camera, const std::vector<std::size_t>& shown,
                    std::map<Key, LiveNotice>* found) const;
  std::string WordsOfView(std::size_t camera, std::size_t mark, NoticeKind* kind) const;

  const Triangulator& triangulator_;
  std::vector<std::string> marks_;
  WatchOptions options_;
  int enough_ = 1;
  std::vector<Run> unseen_, at_end_;  // camera x mark
  std::vector<Run> left_out_;         // camera x mark, of samples with a position
  std::vector<LiveView> views_;       // camera x mark
  std::vector<Run> no_position_;      // by mark
  std::vector<data::SampleReason> reason_;
  std::vector<Eigen::Vector3d> place_;  // by mark, the last; NaN: none [m]
  std::vector<double> place_t_;         // [s]
  std::vector<double> last_, gap_;      // by mark: last flash, longest time between two [s]
  double round_ = 0.0;                  // the longest gap of all [s]
  std::map<Key, LiveNotice> standing_;
};

}  // namespace unfurl::measure
