#pragma once

#include <array>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "data/rig.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "measure/background.h"
#include "measure/spot.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

struct ReconstructOptions {
  SpotOptions spot{};
  TriangulateOptions point{};
  // Continuity, for telling which of four readings is wrong: a mark moves on as it did, within half
  // this acceleration times the square of the time since [m/s^2] (a latch kicks), and within this
  // many sigmas. Older samples than `longest_gap` [s] tell nothing.
  double max_acceleration = 200.0;
  double gate_sigmas = 5.0;
  double longest_gap = 0.1;
  std::size_t workers = 0;  // 0: all cores; the result does not depend on it
};

struct ReconstructSummary {
  std::size_t lines = 0, dark_lines = 0;
  std::vector<std::string> marks;
  std::vector<std::array<std::size_t, 4>> status;  // by mark and data::SampleStatus
  std::map<std::string, std::size_t> unsolved;     // by reason
  std::vector<std::array<std::size_t, 6>> flags;   // by camera and bit of SpotFlag, lit lines
  std::vector<std::size_t> readings;               // by camera, usable
  std::size_t samples() const;
  std::size_t usable() const;
};

// From raw lines to marks in time, block after block; what is remembered from one to the next are
// backgrounds and where each mark last was, so the result does not depend on the blocks' size.
class Reconstructor {
 public:
  // Throws Error when the rig is not the one that recorded the trial.
  Reconstructor(const data::TrialReader& trial, const data::Rig& rig, const std::string& rig_path,
                const ReconstructOptions& options = {});

  // Frame, marks and shared rank, no samples: for TracksWriter.
  const data::Tracks& layout() const { return layout_; }
  // The block's samples, in order of time. Blocks must follow each other from line 0.
  void Process(const data::TrialBlock& block, data::Tracks* tracks);

  const ReconstructSummary& summary() const { return summary_; }

 private:
  struct Past {  // a mark's last two good places
    std::array<double, 2> t{};
    std::array<Eigen::Vector3d, 2> p;
    int count = 0;
  };

  void FindSpots(const data::TrialBlock& block);
  // Decides by continuity which reading to leave out; false when nothing decides.
  bool LeaveOneOut(const Past& past, double t, std::span<const double> u, std::span<const double> s,
                   PointSolution* point) const;

  ReconstructOptions options_;
  data::TrialHeader header_;
  Triangulator triangulator_;
  data::Tracks layout_;
  ReconstructSummary summary_;
  std::vector<std::int32_t> mark_of_slot_;  // -1: dark
  std::vector<Background> backgrounds_;     // by camera
  std::vector<SpotFinder> finders_;
  std::vector<Past> past_;   // by mark
  std::vector<Spot> spots_;  // line x camera, of the block
  std::size_t next_line_ = 0;
  std::size_t primed_ = 0;  // lines whose dark ones the backgrounds already know
};

// The whole of a trial at once.
data::Tracks Reconstruct(const data::TrialReader& trial, const data::Rig& rig,
                         const ReconstructOptions& options = {},
                         ReconstructSummary* summary = nullptr);

}  // namespace unfurl::measure
