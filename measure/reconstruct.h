#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/rig.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "data/trial_readings.h"
#include "measure/background.h"
#include "measure/correction.h"
#include "measure/dark_light.h"
#include "measure/exchanged_marks.h"
#include "measure/health.h"
#include "measure/lines_before.h"
#include "measure/mark_tracker.h"
#include "measure/record_slips.h"
#include "measure/spot.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

/// Of every step from lines to marks.
struct ReconstructOptions {
  SpotOptions spot{};
  TriangulateOptions point{};
  AssociateOptions associate{};  // but merge_px, which the record's spots tell
  // Of any mark, ever [m/s]. 0: five times the fastest that is seen while looking ahead, and no
  // less than what crosses the rig's volume in forty samples of a mark.
  double max_speed = 0.0;
  // Where marks are at the start, by name [m], to within `start_sigma` [m] (0: a hundredth of the
  // volume's size). Only marks that are lit together need it; without it they are named by their
  // places, in order of x.
  std::map<std::string, Eigen::Vector3d> start;
  double start_sigma = 0.0;  // [m]
  // Where one mark is lit, spots fainter than this share of the line's brightest are not its own:
  // faint reflections. Also what a sensor is taken to keep of the line before at most, unless the
  // record shows what it keeps [-].
  double least_share = 0.1;
  // What is known of cameras that moved, drifted or are late, in the order in which it was found.
  std::vector<Correction> corrections;
  // Readings that are not used, in the order of lines.
  std::vector<WrongReading> wrong;
  HealthOptions health{};
  std::size_t workers = 0;  // 0: all cores; the result does not depend on it
  // Called with what is done, 0 to 1, by Reconstruct.
  std::function<void(double)> progress;
  // Throws Error that names a value which makes no sense.
  void Check() const;
};

inline constexpr std::size_t kSpotFlags = 7;  // bits of SpotFlag

/// Flashes of one mark in a row that no camera sees.
struct UnseenMark {
  double from = 0.0, until = 0.0;  ///< the first and the last of them [s]
  std::size_t flashes = 0;
  bool to_end = false;  ///< none was seen after them
};

/// What a reconstruction came to.
struct ReconstructSummary {
  std::size_t lines = 0, dark_lines = 0;
  std::vector<std::string> marks;
  std::vector<std::array<std::size_t, 4>> status;  // by mark and data::SampleStatus
  // Samples without a position, by mark and data::SampleReason.
  std::vector<std::array<std::size_t, data::kSampleReasons>> reasons;
  std::vector<std::array<std::size_t, kSpotFlags>>
      flags;                                // by camera and bit of SpotFlag, lit lines
  std::vector<std::size_t> readings;        // by camera, that entered
  std::vector<std::size_t> left_out;        // by camera, where others were preferred
  std::vector<std::string> named_by_place;  // marks
  // By mark: flashes that fewer than three cameras could read, since its light fills their pixels.
  std::vector<std::size_t> too_bright;
  // By mark: the longest time that no camera saw it while it alone should have been lit.
  std::vector<UnseenMark> unseen;
  std::vector<ExchangedMark> exchanged;
  LitDark lit_dark;
  // Share of the calibration's variance that is not in the shared part but in the samples' own
  // covariance, the largest of any sample [-].
  double unshared = 0.0;
  // Those of all marks, by the reason in words; reasons that did not occur are not in it.
  std::map<std::string, std::size_t> Unsolved() const;
  // A mark of which fewer than half of its samples have a position; a sentence with the counts, the
  // commonest reason, and what to look at. Empty: there is none.
  std::vector<std::string> LostMarks() const;
  /// Marks that have most of their samples, and that no camera sees for so many flashes in a row
  /// that they count as lost: a sentence with when, how often, and what to look at.
  std::vector<std::string> DarkMarks() const;
  /// A mark whose light lines show that are named dark: a sentence likewise, or none.
  std::vector<std::string> LitDarkLines() const;
  /// Of all marks; the usable ones of them.
  std::size_t samples() const;
  std::size_t usable() const;
};

