#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "data/tracks.h"
#include "measure/associate.h"
#include "measure/motion.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

// One mark in one line: the point, or why there is none.
struct TrackedPoint {
  PointSolution point;
  data::SampleStatus status = data::SampleStatus::kUnsolvable;
  // Readings that the point was made from, NaN where a camera has none in it [px].
  std::array<double, CameraBank::kMaxCameras> u_px, s_px;
  int own = 0;                 // readings that are this mark's alone
  std::uint32_t left_out = 0;  // bit c: camera c saw something that was not taken
};

struct TrackerOptions {
  MotionOptions motion{};
  AssociateOptions associate{};
};

// From readings to points, line after line, with what the lines before told: where each mark moves,
// and which cameras have been wrong of late.
//
// A line of one mark and one spot per camera is solved at once; four readings that meet need no
// other witness. Where they do not meet, where a camera has several spots, and where marks are lit
// together, the Associator decides. Points of three readings must continue the mark's way.
class MarkTracker {
 public:
  MarkTracker(const Triangulator& triangulator, std::size_t marks,
              const TrackerOptions& options = {});

  // Where a mark is before its first sample.
  void Expect(std::size_t mark, const Eigen::Vector3d& p, double sigma) {
    motion_[mark].Expect(p, sigma);
  }

  // The marks `lit` in a line at time `t`, with the candidates of every camera; `out` one for each
  // of them. Times must not fall.
  void Add(double t, std::span<const int> lit, std::span<const std::span<const Candidate>> cameras,
           std::vector<TrackedPoint>* out);

  // Marks that were named by their places, because nobody said where they start.
  const std::vector<bool>& named_by_place() const { return named_by_place_; }

 private:
  bool Alone(double t, int mark, std::span<const std::span<const Candidate>> cameras,
             TrackedPoint* out);
  void Together(double t, std::span<const int> lit,
                std::span<const std::span<const Candidate>> cameras,
                std::vector<TrackedPoint>* out);
  void FindHidden(std::span<const std::span<const Candidate>> cameras);
  bool Believed(double t, int mark, const PointSolution& point);
  void ThreeReadings(double t, const Motion& motion, TrackedPoint* out) const;
  void Settle(double t, int mark, TrackedPoint* out);

  const Triangulator& triangulator_;
  TrackerOptions options_;
  Associator associator_;
  std::vector<Motion> motion_;
  std::vector<bool> named_by_place_;
  struct Waiting {
    double t = -1e300;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
  };
  std::vector<Waiting> waiting_;  // by mark: an unexpected place that nothing has confirmed yet
  // How often each camera was wrong of late, forgotten over some hundred lines.
  std::vector<double> wrong_, seen_, miss_;
  std::vector<Associator::Mark> marks_;
  std::vector<std::array<double, CameraBank::kMaxCameras>> expected_u_;  // by mark and camera
  std::vector<Association> found_;
};

}  // namespace unfurl::measure
