#pragma once

#include <cstddef>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/live_stream.h"
#include "data/rig.h"
#include "data/tracks.h"
#include "measure/health.h"
#include "measure/live_watch.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

/// Of a reconstruction that follows its record.
struct LiveOptions {
  ReconstructOptions reconstruct{};
  WatchOptions watch{};
  /// Time between two looks at the cameras' health [s]; each is answered when the next begins.
  double look_every = 2.0;
  /// Lines that a look goes over: half a minute of a usual record, in 8 MB of four cameras.
  std::size_t look_lines = std::size_t{1} << 15U;
  /// Time between two reports of the views [s].
  double views_every = 1.0;
  /// Throws Error that names a value which makes no sense.
  void Check() const;
};

/// Who is told what comes of it. What is handed over holds until the call ends.
class LiveListener {
 public:
  virtual ~LiveListener() = default;
  virtual void Begun(const Reconstructor&) {}               ///< before all else
  virtual void Samples(const data::Tracks&) {}              ///< in order of time
  virtual void Notice(const LiveNotice&) {}                 ///< something goes wrong, or is mended
  virtual void Looked(double, const HealthReport&) {}       ///< at the cameras' health, at [s]
  virtual void Views(double, std::span<const LiveView>) {}  ///< by camera and mark, at [s]
};

/// Lines as they come, to marks as they are decided: the Reconstructor's own code, line by line, so
/// that the same record with the same look ahead gives the same bits as Reconstruct gives, as long
/// as its cameras are sound. One that is found wrong is left out from then on; samples that went
/// out before stand. Results depend on the lines alone, not on how they come in pieces nor on time.
class Live {
 public:
  /// `like`: LiveBeginning's. Rig, record and listener must outlive it. Throws Error for a stream
  /// of other cameras, or rows of other lengths, than the rig's, as far as its header tells.
  Live(data::LiveHeader header, std::string path, const data::Rig& rig, std::string rig_path,
       const LiveOptions& options, const TrialRecord* like, LiveListener* listener);
  ~Live();
  Live(const Live&) = delete;
  Live& operator=(const Live&) = delete;

  /// The next lines, or flashes. Throws Error for what is none, and where no line of the first
  /// kMostWaiting is dark.
  void Add(const data::TrialBlock& lines);
  void Add(const data::TrialReadings& flashes);  ///< the same of readings
  /// There are no more: all samples that waited come. Without `look`, at once: the cameras' health
  /// is not looked at again.
  void Finish(bool look = true);

  std::size_t lines() const { return lines_; }  ///< so far, or flashes
  double t() const { return t_; }               ///< of the last one [s]
  /// Null until it has begun.
  const Reconstructor* reconstructor() const { return pass_.get(); }
  const LiveWatch* watch() const { return watch_ ? &*watch_ : nullptr; }  ///< likewise

  static constexpr std::size_t kMostWaiting = 1024;  ///< lines, 18 MB of four usual cameras

 private:
  template <typename Block>
  void Take(const Block& block);
  bool CanBegin() const;
  void Begin();
  template <typename Block>
  void Process(const Block& block, std::size_t first, std::size_t end);
  void Observe(std::int32_t slot);
  void Look();
  void TakeLook();

  data::LiveHeader header_;
  std::string path_;
  const data::Rig& rig_;
  std::string rig_path_;
  LiveOptions options_;
  LiveListener* listener_;
  LiveBeginning beginning_;
  std::unique_ptr<Reconstructor> pass_;
  std::optional<LiveWatch> watch_;
  std::vector<std::vector<int>> marks_;  // by slot
  std::size_t lines_ = 0, every_ = 1;    // lines between two looks
  double t_ = 0.0, next_views_ = 0.0;    // [s]
  data::Tracks tracks_;
  data::TrialBlock line_;
  std::vector<LiveNotice> notices_;
  HealthOptions health_;
  std::future<HealthReport> look_;
  double look_t_ = 0.0;             // when it began [s]
  std::vector<LiveNotice> faults_;  // that the last look found
};

}  // namespace unfurl::measure