class TrialRecord;

/// What is known of a record that is still being made: how it begins.
struct LiveBeginning {
  std::string path;          ///< of the stream, for messages
  data::TrialHeader header;  ///< of lines; of readings empty
  data::TrialBlock lines;    ///< the first ones: kLines and as many more until one is dark, or all
  data::TrialReadings readings;  ///< in place of lines: the first kLines flashes, or all
  /// A record of the same cameras and marks that shows how fast marks are and where they go; null:
  /// the beginning has to do.
  const TrialRecord* like = nullptr;
  std::size_t evidence_lines = std::size_t{1} << 15U;  ///< that health is judged by, the last ones

  static constexpr std::size_t kLines = 160;  ///< after which a reconstruction begins
};

// From raw lines to marks in time, block after block; what is remembered from one to the next are
// backgrounds, where each mark last was, and lines that wait for what follows (MarkTracker), so the
// result does not depend on the blocks' size.
class Reconstructor {
 public:
  // Looks at some lines of the whole trial to see where the marks go: the calibration's part is
  // reduced to what matters there. Throws Error when the rig is not the one that recorded the
  // trial.
  Reconstructor(const data::TrialReader& trial, const data::Rig& rig, const std::string& rig_path,
                const ReconstructOptions& options = {});
  /// The same from readings: of the rig's cameras by name, in any order; a camera without any is
  /// one that saw nothing. Throws Error for readings of other cameras, or beyond a camera's row.
  Reconstructor(const data::TrialReadings& readings, const data::Rig& rig,
                const std::string& rig_path, const ReconstructOptions& options = {});
  /// Of a record without a known end, whose blocks follow from its first line on; Finish ends it.
  /// From the same look ahead (`like`: the record itself) the same bits. Throws Error as above, and
  /// for a `like` of other cameras, slots or layout of lines.
  Reconstructor(const LiveBeginning& beginning, const data::Rig& rig, const std::string& rig_path,
                const ReconstructOptions& options = {});
  Reconstructor(const Reconstructor&) = delete;
  Reconstructor& operator=(const Reconstructor&) = delete;

  // Frame, marks, cameras and shared rank, no samples: for TracksWriter.
  const data::Tracks& layout() const { return layout_; }
  /// Lines per second; of readings what the flashes show that it began with.
  double line_rate() const { return header_.line_rate; }
  const TrackerOptions& tracking() const { return tracking_; }
  // The samples that are decided with this block, in order of time; with the trial's last line all
  // are. Blocks must follow each other from line 0.
  void Process(const data::TrialBlock& block, data::Tracks* tracks);
  /// The same of flashes [first, first + count) of readings.
  void Process(const data::TrialReadings& readings, std::size_t first, std::size_t count,
               data::Tracks* tracks);
  /// Of a record without a known end, which has come now: the samples that waited.
  void Finish(data::Tracks* tracks);
  /// From the next sample on: cameras that are left out, stretches of time without a position,
  /// sigmas that are widened.
  /// Throws Error for a correction that puts readings right.
  void LeaveOut(std::vector<Correction> corrections);
  /// Throws Error for readings that the rig's cameras cannot have.
  void CheckReadings(const data::TrialReadings& readings) const;
  // Readings less those of the points last handed out: samples x cameras, NaN where none [px].
  std::span<const float> residuals() const { return residuals_; }

  const ReconstructSummary& summary() const { return summary_; }  // so far
  // What the cameras read, whatever became of it, with `corrections` taken out.
  const HealthEvidence& evidence() const { return evidence_; }
  const Triangulator& triangulator() const { return triangulator_; }
  const ReconstructOptions& options() const { return options_; }

