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
  std::uint32_t left_out = 0;  // bit c: a spot of camera c was rejected or left unused
};

/// Of motion and association.
struct TrackerOptions {
  MotionOptions motion{};
  AssociateOptions associate{};
};

// From readings to points, line after line, with what is known from earlier lines (where each mark
// moves, which cameras have been wrong of late) and, where it is given, from later ones.
//
// Readings of one mark that meet, four or more, need no other witness as long as the cameras are
// trusted. Where they do not meet, where a camera has several spots, and where marks are lit
// together, the Associator decides. Points of three readings must continue the mark's way.
class Follower {
 public:
  // By camera, the candidates of one line.
  using Cameras = std::span<const std::span<const Candidate>>;

  Follower(const Triangulator& triangulator, std::size_t marks, const TrackerOptions& options);

  // Where a mark is before its first sample.
  void Expect(std::size_t mark, const Eigen::Vector3d& p, double sigma) {
    motion_[mark].Expect(p, sigma);
  }
  const Motion& motion(int mark) const { return motion_[static_cast<std::size_t>(mark)]; }

  // What a line of one mark shows by itself: the point of each camera's first spot. True where no
  // camera's second spot, and no residual, stands against it.
  bool Alone(Cameras cameras, const Eigen::Vector3d& start, TrackedPoint* out) const;

  // The line's points, where `first` and the lines before leave no doubt; then they count for what
  // follows. `first` one for each mark: of one mark what Alone gave (`clear`: true), of several
  // what another follower decided.
  bool Take(double t, std::span<const int> lit, bool clear, std::span<const TrackedPoint> first,
            std::vector<TrackedPoint>* out);
  // The same whatever the doubt. `after`: what the lines that follow tell of each mark (at times
  // -t, the latest first), empty where nothing is known of them.
  void Decide(double t, std::span<const int> lit, Cameras cameras,
              std::span<const TrackedPoint> first, std::span<const Motion> after,
              std::vector<TrackedPoint>* out);

  // Marks that were named by their places, because nobody said where they start.
  const std::vector<bool>& named_by_place() const { return named_by_place_; }

 private:
  bool Trusted() const;
  void ThreeReadings(double t, const Motion& motion, TrackedPoint* out) const;
  void Together(double t, std::span<const int> lit, Cameras cameras, std::span<const Motion> after,
                std::vector<TrackedPoint>* out);
  // Whether so little may have happened since that being within reach is evidence.
  bool Telling(const Motion& motion, double t) const;
  PointOutcome Allowed(double t, int mark, const Motion* after, bool several, bool one_each,
                       bool lost, const TrackedPoint& mine) const;
  bool ExpectMarks(double t, std::span<const int> lit, std::span<const Motion> after);
  TrackedPoint PointOf(std::size_t m, bool several, Cameras cameras) const;
  void TakeUpLost(std::vector<TrackedPoint>* out) const;
  void FindHidden(Cameras cameras);
  void Settle(double t, int mark, TrackedPoint* out);

  const Triangulator& triangulator_;
  TrackerOptions options_;
  Associator associator_;
  std::vector<Motion> motion_;
  std::vector<bool> named_by_place_;
  // How often each camera was wrong of late, forgotten over some hundred lines [-].
  std::vector<double> wrong_, seen_, miss_;
  std::vector<Associator::Mark> marks_;
  std::vector<std::array<double, CameraBank::kMaxCameras>> expected_u_;  // by mark and camera
  std::vector<Association> found_;
};

}  // namespace unfurl::measure
