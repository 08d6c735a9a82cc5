// What is looked at of a record before it is reconstructed: dark lines for the backgrounds of its
// beginning, and samples of the whole for speeds, spots and the volume that the marks go through.
#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/statistics.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

namespace {

constexpr double kReconstructLookAheadNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

// The background of the first lines comes from the dark ones among them; further ones are looked at
// until there is one.
void Reconstructor::PrimeBackgrounds(const std::string& path, std::size_t size,
                                     const ReadBlock& read) {
  data::TrialBlock block;
  std::vector<double> last(layout_.marks.size(), kReconstructLookAheadNone), intervals;
  while (primed_ < size && (primed_ == 0 || backgrounds_[0].empty())) {
    const std::size_t count = std::min(LiveBeginning::kLines, size - primed_);
    read(primed_, count, &block);
    primed_ += count;
    FindInterval({block.t, block.slot}, &last, &intervals);
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (!slots_[static_cast<std::size_t>(block.slot[i])].marks.empty()) continue;
      for (std::size_t c = 0; c < header_.cameras.size(); ++c) {
        backgrounds_[c].Add(block.Line(header_, i, c));
      }
    }
  }
  if (size > 0 && backgrounds_[0].empty()) {
    throw Error("has no dark line", path,
                "record with a slot named dark: the background is taken from it");
  }
  SetInterval(&intervals);
}

void Reconstructor::FindInterval(const Lines& lines, std::vector<double>* last,
                                 std::vector<double>* intervals) {
  for (std::size_t i = 0; i < lines.t.size(); ++i) {
    for (const int mark : slots_[static_cast<std::size_t>(lines.slot[i])].marks) {
      double& before = (*last)[static_cast<std::size_t>(mark)];
      if (lines.t[i] > before) intervals->push_back(lines.t[i] - before);
      before = lines.t[i];
    }
  }
}

// Of a record that ends before any mark is lit again, a round of slots at the rate of the lines.
void Reconstructor::SetInterval(std::vector<double>* intervals) {
  interval_ = !intervals->empty() ? Median(*intervals)
                                  : static_cast<double>(slots_.size()) / header_.line_rate;
}

namespace {

struct LastPoint {  // of a mark, with a fourth reading
  double t = 0.0;
  PointSolution point;
};

// Adds a line's usable points, and the speeds of its marks since their last points; a fourth
// reading vouches for both ends of a step.
void AddSpeeds(const TrackedLine& line, std::vector<LastPoint>* last,
               std::vector<PointSolution>* points, std::vector<double>* speeds) {
  for (std::size_t m = 0; m < line.lit.size(); ++m) {
    const TrackedPoint& point = line.points[m];
    if (!data::Usable(point.status)) continue;
    points->push_back(point.point);
    if (point.own <= 3) continue;
    LastPoint& before = (*last)[static_cast<std::size_t>(line.lit[m])];
    if (before.point.readings > 3 && line.t > before.t) {
      speeds->push_back((point.point.p - before.point.p).norm() / (line.t - before.t));
    }
    before = {line.t, point.point};
  }
}

}  // namespace

TrackerOptions Reconstructor::LookAhead(std::size_t size, const Look& look,
                                        std::vector<FlashReadings>* flashes) {
  constexpr std::size_t kLooks = 64, kRounds = 2;  // pieces of the trial, each so many rounds long
  constexpr std::size_t kMostLines = 64;           // of a piece
  constexpr std::size_t kEnough = 24;              // points; fewer say too little of the way
  constexpr double kCrossing = 40.0;               // samples in which a mark may cross the volume
  constexpr double kMargin = 5.0;  // over the fastest seen: looking ahead misses most kicks
  constexpr double kMergeWidths = 3.0, kWide = 0.95;  // spots' widths, and which of them counts
  const double crossing = triangulator_.size() / (kCrossing * interval_);
  TrackerOptions out{.motion = {.interval = interval_, .max_speed = crossing},
                     .associate = options_.associate};
  if (size == 0) return out;
  // A round of slots brings each mark once.
  const std::size_t lines =
      std::min({kRounds * std::max<std::size_t>(1, slots_.size()), kMostLines, size});
  std::vector<PointSolution> points;
  std::vector<double> widths, speeds;
  std::vector<Seen> seen;
  std::vector<std::span<const Candidate>> candidates;
  for (std::size_t piece = 0; piece < kLooks; ++piece) {
    const std::size_t first = piece * size / kLooks;
    const Lines here = look(first, std::min(lines, size - first), &seen);
    MarkTracker tracker(triangulator_, layout_.marks.size(), out);
    std::vector<LastPoint> last(layout_.marks.size());
    const auto take = [&] {
      while (const TrackedLine* line = tracker.Next()) AddSpeeds(*line, &last, &points, &speeds);
    };
    for (std::size_t i = 0; i < here.t.size(); ++i) {
      const Slot& slot = slots_[static_cast<std::size_t>(here.slot[i])];
      if (slot.marks.empty()) continue;
      const std::span<const Seen> of_line(&seen[i * layout_.cameras.size()],
                                          layout_.cameras.size());
      for (const Seen& one : of_line) {
        if (one.count > 0 && one.width_px > 0.0F) widths.push_back(one.width_px);
      }
      Candidates(of_line, &candidates);
      if (slot.marks.size() == 1) {
        flashes->emplace_back().fill(kReconstructLookAheadNone);
        for (std::size_t c = 0; c < of_line.size(); ++c) {
          if (of_line[c].count > 0) flashes->back()[c] = of_line[c].spots[0].u_px;
        }
      }
      tracker.Add(here.t[i], slot.marks, candidates);
      take();
    }
    tracker.Finish();
    take();
  }
  if (triangulator_.shared_rank() > 0 && points.size() >= kEnough) {
    triangulator_.ReduceShared(points);
  }
  if (!widths.empty()) out.associate.merge_px = kMergeWidths * Quantile(widths, kWide);
  const double fastest = speeds.empty() ? 0.0 : *std::max_element(speeds.begin(), speeds.end());
  out.motion.max_speed =
      options_.max_speed > 0.0 ? options_.max_speed : std::max(crossing, kMargin * fastest);
  return out;
}

}  // namespace unfurl::measure