 private:
  struct Slot {
    std::vector<int> marks;  // empty: dark
  };
  // Spots of one line and camera.
  struct Seen {
    std::uint8_t count = 0;
    std::uint8_t flags = 0;
    float width_px = 0.0F;  // of the brightest [px]
    float flux = 0.0F;      // of the first of `spots` [count]
    int of_dark = -1;       // of a dark line: the mark whose light it shows
    std::array<Candidate, Associator::kMostCandidates> spots;
  };

  // Times and slots of some lines, and their spots.
  struct Lines {
    std::span<const double> t;           // [s]
    std::span<const std::int32_t> slot;  // index into slots_
  };
  // Lines [first, first + count) of the record and their spots, without learning backgrounds.
  using Look = std::function<Lines(std::size_t first, std::size_t count, std::vector<Seen>* seen)>;

  // Of readings, named and numbered as the rig's cameras; without lines.
  static data::TrialHeader HeaderOf(const data::TrialReadings& readings, const data::Rig& rig);
  using ReadBlock =
      std::function<void(std::size_t first, std::size_t count, data::TrialBlock* block)>;
  void PrepareLines(const std::string& path, const std::string& rig_path);
  void BeginLines(const LiveBeginning& beginning, const std::string& rig_path);
  void BeginReadings(const LiveBeginning& beginning, const std::string& rig_path);
  void ReadSlots(const std::string& path);
  // Throws Error for what the rig's cameras cannot have read.
  void MapCameras(const data::TrialReadings& readings, const std::string& rig_path);
  void FillSpots(const data::TrialReadings& readings, std::size_t first, std::size_t count,
                 std::vector<Seen>* seen) const;
  // Also finds how often a mark is lit.
  void PrimeBackgrounds(const std::string& path, std::size_t size, const ReadBlock& read);
  void FindInterval(const Lines& lines, std::vector<double>* last, std::vector<double>* intervals);
  void SetInterval(std::vector<double>* intervals);
  // What both kinds of records begin and go on with; `look` over so many lines.
  void Begin(const std::string& path, std::size_t lines, const Look& look);
  // The spots of a record of lines, by the backgrounds of its beginning.
  Look LookAt(const ReadBlock& read, data::TrialBlock* block);
  void Follow(const Lines& lines, data::Tracks* tracks);
  // The tracker's options from what a few lines of the whole record show; `flashes` gets those of
  // one mark.
  TrackerOptions LookAhead(std::size_t size, const Look& look, std::vector<FlashReadings>* flashes);
  // Throw Error for a record whose cameras, or lines, are plainly named wrongly.
  void RefuseCameraSlips(const std::string& path, std::span<const FlashReadings> flashes) const;
  void RefuseSlotSlips(const data::TrialReader& trial);
  void RefuseSlotSlips(const data::TrialReadings& readings) const;
  void FindSpots(const data::TrialBlock& block, std::span<const Slot> slots, bool learn,
                 std::vector<Seen>* seen);
  void Candidates(std::span<const Seen> seen, std::vector<std::span<const Candidate>>* out) const;
  // Takes the corrections out of a line's spots, and keeps them as evidence.
  void Correct(double t, std::size_t line, const Slot& slot, std::span<Seen> seen);
  // Takes a line named dark into the background of that camera, where that does not know it yet,
  // unless it shows a mark's light: the mark, or -1.
  int TakeDark(std::span<const std::uint16_t> line, bool anew, std::size_t camera);
  // The mark whose light a line named dark shows in that camera, by its spots; -1: none.
  int LightOfDark(std::span<const Spot> spots, std::size_t camera) const;
  void CountDark(double t, std::span<const Seen> seen);
  void CountLight(double t, const Slot& slot, std::span<const Seen> seen);
  bool Doubtful(double t) const;
  // How the corrections' errors move a sample, behind the calibration's directions.
  void AddCorrectionErrors(const TrackedLine& line, const TrackedPoint& mine,
                           Eigen::Ref<Eigen::Matrix3Xd> F) const;
  void Collect();
  void HandOut(data::Tracks* tracks);

  ReconstructOptions options_;
  TrackerOptions tracking_;
  double interval_ = 0.0;     // median, between two flashes of a mark [s]
  data::TrialHeader header_;  // of readings: without lines
  Triangulator triangulator_;
  data::Tracks layout_;
  ReconstructSummary summary_;
  std::vector<Slot> slots_;
  std::vector<int> column_;  // of readings: by the rig's cameras, which of theirs; -1: none
  std::vector<Background> backgrounds_;  // by camera
  std::vector<SpotFinder> finders_;
  std::optional<MarkTracker> tracker_;
  std::vector<Seen> seen_;             // line x camera, of the block
  std::vector<LinesBefore> before_;    // by camera
  std::vector<DarkLight> dark_light_;  // by camera
  std::vector<int> of_dark_;           // of one line, by camera
  bool lit_dark_ = false;              // most cameras saw a mark's light in the last dark line
  std::optional<ExchangeWatch> exchanges_;
  std::vector<UnseenMark> unseen_;  // by mark, that last until now
  HealthEvidence evidence_;
  std::vector<HealthEvidence::Reading> readings_;  // of one line, by camera
  std::vector<TrackedLine> decided_;  // the first `lines_decided_` are to be handed out
  std::size_t lines_decided_ = 0;
  std::vector<float> residuals_;  // samples x cameras, NaN where none [px]
  std::size_t next_line_ = 0, last_line_ = 0;
  std::size_t primed_ = 0;  // lines whose dark ones the backgrounds already know
};

// To collect blocks: appends one to all before, with room to spare, and at the end drops the room.
void AppendTracks(const data::Tracks& block, data::Tracks* all);
void TrimTracks(data::Tracks* all);

// Lines [first, first + count) with the cameras that are late, by `corrections`, put in step.
void ReadLines(const data::TrialReader& trial, std::span<const Correction> corrections,
               std::size_t first, std::size_t count, data::TrialBlock* block);

// Reads a record again as long as it shows faults that are not taken out yet.
class HealthLoop {
 public:
  // `correct`: readings are put right; otherwise cameras are left out while they are wrong.
  explicit HealthLoop(bool correct) : correct_(correct) {}
  // After a whole pass: whether another one is needed, with what `options` then says.
  bool Again(const Reconstructor& pass, ReconstructOptions* options);
  const HealthReport& report() const { return report_; }

 private:
  bool correct_;
  int passes_ = 0;
  bool misfit_ = false;  // sigmas are widened by it
  HealthReport report_;
};

// The whole of a trial in one call; Ctrl-C is heeded between blocks. `health`, when not null, gets
// what the trial says of its cameras. A camera that is wrong is left out while it is, or put right
// with `correct`.
data::Tracks Reconstruct(const data::TrialReader& trial, const data::Rig& rig,
                         const ReconstructOptions& options = {},
                         ReconstructSummary* summary = nullptr, bool correct = false,
                         HealthReport* health = nullptr);
data::Tracks Reconstruct(const data::TrialReadings& readings, const data::Rig& rig,
                         const ReconstructOptions& options = {},
                         ReconstructSummary* summary = nullptr, bool correct = false,
                         HealthReport* health = nullptr);
// The same of any record: `open` begins a pass, `process(first, count, pass, tracks)` does a block.
using OpenPass = std::function<std::unique_ptr<Reconstructor>(const ReconstructOptions&)>;
using ProcessBlock = std::function<void(std::size_t, std::size_t, Reconstructor*, data::Tracks*)>;
data::Tracks ReconstructPasses(const OpenPass& open, const ProcessBlock& process, std::size_t size,
                               const ReconstructOptions& options, ReconstructSummary* summary,
                               bool correct, HealthReport* health);

}  // namespace unfurl::measure
